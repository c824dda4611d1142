"""From rows of measures to the arrays that tests take: complete participants, and who is left out."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pandas as pd

from pipeline import tables
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.result import FloatArray
from pipeline.study import Comparison, Study

Row = dict[str, Any]


def by_condition(study: Study, entry: Comparison, measure: str, measures: pd.DataFrame) -> tuple[FloatArray, list[Row]]:
    """Complete participants × conditions, each the participant's mean over everything else, and who is left out."""
    wide = tables.participant_means(measures, measure, study.conditions)
    return wide.dropna().to_numpy(np.float64), incomplete(entry, measure, wide)


def by_factor(study: Study, entry: Comparison, measure: str, measures: pd.DataFrame) -> tuple[FloatArray, list[Row]]:
    """Complete participants × levels of each factor, the factors in the order of `within`, and who is left out."""
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
    complete = wide.dropna().to_numpy(np.float64)
    return complete.reshape(len(complete), *(len(level) for level in levels)), incomplete(entry, measure, wide)


def incomplete(entry: Comparison, measure: str, wide: pd.DataFrame) -> list[Row]:
    """Who is left out of a comparison because a cell is missing (listwise)."""
    left_out: list[Row] = []
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
    return left_out
