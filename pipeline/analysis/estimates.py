"""Rows with what an entry asks for beside its test: bootstrap intervals and permutation p values."""

from __future__ import annotations

from types import ModuleType

from pipeline.analysis.comparison_rows import tested
from pipeline.analysis.complete_cases import Request
from pipeline.analysis.ratios import on_logarithms
from pipeline.statistics import OK
from pipeline.statistics.logarithms import exponential
from pipeline.statistics.pairs import Pair
from pipeline.tables.table import Row


def with_estimates(request: Request, row: Row, pair: Pair, estimation: ModuleType) -> Row:
    """The row with a bootstrap interval and a permutation p of its mean difference, as far as the entry asks for them.

    Both are of the values alone, whatever the test: also where the ranks are tested, they are of the mean.
    `estimation` is `statistics.estimation` for two values of each participant, `estimation_groups` for two groups.
    """
    if row["status"] != OK:
        return row
    details = dict(row["details"])
    first, second = tested(request, pair)
    if request.entry.bootstrap:
        details |= estimation.bootstrap(first, second, request.entry.seed)
        if on_logarithms(request):
            bounds = details.pop("bootstrap_ci_difference")
            inverse = None if bounds is None else [exponential(-bound) for bound in reversed(bounds)]
            details["bootstrap_ci_ratio_to_first"] = inverse
    if request.entry.permutation:
        details |= estimation.permutation(first, second, request.entry.seed)
    return {**row, "details": details}
