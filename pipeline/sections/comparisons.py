"""Every comparison in one table, and what its columns mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pipeline.document.model import Block, Paragraph, Section, Strong, Table, columns
from pipeline.sections.material import Material, Row
from pipeline.statistics.diagnostics import OUTLIER_RULE
from pipeline.wording import (
    NOTHING,
    TESTS,
    contrast,
    counted,
    effect_size,
    listing,
    measure_label,
    number,
    p_value,
    percent,
    share,
    statistic,
)

_EXPLAINED = {
    "rm_anova": (
        "Repeated-measures ANOVA (rm ANOVA) asks whether the means of the conditions differ more than chance would have"
        " it; p corrected is Greenhouse and Geisser's, for conditions that vary unequally; η²G is the share of variance"
        " that goes with the condition."
    ),
    "t_paired": (
        "The paired t test asks the same of two conditions; d_z is the mean difference in units of the differences' SD."
    ),
    "wilcoxon": (
        "Wilcoxon's signed-rank test compares two conditions by the ranks of the differences, exactly, with ties "
        "at their mean rank; W+ is the sum of the ranks in favour of the first condition, and r_rb (rank-biserial "
        "correlation) runs from −1 to 1."
    ),
    "friedman": (
        "Friedman's test compares conditions by each participant's ranking; W runs from 0 (no agreement among "
        "participants) to 1."
    ),
    "art_anova": (
        "The aligned rank transform (ART) does the same as ANOVA on ranks, effect by effect, each after the others are "
        "taken out; η²p is the share of variance of the effect and its error together."
    ),
    "mixed_model": (
        "The mixed model takes every value there is, also of people who lack others, with a constant of their own for "
        "each participant; its estimates are in the unit of the measure."
    ),
    "crossover": (
        "The crossover test of two conditions takes the effect of the period out of their difference, and asks whether "
        "what came first carries over."
    ),
    "tost": (
        "TOST asks the reverse: whether the mean difference lies within the stated bounds; its p is the larger of two "
        "one-sided t tests."
    ),
    "bayes_t": (
        "The Bayes factor BF₁₀ says how many times as likely the data are under a difference (of the stated prior) as "
        "under none."
    ),
}


def section(material: Material) -> Section | None:
    """Every comparison."""
    rows = material.rows("comparisons")
    if not rows:
        return None
    tests = list(dict.fromkeys(row["test"] for row in rows))
    filled = [(title, cell) for title, cell in _COLUMNS if any(cell(row) not in (NOTHING, "") for row in rows)]
    table = Table(
        "table-comparisons",
        f"All {counted(len(rows), 'comparison')} of the study. p is the probability of a difference at least as large"
        f" if there were none; the study's level is {100 * material.study.alpha:g} %.",
        columns([title for title, _ in filled], 3),
        tuple(tuple(cell(row) for _, cell in filled) for row in rows),
        f"{_who_counts(tests)} Difference: first minus second condition, of the "
        "means; reduction: relative to the first.",
    )
    explained = Paragraph((" ".join(_EXPLAINED[test] for test in tests),))
    blocks: list[Block] = [explained, table, Paragraph((Strong("Methods: "), _methods(rows)))]
    return Section("comparisons", "All comparisons", tuple(blocks + _diagnostics(rows, material.study.conditions)))


def _who_counts(tests: Sequence[str]) -> str:
    every = "Only participants with a value in every condition count (n)"
    return f"{every}, but in the mixed model all." if "mixed_model" in tests else f"{every}."


def _methods(rows: Sequence[Row]) -> str:
    """Every method by name, and how families of p values were adjusted."""
    named: dict[str, list[str]] = {}
    for row in rows:
        named.setdefault(TESTS[row["test"]], []).append(row["method"])
    told = [f"{test}: {', or '.join(dict.fromkeys(methods))}" for test, methods in named.items()]
    return "; ".join(told) + ". Adjusted p: over the measures of an entry of study.yaml, pairs over those of a measure."


def _diagnostics(rows: Sequence[Row], conditions: Sequence[str]) -> list[Block]:
    """Are the differences that tests of pairs rest on normal, and does any lie far out? Once for each pair."""
    found: dict[tuple[str, str], Row] = {}
    for row in rows:
        details = row["details"] or {}
        if "shapiro_w" in details or "residual_shapiro_w" in details:
            found.setdefault((row["measure"], _differences(row, conditions)), row)
    if not found:
        return []
    cells = tuple(
        (measure_label(measure), compared, f"{row['n']}", *_normality(row["details"]), _outliers(row["details"]))
        for (measure, compared), row in found.items()
    )
    table = Table(
        "table-diagnostics",
        "The differences looked at: a small p of Shapiro and Wilk's test (W) speaks against a normal distribution, "
        "which t tests and ANOVA suppose and rank tests do not.",
        columns(("Measure", "Differences", "n", "W", "p", "Far out"), 2),
        cells,
        f"Far out: participants whose difference has a {OUTLIER_RULE}; nobody is left out for that. No spread: more "
        "than half of the differences are equal, so that the rule does not apply.",
    )
    return [table]


def _differences(row: Row, conditions: Sequence[str]) -> str:
    """Between what: the pair, or all conditions, whose residuals are looked at."""
    if row["contrast"] is None and "shapiro_w" not in row["details"]:
        return "residuals of all conditions"
    pair = " - ".join(conditions) if row["contrast"] is None else row["contrast"]
    return contrast({**row, "contrast": pair, "details": None})


def _normality(details: Mapping[str, Any]) -> tuple[str, str]:
    prefix = "" if "shapiro_w" in details else "residual_"
    return share(details[f"{prefix}shapiro_w"]), p_value(details[f"{prefix}shapiro_p"])


def _outliers(details: Mapping[str, Any]) -> str:
    if "outliers" not in details:
        return NOTHING
    if details["outliers"] is None:
        return "no spread"
    return listing(details["outliers"]) if details["outliers"] else "nobody"


def _corrected_p(row: Row) -> str:
    return p_value((row["details"] or {}).get("p_gg"))


_COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("Measure", lambda row: measure_label(row["measure"])),
    ("Test", lambda row: TESTS[row["test"]]),
    ("Compared", contrast),
    ("n", lambda row: f"{row['n']}"),
    ("Statistic", lambda row: statistic(row) if row["status"] == "ok" else row["status"]),
    ("p", lambda row: p_value(row["p"])),
    ("p corrected", _corrected_p),
    ("p adjusted", lambda row: p_value(row["p_adjusted"])),
    ("Effect size [95 %]", effect_size),
    ("Difference", lambda row: number(row["mean_difference"])),
    ("Reduction", lambda row: percent(row["reduction"])),
)
"""The table's columns; one that no row fills is left out."""
