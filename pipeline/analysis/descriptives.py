"""What the participants' means say of each condition, before any test: all that the figures of a measure show."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
import pandas as pd

from pipeline.analysis.kinds_of_values import are_answers
from pipeline.analysis.person_means import person_means
from pipeline.statistics import T_OF_SHARES, WILSON
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.descriptive import described, interval_method, summarize
from pipeline.statistics.estimation import within_intervals
from pipeline.study.measures import measure, measure_order
from pipeline.study.settings import Study
from pipeline.tables.table import Row

PersonMeans = Mapping[str, pd.DataFrame]
"""Of each measure, in the order of reports: one row per participant and one column per condition."""


def means_of_measures(study: Study, measures: pd.DataFrame) -> PersonMeans:
    """The participants' means of every measure."""
    names = sorted(set(measures["measure"]), key=measure_order)
    return {name: person_means(study, measures, name) for name in names}


def descriptives(means: PersonMeans, observations: pd.DataFrame) -> list[Row]:
    """n, mean, SD, median and the interval of the mean, one row per measure and condition."""
    rows: list[Row] = []
    for name, wide in means.items():
        described_as = described_values(name, wide, observations)
        for condition in wide.columns:
            values = wide[condition].dropna().to_numpy(np.float64)
            if len(values):
                rows.append({"measure": name, "condition": condition, **described_as(values)})
    return rows + _root_rows(rows)


def described_values(name: str, wide: pd.DataFrame, observations: pd.DataFrame) -> Callable[[FloatArray], Row]:
    """What describes some of a measure's values; `wide`, all participants' means by condition, tells their kind."""
    method = _interval_method(name, wide, observations)
    within_unit = not measure(name).unit and _within_unit(_all_of(wide))
    return lambda values: described(values, method, within_unit)


def intervals_within(means: PersonMeans, observations: pd.DataFrame) -> list[Row]:
    """The Cousineau-Morey interval of each condition's mean, of the participants who met every condition.

    None of single answers 0 or 1, whose differences are no measurements; of shares it is cut at 0 and 1.
    """
    rows: list[Row] = []
    for name, wide in means.items():
        method = _interval_method(name, wide, observations)
        complete = wide.dropna()
        values = complete.to_numpy(np.float64)
        intervals = [None] if method == WILSON else within_intervals(values, bounded=method == T_OF_SHARES)
        for condition, bounds in zip(wide.columns, intervals, strict=False):
            if bounds is not None:
                cell = {"measure": name, "condition": condition, "n": len(complete)}
                rows.append(
                    {**cell, "mean": float(complete[condition].mean()), "ci_low": bounds[0], "ci_high": bounds[1]}
                )
    return rows


def differences(means: PersonMeans) -> list[Row]:
    """The baseline minus each other condition, of the participants who met every condition, with the t interval."""
    rows: list[Row] = []
    for name, wide in means.items():
        complete = wide.dropna()
        first, *others = wide.columns
        for other in others if len(complete) > 1 else ():
            apart = (complete[first] - complete[other]).to_numpy(np.float64)
            found = summarize(apart)
            bounds = {end: found[end] for end in ("mean", "ci_low", "ci_high")}
            lower = int(np.sum(apart > 0))
            rows.append({"measure": name, "contrast": f"{first} - {other}", "n": len(apart), **bounds, "lower": lower})
    return rows


def _interval_method(name: str, wide: pd.DataFrame, observations: pd.DataFrame) -> str:
    values = _all_of(wide)
    shares = _within_unit(values) and are_answers(observations[observations["measure"] == name])
    return interval_method(values, shares, measure(name).unit != "")


def _within_unit(values: FloatArray) -> bool:
    return bool(((values >= 0) & (values <= 1)).all())


def _all_of(wide: pd.DataFrame) -> FloatArray:
    """The values of all conditions that are there (n,): who met one condition has gaps in the others."""
    values = wide.to_numpy(np.float64)
    known: FloatArray = values[~np.isnan(values)]
    return known


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
