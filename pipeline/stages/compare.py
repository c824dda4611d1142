"""Descriptives, the study's comparisons, and everything a report shows as tables and results.json."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from pipeline import results, study_tables, tables
from pipeline.errors import PipelineError, did_you_mean
from pipeline.printed import compare_printed
from pipeline.recording import build_estimator
from pipeline.stage import Outcome, Work
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.paired import t_paired
from pipeline.statistics.rank import friedman, wilcoxon
from pipeline.statistics.result import FloatArray, Result
from pipeline.study import Comparison, Study
from pipeline.wording import measure_order

Row = dict[str, Any]
PAIRWISE = ("t_paired", "wilcoxon")
_SESSION_TABLES = ("quality", "accuracy", "replay_agreement", "sensor_noise")


def run(work: Work) -> Outcome:
    """The study's descriptives, comparisons, all exclusions, and results.json."""
    study = work.study
    for name in study.estimators:
        build_estimator(study, name)  # a misspelt one is an error also where there is no log to run it on
    measured = work.entry("measure")
    measures = tables.read("measures", measured)
    found: dict[str, pd.DataFrame] = {
        "trials": tables.read("trials", measured),
        "measures": measures,
        "descriptives": tables.frame("descriptives", descriptives(study, measures)),
    }
    rows, left_out = comparisons(study, measures)
    found["comparisons"] = tables.frame("comparisons", rows)
    left_out += _without_accuracy(work)
    found["exclusions"] = pd.concat(
        [
            tables.frame("exclusions", _sessions(work)),
            tables.read("exclusions", work.entries["ingest"]),
            tables.read("exclusions", measured),
            tables.frame("exclusions", left_out),
        ]
    )
    for name in _SESSION_TABLES:
        entries = work.entries["ingest" if name == "quality" else "assess"]
        found[name] = _without_excluded(study, work, tables.read(name, entries))
    found["accuracy_means"] = tables.frame("accuracy_means", accuracy_means(found["accuracy"]))
    found["shown_at_selection"] = tables.frame("shown_at_selection", shown_at_selection(study, found["trials"]))
    if study.printed is not None:
        path = work.folder / study.printed
        found["printed"] = compare_printed(path, found["descriptives"], found["comparisons"])
    for name, table in found.items():
        tables.write(name, table, work.out)
    results.write(work.out / "results.json", work.study_name, study, found, _people(work, measures))
    return Outcome()


def _without_accuracy(work: Work) -> list[Row]:
    """Sessions whose reference could not be held against any estimate."""
    reference = work.study.stream_of_kind("reference")
    if reference is None or not work.study.estimators:
        return []
    quality = tables.read("quality", work.entries["ingest"])
    there = set(quality.loc[quality["stream"] == reference, "session"])
    rated = set(tables.read("accuracy", work.entries["assess"])["session"])
    reason = "its reference has no instant from 1 s after the first frame on"
    lacking = there - rated
    return [
        {**session.ids, "what": "no accuracy", "reason": reason} for session in work.sessions if session.id in lacking
    ]


def _people(work: Work, measures: pd.DataFrame) -> Row:
    """How many took part, and what participants.csv says of them."""
    if work.study.participants is not None:
        return study_tables.participant_facts(study_tables.read_participants(work.folder / work.study.participants))
    people = set(measures["participant"]) | {str(session.participant) for session in work.sessions}
    return {"n": len(people)}


def _sessions(work: Work) -> list[Row]:
    """The sessions that were set aside or read in part."""
    rows: list[Row] = []
    for what, sessions in (("session set aside", work.set_aside), ("session read in part", work.in_part)):
        rows += [{**session.ids, "what": what, "reason": reason} for session, reason in sessions]
    return rows + [{"session": name, "what": "file not used", "reason": reason} for name, reason in work.unused]


def _without_excluded(study: Study, work: Work, table: pd.DataFrame) -> pd.DataFrame:
    """A session's facts go with it when it is excluded as a whole; the exclusions say so."""
    out = {
        session.id
        for session in work.sessions
        for excluded in study.exclusions
        if excluded.measure is None and excluded.covers(**session.ids)
    }
    return table[~table["session"].isin(out)]


