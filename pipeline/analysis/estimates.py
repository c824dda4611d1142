"""Rows with what an entry asks for beside its test: bootstrap intervals, permutation p values, one-sided evidence."""

from __future__ import annotations

from types import ModuleType

from pipeline.analysis.comparison_rows import tested
from pipeline.analysis.complete_cases import Request
from pipeline.analysis.ratios import on_logarithms
from pipeline.statistics import OK
from pipeline.statistics.bayes import bayes_t
from pipeline.statistics.logarithms import exponential
from pipeline.statistics.pairs import Pair
from pipeline.tables.table import Row

_OF_PAIRED_MEANS = ("t_paired", "bayes_t")


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


def with_direction(request: Request, row: Row, pair: Pair) -> Row:
    """The row of a test of paired means with the one-sided Bayes factor of the direction that its entry expects.

    The p stays two-sided, whatever is expected; the Bayes factor says how far the data speak for the direction.
    """
    direction = request.entry.direction
    if direction is None or row["status"] != OK or request.entry.test not in _OF_PAIRED_MEANS:
        return row
    found = bayes_t(*tested(request, pair), request.entry.prior_scale, alternative=direction)
    sign = "minus" if direction == "less" else "plus"
    details = {
        "expected": direction,
        "one_sided_bf": found.statistic,
        "one_sided_log_bf": found.details[f"log_bf_{sign}0"],
        "one_sided_prior_scale": request.entry.prior_scale,
    }
    return {**row, "details": {**row["details"], **details}}
