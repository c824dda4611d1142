"""One row of the table `comparisons`: what it compares, with which test, and the p value that counts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.statistics import FURTHER_TERMS, OF_LOGARITHMS
from pipeline.study.statistical_tests import TESTS
from pipeline.words.numbers import MINUS, interval
from pipeline.words.phrases import listing

Row = Mapping[str, Any]
EFFECTS_OF_CONDITION = ("condition", "treatment")
"""What tests call the effect of the conditions; `treatment` is a crossover's name for it."""

CORRECTED = "with p corrected for sphericity (Greenhouse-Geisser) beside the uncorrected one"
_CORRECTED_IN_DETAILS = ", uncorrected; sphericity corrections in details"


def contrast(row: Row) -> str:
    """What a row compares: a pair of conditions, or an effect over all of them.

    `kinect − fusion`, at one level of another factor `kinect − fusion at near`, of an equivalence test with its bounds;
    `conditions`, or for another effect its name, `condition × distance`.
    """
    effect = str(row["effect"]).replace(":", " × ").replace("carry_over", "carry-over")
    if row["contrast"] is None:
        return "conditions" if row["effect"] in EFFECTS_OF_CONDITION else effect
    compared = str(row["contrast"]).replace(" - ", f" {MINUS} ")
    if ":" in row["effect"] and " | " in compared:
        return " at ".join(compared.rsplit(" | ", 1))
    bounds = (row["details"] or {}).get("bounds")
    if bounds:
        return f"{compared} within {interval(*bounds)}"
    return compared if row["effect"] in EFFECTS_OF_CONDITION else f"{effect}: {compared}"


def test_label(row: Row) -> str:
    """The test's short name: `paired t`, `paired t of logarithms`, `mixed model with period`."""
    further = (row["details"] or {}).get(FURTHER_TERMS, [])
    terms = f" with {listing([term.replace('_', '-').replace(':', ' × ') for term in further])}" if further else ""
    return TESTS[row["test"]].label + (" of logarithms" if uses_logarithms(row) else "") + terms


def uses_logarithms(row: Row) -> bool:
    """Whether the test was made of the logarithms of the values."""
    return OF_LOGARITHMS in row["method"]


def method_in_words(row: Row) -> str:
    """How exactly the test was done: `method` without the test's label, which stands beside it.

    Of an ANOVA of repeated measures it says whether p was corrected too, instead of where results.json has that.
    """
    method = str(row["method"]).replace(_CORRECTED_IN_DETAILS, "")
    if method != row["method"] and (row["details"] or {}).get("p_gg") is not None:
        method += f", {CORRECTED}"
    return method.removeprefix(f"{test_label(row)}, ")


def unadjusted_p(row: Row) -> float | None:
    """The p value before adjustment over a family, but with the Greenhouse-Geisser correction where there is one."""
    corrected_p = (row["details"] or {}).get("p_gg")
    return row["p"] if corrected_p is None else float(corrected_p)


def decisive_p(row: Row) -> float | None:
    """The p value that decides significance: the adjusted one where the row belongs to a family."""
    return unadjusted_p(row) if row["p_adjusted"] is None else float(row["p_adjusted"])


def over_all_pairs(row: Row) -> bool:
    """Whether a pair's p and interval hold for all pairs of its test together, without a family: Tukey's do."""
    return "p over all pairs" in row["method"]


def tested_difference(row: Row) -> tuple[float | None, float | None, float | None]:
    """The mean difference of a row and its interval, as of `details`; each None where it is not known.

    Where groups of participants are averaged with equal weight, as a mixed ANOVA does, the interval is of that average,
    and so is the difference here; `mean_difference` is of all participants.
    """
    details = row["details"] or {}
    low, high = details.get("ci_difference") or (None, None)
    value = row["mean_difference"] if details.get("difference") is None else details["difference"]
    return value, low, high


def shift(row: Row) -> tuple[float, float, float] | None:
    """Hodges and Lehmann's shift and its interval, of a rank test of two conditions or groups that has one."""
    details = row["details"] or {}
    value, bounds = details.get("hodges_lehmann"), details.get("hodges_lehmann_ci")
    return None if value is None or bounds is None else (value, bounds[0], bounds[1])


def no_variance_between_participants(row: Row) -> bool:
    """Whether a mixed model estimates the variance between participants as zero.

    A singular fit whose zero is another, nested intercept does not count: it takes nothing away from the result.
    """
    details = row["details"] or {}
    return bool(details.get("singular")) and not details.get("variance_participant")