def descriptives(study: Study, measures: pd.DataFrame) -> list[Row]:
    """n, mean, SD, median and the t interval of the mean, a row a measure and condition."""
    rows: list[Row] = []
    for measure in sorted(set(measures["measure"]), key=measure_order):
        wide = tables.participant_means(measures, measure, study.conditions)
        for condition in study.conditions:
            values = wide[condition].dropna().to_numpy(np.float64)
            if len(values):
                rows.append({"measure": measure, "condition": condition, **_described(values)})
    return rows + _root_rows(rows)


def _described(values: FloatArray) -> Row:
    n = len(values)
    row: Row = {"n": n, "mean": float(values.mean()), "median": float(np.median(values))}
    if n > 1:
        sd = float(np.std(values, ddof=1))
        margin = float(stats.t.ppf(0.975, n - 1)) * sd / np.sqrt(n)
        row |= {"sd": sd, "ci_low": row["mean"] - margin, "ci_high": row["mean"] + margin}
    return row


def _root_rows(rows: Iterable[Row]) -> list[Row]:
    """selection_rmse: the root of the mean over participants of their MSEs, never a mean of RMSEs."""
    names = {"selection_mse_px2": "selection_rmse_px", "selection_mse_mm2": "selection_rmse_mm"}
    return [
        {
            "measure": names[row["measure"]],
            "condition": row["condition"],
            "n": row["n"],
            "mean": float(np.sqrt(row["mean"])),
        }
        for row in rows
        if row["measure"] in names and row["mean"] >= 0
    ]


def accuracy_means(accuracy: pd.DataFrame) -> list[Row]:
    """Each estimator's accuracy, means over sessions, as far as a session has the figure."""
    columns = [name for name in tables.TABLES["accuracy_means"].names if name not in ("estimator", "n")]
    return [
        {"estimator": str(estimator), "n": len(rows), **{column: float(rows[column].mean()) for column in columns}}
        for estimator, rows in accuracy.groupby("estimator", sort=False)
    ]


def shown_at_selection(study: Study, trials: pd.DataFrame) -> list[Row]:
    """What each estimator would have shown when people selected: √(mean over participants of their MSEs)."""
    if set(trials["estimator"]) <= {"recorded"}:
        return []
    known = trials[trials["squared_error_mm2"].notna()]
    cell = ["condition", "estimator"]
    per_person = known.groupby([*cell, "participant"])["squared_error_mm2"].mean().reset_index()
    found = {key: rows["squared_error_mm2"] for key, rows in per_person.groupby(cell)}
    return [
        {
            "condition": condition,
            "estimator": estimator,
            "n": len(found[condition, estimator]),
            "rmse_mm": float(np.sqrt(found[condition, estimator].mean())),
        }
        for condition in study.conditions
        for estimator in dict.fromkeys(known["estimator"])
        if (condition, estimator) in found
    ]


def comparisons(study: Study, measures: pd.DataFrame) -> tuple[list[Row], list[Row]]:
    """Every row of `comparisons`, and the exclusions that came of incomplete participants."""
    rows: list[Row] = []
    left_out: list[Row] = []
    for entry in study.comparisons:
        family: list[list[Row]] = []
        for measure in _matching(entry, sorted(set(measures["measure"]), key=measure_order)):
            family.append(_compare(study, entry, measure, measures, left_out))
        if entry.test in PAIRWISE and len(study.conditions) > 2:
            for pairs in family:
                _adjust(entry, pairs)
        else:
            _adjust(entry, [row for measured in family for row in measured])
        rows += [row for measured in family for row in measured]
    unique = {tuple(sorted(row.items())): row for row in left_out}
    return rows, list(unique.values())


def _matching(entry: Comparison, known: Sequence[str]) -> list[str]:
    """The measures an entry names; `*` stands for scales, never for a total."""
    if "*" in entry.measure:
        pattern = ".*".join(re.escape(piece) for piece in entry.measure.split("*"))
        found = [name for name in known if re.fullmatch(pattern, name) and not name.endswith("/total")]
    else:
        found = [name for name in known if name == entry.measure]
    if not found:
        raise PipelineError(
            f'study.yaml: comparisons: there is no measure "{entry.measure}" in the'
            f" data{did_you_mean(entry.measure, known)}"
        )
    return found


