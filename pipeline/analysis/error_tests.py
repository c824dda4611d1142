"""The tests of study.yaml for answers that are right or wrong (0 or 1), and for counts: from measures to rows.

McNemar's and Cochran's tests take one answer of each participant in each condition. The generalized estimating
equations take every trial there is. The table `observations` has the mean of the n trials of a cell, which is all that
is needed: of answers it tells how many were 1, and of counts the sum over a cell is as informative as its trials.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from pipeline.analysis import complete_cases
from pipeline.analysis.comparison_rows import Answer, group_pair_row, row_of
from pipeline.analysis.complete_cases import Request
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics import OK, pairs
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.clustered import Family, Trials, gee
from pipeline.statistics.errors import cochran_q, mcnemar
from pipeline.statistics.result import IntArray
from pipeline.tables.table import Row

_ROUND_OFF = 1e-9  # of a sum that was a mean
_CELL = ["participant", "condition", "session", "period", "factors"]


def mcnemar_pairs(request: Request) -> Answer:
    """One row for each pair of conditions."""
    cases = complete_cases.by_condition(request)
    return [
        group_pair_row(request, mcnemar(pair.first, pair.second), pair)
        for pair in pairs.of_conditions(cases.values, cases.levels[0])
    ], cases.left_out


def cochran(request: Request) -> Answer:
    """One row, followed by McNemar's test of every two of three conditions or more."""
    cases = complete_cases.by_condition(request)
    of_conditions = pairs.of_conditions(cases.values, cases.levels[0])
    rows = [row_of(request, cochran_q(cases.values))]
    if len(of_conditions) > 1 and request.entry.follow_up != "none":
        for pair in of_conditions:
            row = group_pair_row(request, mcnemar(pair.first, pair.second), pair)
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows, cases.left_out


def logistic(request: Request) -> Answer:
    """Rows of the conditions' odds of a 1, over all trials."""
    observed = _observed(request)
    counts = np.rint(observed.trials)
    ones = observed.sums
    if np.all((np.abs(ones - np.rint(ones)) < _ROUND_OFF * counts) & (ones >= -_ROUND_OFF) & (ones <= counts)):
        each = np.stack([np.rint(ones), counts - np.rint(ones)], axis=1).astype(np.int64)
        outcome = np.tile([1.0, 0.0], len(ones)).repeat(each.ravel())
        whose = np.arange(len(ones)).repeat(counts.astype(np.int64))
    else:  # values that are no answers, which the test says
        outcome, whose = ones / counts, np.arange(len(ones))
    trials = Trials(outcome, [observed.people[at] for at in whose], observed.conditions[whose])
    return _rows(request, trials, "logit", len(outcome)), observed.left_out


def counted(request: Request) -> Answer:
    """Rows of the conditions' rates of events, over all trials: for each trial, or for each unit of the exposure."""
    observed = _observed(request)
    sums = np.rint(observed.sums)
    whole = np.abs(sums - observed.sums) < _ROUND_OFF * np.maximum(observed.trials, np.abs(sums))
    outcome = np.where(whole, sums, observed.sums)
    trials = Trials(outcome, observed.people, observed.conditions, observed.exposure)
    return _rows(request, trials, "poisson", int(observed.trials.sum())), observed.left_out


@dataclass(frozen=True)
class _Observed:
    """For each cell that a participant has (N,): the sum over its trials, how many there are, and their exposure."""

    sums: FloatArray
    trials: FloatArray
    exposure: FloatArray
    people: list[str]
    conditions: IntArray
    left_out: list[Row]


def _observed(request: Request) -> _Observed:
    rows, factors = complete_cases.rows_and_factors(request, request.observations)
    left_out = complete_cases.rare_levels(request, factors)
    rows = rows.assign(exposed=rows["n"].astype("float64"))
    if request.entry.exposure is not None:
        rows, without = _with_exposure(request, rows, request.entry.exposure)
        left_out += without
    levels = list(request.study.conditions)
    trials = rows["n"].to_numpy(np.float64)
    codes = np.array([levels.index(condition) for condition in rows["condition"]], dtype=np.int64)
    sums = rows["value"].to_numpy(np.float64) * trials
    exposure = rows["exposed"].to_numpy(np.float64)
    return _Observed(sums, trials, exposure, [str(name) for name in rows["participant"]], codes, left_out)


def _with_exposure(request: Request, rows: pd.DataFrame, name: str) -> tuple[pd.DataFrame, list[Row]]:
    """The rows whose cell has the measure `name`, with its sum over the cell, and who has no such cell."""
    known = request.observations
    exposures = known[known["measure"] == name]
    if exposures.empty:
        hint = did_you_mean(name, sorted(set(known["measure"])))
        raise PipelineError(f'study.yaml: comparisons: exposure: there is no measure "{name}" in the data{hint}')
    sums = exposures.assign(exposed=exposures["value"] * exposures["n"].astype("float64"))[[*_CELL, "exposed"]]
    joined = rows.drop(columns="exposed").merge(sums, on=_CELL, how="left")
    lacking = joined[joined["exposed"].isna()]
    left_out = [
        complete_cases.left_out(request, str(person), f"no {name} in {', '.join(dict.fromkeys(cells['condition']))}")
        for person, cells in lacking.groupby("participant", sort=True)
    ]
    return joined.drop(index=lacking.index), left_out


def _rows(request: Request, trials: Trials, family: Family, count: int) -> list[Row]:
    """The row of all conditions, where there are more than two, and those of every two."""
    levels = list(request.study.conditions)
    rows = []
    for result in gee(trials, levels, family):
        details = {**result.details, "n_observations": count} if result.status == OK else result.details
        if request.entry.exposure is not None and details:
            details = {**details, "exposure": request.entry.exposure}
        if count != len(trials.outcome):
            details = {name: value for name, value in details.items() if name != "dispersion"}
        row = _with_change(row_of(request, replace(result, details=details)), levels)
        follows_up = result.contrast is not None and len(levels) > 2
        if not follows_up:
            rows.append(row)
        elif request.entry.follow_up != "none":
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows


def _with_change(row: Row, levels: list[str]) -> Row:
    """The row of a pair with the difference of the shares or rates, and by how much the second is lower."""
    if row["contrast"] is None or row["status"] != OK:
        return row
    named = {f"{one} - {two}": (i, j) for i, one in enumerate(levels) for j, two in enumerate(levels) if i < j}
    first, second = (row["details"]["means"][place] for place in named[row["contrast"]])
    return {**row, "mean_difference": first - second, "reduction": 1 - second / first}
