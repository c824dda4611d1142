"""Rows of the table `comparisons`, from a test's result and the two samples it compares."""

from __future__ import annotations

import numpy as np

from pipeline.analysis.complete_cases import CompleteCases, Request
from pipeline.analysis.ratios import may_have_zero, on_logarithms, with_ratio
from pipeline.statistics import OK, diagnostics
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.pairs import Pair
from pipeline.statistics.result import Result
from pipeline.tables.table import Row

Answer = tuple[list[Row], list[Row]]
"""Rows of `comparisons`, and the exclusions of incomplete participants."""


def group_pair_row(request: Request, result: Result, pair: Pair) -> Row:
    """The row of a test of two groups."""
    return with_ratio({**row_of(request, result), **change_of(request, pair), "contrast": pair.contrast})


def row_of(request: Request, result: Result) -> Row:
    """A result as a row."""
    return {
        "measure": request.measure,
        "test": request.entry.test,
        "effect": result.effect,
        "contrast": result.contrast,
        "n": result.n,
        "statistic_name": result.statistic_name,
        "statistic": result.statistic,
        "df1": result.df1,
        "df2": result.df2,
        "p": result.p,
        "adjust": request.entry.adjust,
        "method": result.method,
        "effect_size_name": result.effect_size_name,
        "effect_size": result.effect_size,
        "ci_low": result.ci_low,
        "ci_high": result.ci_high,
        "status": result.status,
        "details": dict(result.details),
    }


def tested(request: Request, pair: Pair) -> tuple[FloatArray, FloatArray]:
    """What of a pair is tested: its values, or their logarithms."""
    return (np.log(pair.first), np.log(pair.second)) if on_logarithms(request) else (pair.first, pair.second)


def change_of(request: Request, pair: Pair) -> Row:
    """The mean difference of a pair and the reduction; empty where nobody is in the pair, or logarithms are tested.

    A reduction is meaningful only on a scale whose zero means none: never on another scale, and not where a mean is
    zero or negative, which contradicts such a zero.
    """
    if not len(pair.first) or on_logarithms(request):
        return {}
    first, second = float(np.mean(pair.first)), float(np.mean(pair.second))
    has_zero = may_have_zero(request.measure) and first > 0 and second > 0
    return {"mean_difference": first - second, "reduction": 1 - second / first if has_zero else None}


def pair_row(request: Request, result: Result, pair: Pair, cases: CompleteCases) -> Row:
    """The row of a test of two conditions."""
    return diagnosed(request, group_pair_row(request, result, pair), pair, cases)


def diagnosed(request: Request, row: Row, pair: Pair, cases: CompleteCases) -> Row:
    """The row with diagnostics of the differences that were tested (their shape and outliers) among the details."""
    if row["status"] != OK:
        return row
    diagnosis = diagnostics.differences(*tested(request, pair), cases.participants)
    return {**row, "details": {**row["details"], **diagnosis}}
