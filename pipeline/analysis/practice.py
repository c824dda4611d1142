"""Do people become faster from trial to trial, and are they still doing so at the end? Rows of `learning`.

Where everybody had the same targets in the same order and these differ in distance or width, a trial's number says
which target it had, and nothing here can tell practice from the targets. The rows stay, with a remark.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.statistics import TOO_FEW_TRIALS
from pipeline.statistics.learning import learning
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.result import Result
from pipeline.tables.table import Row

TRIALS_MIN = 3
"""Of a participant in a condition: a line through two trials says nothing of how far it is off."""

ALL_TRIALS, LAST_HALF = "all trials", "last half"
_CELL = ["participant", "condition"]
_MEASURE = "trial_time_s"
_SAME = 1.1 / 0.9  # from the least to the greatest of distances within 10 % of one
_FIXED = 0.9  # of the trial numbers; a few may be off, as where a session lost its first trial
_OF_TARGETS = "everybody had the same targets in the same order, so practice cannot be told from the targets"


def learning_rows(movements: pd.DataFrame, conditions: Sequence[str]) -> list[Row]:
    """Of all trials each condition and each two; then each condition's last half. None where no trial has a time.

    `movements` is the table of the study. p is adjusted after Holm over the conditions, and over the pairs.
    """
    timed = movements[movements["duration_s"].notna()]
    if timed.empty:
        return []
    known = timed[in_one_session(timed)]
    last = known["order"] > known.groupby(_CELL)["order"].transform("max") / 2
    of_all, of_last = (_tested(with_enough(trials), conditions) for trials in (known, known[last]))
    people = timed.groupby("condition")["participant"].nunique().to_dict()
    remark = _OF_TARGETS if number_tells_target(movements) else None
    rows: list[Row] = []
    for part, results in (
        (ALL_TRIALS, of_all[: len(conditions)]),
        (ALL_TRIALS, of_all[len(conditions) :]),
        (LAST_HALF, of_last[: len(conditions)]),
    ):
        p_adjusted = adjusted([result.p for result in results], "holm")
        for result, p in zip(results, p_adjusted, strict=True):
            everybody = people.get(result.contrast or "", timed["participant"].nunique())
            rows.append({**_row(result, part, int(everybody)), "p_adjusted": p, "remark": remark})
    return rows


def in_one_session(trials: pd.DataFrame) -> pd.Series:
    """Which trials are of participants with one session of the condition: of several nobody says which came first."""
    one: pd.Series = trials.groupby(_CELL)["session"].transform("nunique") <= 1
    return one


def with_enough(trials: pd.DataFrame) -> pd.DataFrame:
    """The trials of participants who have three or more in the condition."""
    enough: pd.DataFrame = trials[trials.groupby(_CELL)["order"].transform("size") >= TRIALS_MIN]
    return enough


def number_tells_target(movements: pd.DataFrame) -> bool:
    """Has a trial the same distance and width for everybody, by its number, and do distances or widths differ?"""
    known = movements[movements["amplitude_mm"] > 0]
    if known["participant"].nunique() < 2 or not _differ(known):
        return False
    same = [not _differ(trials) for _, trials in known.groupby("order") if len(trials) > 1]
    return bool(same) and float(np.mean(same)) >= _FIXED


def _differ(trials: pd.DataFrame) -> bool:
    """Do the distances of the trials differ by more than 10 % of one, or their targets in width?"""
    return bool(trials["amplitude_mm"].max() > _SAME * trials["amplitude_mm"].min() or trials["width_mm"].nunique() > 1)


def _tested(trials: pd.DataFrame, conditions: Sequence[str]) -> list[Result]:
    codes = pd.Categorical(trials["condition"], categories=list(conditions)).codes
    return learning(
        trials["duration_s"].to_numpy(np.float64),
        trials["order"].to_numpy(np.float64),
        trials["participant"].to_numpy(object).tolist(),
        codes.astype(np.int64),
        conditions,
    )


def _row(result: Result, part: str, people: int) -> Row:
    details = result.details
    n = result.n if details else 0
    low, high = details.get("ci_slope") or (None, None)
    return {
        "measure": _MEASURE,
        "trials": part,
        "contrast": result.contrast,
        "n": n,
        "left_out": people - n,
        "slope": details.get("slope"),
        "ci_low": low,
        "ci_high": high,
        "ratio_when_trials_double": details.get("ratio_when_trials_double"),
        "first_trial_s": details.get("value_at_first_trial") if part == ALL_TRIALS else None,
        "statistic_name": result.statistic_name,
        "statistic": result.statistic,
        "df2": result.df2,
        "p": result.p,
        "effect_size_name": result.effect_size_name,
        "effect_size": result.effect_size,
        "method": result.method,
        "status": TOO_FEW_TRIALS if details and n == 0 else result.status,
    }