def _compare(study: Study, entry: Comparison, measure: str, measures: pd.DataFrame, left_out: list[Row]) -> list[Row]:
    if len(study.conditions) < 2:
        raise PipelineError("study.yaml: comparisons: need two conditions or more, and conditions lists one")
    if len(entry.within) > 1:
        values, labels = _factorial(study, entry, measure, measures, left_out)
        return [_row(entry, measure, result) for result in rm_anova(values, labels)]
    wide = tables.participant_means(measures, measure, study.conditions)
    complete = wide.dropna()
    _list_incomplete(entry, measure, wide, left_out)
    values = complete.to_numpy(np.float64)
    if entry.test in PAIRWISE:
        return [
            _row(entry, measure, _pair(entry, values[:, i], values[:, j]), values[:, [i, j]], (first, second))
            for (i, first), (j, second) in combinations(enumerate(study.conditions), 2)
        ]
    result = rm_anova(values, ["condition"])[0] if entry.test == "rm_anova" else friedman(values)
    return [_row(entry, measure, result, values if values.shape[1] == 2 else None)]


def _pair(entry: Comparison, first: FloatArray, second: FloatArray) -> Result:
    return wilcoxon(first, second, zeros=entry.zeros) if entry.test == "wilcoxon" else t_paired(first, second)


def _factorial(
    study: Study, entry: Comparison, measure: str, measures: pd.DataFrame, left_out: list[Row]
) -> tuple[FloatArray, list[str]]:
    """Complete participants × levels of each factor, the factors in the order of `within`."""
    rows = measures[measures["measure"] == measure].copy()
    told = [json.loads(text) if isinstance(text, str) else {} for text in rows["factors"]]
    for factor in entry.within:
        if factor != "condition":
            rows[factor] = [facts.get(factor) for facts in told]
            if rows[factor].isna().any():
                known = sorted({key for facts in told for key in facts} | {"condition"})
                raise PipelineError(
                    f'study.yaml: comparisons: "{measure}" has no factor "{factor}"{did_you_mean(factor, known)}'
                )
    levels = [
        list(study.conditions) if factor == "condition" else list(dict.fromkeys(rows[factor]))
        for factor in entry.within
    ]
    for factor, found in zip(entry.within, levels, strict=True):
        if len(found) < 2:
            raise PipelineError(f'study.yaml: comparisons: factor "{factor}" of "{measure}" has one level: {found[0]}')
    wide = rows.pivot_table(index="participant", columns=list(entry.within), values="value", aggfunc="mean")
    wide = wide.reindex(columns=pd.MultiIndex.from_product(levels, names=list(entry.within)))
    _list_incomplete(entry, measure, wide, left_out)
    complete = wide.dropna().to_numpy(np.float64)
    return complete.reshape(len(complete), *(len(level) for level in levels)), list(entry.within)


def _list_incomplete(entry: Comparison, measure: str, wide: pd.DataFrame, left_out: list[Row]) -> None:
    """Who is left out of a comparison because a cell is missing (listwise)."""
    for participant in wide.index[wide.isna().any(axis=1)]:
        absent = [
            column if isinstance(column, str) else " × ".join(column)
            for column in wide.columns[wide.loc[participant].isna()]
        ]
        left_out.append(
            {
                "participant": participant,
                "measure": measure,
                "what": "left out of comparisons",
                "reason": f"{entry.test}: no value in {', '.join(absent)}",
            }
        )


def _row(
    entry: Comparison,
    measure: str,
    result: Result,
    values: FloatArray | None = None,
    pair: tuple[str, str] | None = None,
) -> Row:
    """A result as a row; `values` of two conditions give the mean difference and the reduction."""
    row: Row = {
        "measure": measure,
        "test": entry.test,
        "effect": result.effect,
        "contrast": None if pair is None else f"{pair[0]} - {pair[1]}",
        "n": result.n,
        "statistic_name": result.statistic_name,
        "statistic": result.statistic,
        "df1": result.df1,
        "df2": result.df2,
        "p": result.p,
        "adjust": entry.adjust,
        "method": result.method,
        "effect_size_name": result.effect_size_name,
        "effect_size": result.effect_size,
        "ci_low": result.ci_low,
        "ci_high": result.ci_high,
        "status": result.status,
        "details": json.dumps(result.details) if result.details else None,
    }
    if values is not None and len(values):
        first, second = (float(mean) for mean in values.mean(axis=0))
        row["mean_difference"] = first - second
        row["reduction"] = 1 - second / first if first != 0 else None
    return row


def _adjust(entry: Comparison, rows: list[Row]) -> None:
    for row, value in zip(rows, adjusted([row["p"] for row in rows], entry.adjust), strict=True):
        row["p_adjusted"] = value
