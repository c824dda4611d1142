"""Every comparison in one table, and what its columns mean."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.document.model import Paragraph, Section, Table, columns
from pipeline.sections.material import Material, Row
from pipeline.wording import (
    NOTHING,
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
        "Only participants with a value in every condition count (n). Difference: first minus second condition, of the "
        "means; reduction: relative to the first.",
    )
    explained = Paragraph((" ".join(_EXPLAINED[test] for test in tests),))
    return Section("comparisons", "All comparisons", (explained, table))


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
