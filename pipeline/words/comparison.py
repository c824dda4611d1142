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


def unadjusted_p(row: Row) -> float | None:
    """The p value before adjustment over a family, but with the Greenhouse-Geisser correction where there is one."""
    corrected_p = (row["details"] or {}).get("p_gg")
    return row["p"] if corrected_p is None else float(corrected_p)


def decisive_p(row: Row) -> float | None:
    """The p value that decides significance: the adjusted one where the row belongs to a family."""
    return unadjusted_p(row) if row["p_adjusted"] is None else float(row["p_adjusted"])


def no_variance_between_participants(row: Row) -> bool:
    """Whether a mixed model estimates the variance between participants as zero.

    A singular fit whose zero is another, nested intercept does not count: it takes nothing away from the result.
    """
    details = row["details"] or {}
    return bool(details.get("singular")) and not details.get("variance_participant")
