"""Every comparison in one table, and what its columns mean."""

from __future__ import annotations

from pipeline.document.model import Column, Paragraph, Section, Table
from pipeline.sections.material import Material, Row
from pipeline.wording import (
    TESTS,
    contrast,
    counted,
    effect_size,
    measure_label,
    number,
    p_value,
    percent,
    statistic,
)

_TITLES = (
    "Measure",
    "Test",
    "Comparison",
    "n",
    "Statistic",
    "p",
    "p corrected",
    "p adjusted",
    "Effect size [95 %]",
    "Mean difference",
    "Reduction",
)
_EXPLAINED = {
    "rm_anova": "Repeated-measures ANOVA asks whether the means of the conditions differ more than chance would have it; "
    "p corrected is Greenhouse and Geisser's, for conditions that vary unequally; η²G is the share of variance that goes with the condition.",
    "t_paired": "The paired t test asks the same of two conditions; d_z is the mean difference in units of the differences' SD.",
    "wilcoxon": "Wilcoxon's signed-rank test compares two conditions by the ranks of the differences, exactly, with ties "
    "and without those that are zero; r_rb runs from −1 to 1.",
    "friedman": "Friedman's test compares conditions by each participant's ranking; W runs from 0 (no agreement among participants) to 1.",
}


def section(material: Material) -> Section | None:
    """Every comparison."""
    rows = material.rows("comparisons")
    if not rows:
        return None
    tests = list(dict.fromkeys(row["test"] for row in rows))
    cells = tuple(_cells(row) for row in rows)
    table = Table(
        "table-comparisons",
        f"All {counted(len(rows), 'comparison')} of the study. p is the probability of a difference at least as large if "
        f"there were none; the study's level is {100 * material.study.alpha:g} %.",
        tuple(Column(title, index > 2) for index, title in enumerate(_TITLES)),
        cells,
        "Only participants with a value in every condition count (n). Mean difference: first minus second condition; "
        "reduction: relative to the first.",
    )
    return Section(
        "comparisons", "All comparisons", (Paragraph((" ".join(_EXPLAINED[test] for test in tests),)), table)
    )


def _cells(row: Row) -> tuple[str, ...]:
    details = row["details"] or {}
    return (
        measure_label(row["measure"]),
        TESTS[row["test"]],
        contrast(row),
        f"{row['n']}",
        statistic(row) if row["status"] == "ok" else row["status"],
        p_value(row["p"]),
        p_value(details.get("p_gg")),
        p_value(row["p_adjusted"]),
        effect_size(row),
        number(row["mean_difference"]),
        percent(row["reduction"]),
    )
