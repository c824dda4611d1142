"""Tests of logarithms (`transform: log`): which function computes them, and what their rows say of ratios.

A row's effect size is the geometric mean under the first condition over that under the second, as a difference is the
first minus the second. Sentences say the inverse, the second relative to the baseline, which stands in the details.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.analysis.complete_cases import Request
from pipeline.statistics import NO_LOGARITHMS, OF_LOGARITHMS, OK, RATIO
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.logarithms import as_ratio, exponential, logarithms
from pipeline.statistics.pairs import FollowUp, names_in
from pipeline.statistics.result import Result
from pipeline.study.measures import measure
from pipeline.tables.table import Row

RATIO_OF_RATIOS = "ratio of ratios"


def on_logarithms(request: Request) -> bool:
    """Does the entry ask for the logarithms of the values?"""
    return request.entry.transform == "log"


def results_of_logarithms(test: Callable[[FloatArray], Sequence[Result]], values: FloatArray) -> list[Result]:
    """The results of a test of the logarithms of values, estimates as ratios; the status where a value has none."""
    logs = logarithms(values)
    if not isinstance(logs, str):
        return [_of_logarithms(result) for result in test(logs)]
    # Equal values are undefined too, in the same rows.
    results = [_of_logarithms(result) for result in test(np.zeros_like(values))]
    return [replace(result, status=NO_LOGARITHMS) for result in results]


def _of_logarithms(result: Result) -> Result:
    if result.effect_size_name != "estimate":
        return replace(result, method=result.method + OF_LOGARITHMS)
    found = as_ratio(result)
    return (
        replace(found, effect_size_name=RATIO_OF_RATIOS) if ":" in result.effect and result.contrast is None else found
    )


def follow_ups_of_logarithms(test: Callable[[FloatArray], Sequence[FollowUp]], values: FloatArray) -> list[FollowUp]:
    """The t tests that follow up an analysis, of the logarithms of values: ratios of the pairs' geometric means."""
    logs = logarithms(values)
    if isinstance(logs, str):
        pairs = test(np.zeros_like(values))
        return [replace(one, result=replace(as_ratio(one.result), status=NO_LOGARITHMS)) for one in pairs]
    return [
        FollowUp(
            replace(one.pair, first=np.exp(one.pair.first), second=np.exp(one.pair.second)),
            as_ratio(one.result),
        )
        for one in test(logs)
    ]


def may_have_zero(name: str) -> bool:
    """May the zero of a measure mean none, so that a reduction of it means something?"""
    return measure(name).scale in ("ratio", "unknown")


def with_ratio(row: Row) -> Row:
    """The row of a pair, with what is said of the ratio of its geometric means, if it is of logarithms."""
    if row["status"] != OK or row["effect_size_name"] != RATIO or row["contrast"] is None:
        return row
    return with_ratio_of(row, row["details"]["log_ratio_ci"], _first_of(row["contrast"]))


def with_ratio_of(row: Row, log_interval: Sequence[float | None], first: str | None) -> Row:
    """The row with the ratio of the second geometric mean to the first, its interval, and the first's name if known.

    The logarithms' interval is symmetric, so that its middle is the logarithm of the ratio.
    """
    low, high = log_interval
    if low is None or high is None:
        return row
    log_ratio = (low + high) / 2
    said = {
        "log_ratio": log_ratio,
        "ratio_to_first": exponential(-log_ratio),
        "ratio_to_first_ci": [exponential(-high), exponential(-low)],
        "first": first,
    }
    reduction = -math.expm1(-log_ratio) if may_have_zero(row["measure"]) and said["ratio_to_first"] else None
    return {**row, "reduction": reduction, "details": {**row["details"], **said}}


def _first_of(contrast: str) -> str | None:
    """The first name of `A - B` or `A - B | easy`; None where names that hold " - " can be read in two ways."""
    names = names_in(contrast.rsplit(" | ", 1)[0])
    return None if names is None else names[0]
