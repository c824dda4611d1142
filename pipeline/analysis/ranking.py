"""Variants of estimators side by side: means over sessions with intervals, ranked by their error."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.statistics.descriptive import summarize
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import SMOOTHED

_POSSIBLE = {
    "rmse_mm": (0.0, np.inf),
    "sd_mm": (0.0, np.inf),
    "coverage_95": (0.0, 1.0),
    "lag_s": (-np.inf, np.inf),
    "jitter_mm": (0.0, np.inf),
}


def ranked(accuracy: pd.DataFrame, trials: pd.DataFrame) -> list[Row]:
    """Rows of `replay_means`, those with the least mean RMSE first: of each study, and of all where there are several.

    All studies together are ranked over the variants that each of them has. Where smoothed readings stand in for a
    reference there is no rank, and the order is as asked for: how far from the hand a variant was is not known.
    """
    studies = list(dict.fromkeys([*accuracy["study"], *trials["study"]]))
    rows: list[Row] = []
    if len(studies) > 1:
        per_study = [set(_keys(accuracy[accuracy["study"] == study])) for study in studies]
        everywhere = set.intersection(*per_study)
        rows += _ranked(None, *(_only(table, everywhere) for table in (accuracy, trials)))
    for study in studies:
        rows += _ranked(study, accuracy[accuracy["study"] == study], trials[trials["study"] == study])
    return rows


def _keys(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Estimator and variant of each row; an empty variant is the estimator's own settings."""
    return list(zip(table["estimator"], table["variant"].fillna(""), strict=True))


def _only(table: pd.DataFrame, keys: set[tuple[str, str]]) -> pd.DataFrame:
    return table[np.array([key in keys for key in _keys(table)], dtype=bool)]


def _ranked(study: str | None, accuracy: pd.DataFrame, trials: pd.DataFrame) -> list[Row]:
    rows = []
    for estimator, variant in dict.fromkeys([*_keys(accuracy), *_keys(trials)]):
        key = {(estimator, variant)}
        row: Row = {"study": study, "estimator": estimator, "variant": variant or None}
        rows.append(row | _means(_only(accuracy, key)) | _selections(_only(trials, key)))
    if (accuracy["reference"] == SMOOTHED).any():
        return [{**row, "rank": None} for row in rows]
    rows.sort(key=lambda row: row.get("rmse_mm", np.inf))  # stable: equals stand in the order asked for
    return [{**row, "rank": place if "rmse_mm" in row else None} for place, row in enumerate(rows, start=1)]


def _means(rows: pd.DataFrame) -> Row:
    """Each figure's mean over the sessions that have it, with its t interval, cut off at the possible range."""
    means: Row = {"n": len(rows)}
    for name, possible in _POSSIBLE.items():
        values = rows[name].dropna().to_numpy(np.float64)
        if len(values):
            stem, _, unit = name.rpartition("_")
            summary = summarize(values)
            means[name] = summary["mean"]
            if "ci_low" in summary:
                means[f"{stem}_low_{unit}"] = max(summary["ci_low"], possible[0])
                means[f"{stem}_high_{unit}"] = min(summary["ci_high"], possible[1])
    return means


def _selections(trials: pd.DataFrame) -> Row:
    """The root of the mean over sessions of their mean squared errors, with the root of that mean's interval."""
    known = trials[trials["squared_error_mm2"].notna()]
    squared = known.groupby(["study", "session"])["squared_error_mm2"].mean().to_numpy(np.float64)
    if not len(squared):
        return {"selection_n": 0}
    summary = summarize(squared)
    row = {"selection_n": len(squared), "selection_rmse_mm": float(np.sqrt(summary["mean"]))}
    if "ci_low" in summary:
        row["selection_rmse_low_mm"] = float(np.sqrt(max(0.0, summary["ci_low"])))
        row["selection_rmse_high_mm"] = float(np.sqrt(summary["ci_high"]))
    return row
