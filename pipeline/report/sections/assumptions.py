"""What the tests assume, and whether the values are so: normal differences or groups, outliers, alike spreads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.report.document.model import Block, Folded, Table, columns
from pipeline.statistics import OK
from pipeline.statistics.diagnostics import OUTLIER_RULE
from pipeline.statistics.tukey import METHOD as TUKEY_KRAMER
from pipeline.study.settings import Study
from pipeline.tables.table import Row
from pipeline.words.comparison import contrast
from pipeline.words.names import measure_label
from pipeline.words.numbers import NO_VALUE, fraction, number, p_value
from pipeline.words.phrases import counted, listing

_IN_GROUPS = "groups_shapiro_p"


def checked(rows: Sequence[Row], study: Study) -> list[Block]:
    """Folded tables of all assumptions that the tests of these rows have."""
    return [*of_sphericity(rows, study), *of_differences(rows, study), *of_groups(rows, study)]


def of_differences(rows: Sequence[Row], study: Study) -> list[Block]:
    """Normality and outliers of the differences that are tested, once for each measure and pair."""
    tested: dict[tuple[str, str], Row] = {}
    for row in rows:
        details = row["details"] or {}
        if "shapiro_w" in details or "residual_shapiro_w" in details:
            tested.setdefault((row["measure"], _differences(row, study.conditions)), row)
    if not tested:
        return []
    cells = tuple(
        (measure_label(measure), compared, f"{row['n']}", *_normality(row["details"]), _outliers(row["details"]))
        for (measure, compared), row in tested.items()
    )
    table = Table(
        "table-diagnostics",
        "Are the differences normally distributed? A small p of the Shapiro-Wilk test (W) speaks against it. t tests "
        "and ANOVA assume a normal distribution; rank tests do not.",
        columns(("Measure", "Differences", "n", "W", "p", "Outliers"), 2),
        cells,
        f"Outliers: participants whose difference has a {OUTLIER_RULE}; they are kept in all tests. No spread: "
        "more than half of the differences are equal, so the rule does not apply.",
    )
    ps = [row["details"].get("shapiro_p", row["details"].get("residual_shapiro_p")) for row in tested.values()]
    doubtful = sum(p is not None and p < study.alpha for p in ps)
    level = f"below the {100 * study.alpha:g} % level in {doubtful} of {len(tested)}"
    summary = f"Are the differences normally distributed? Shapiro-Wilk's p is {level}"
    return [Folded(summary, (table,))]


def of_groups(rows: Sequence[Row], study: Study) -> list[Block]:
    """Normality within the groups of participants that are compared, and whether the groups spread alike."""
    tested = [row for row in rows if row["status"] == OK and (row["details"] or {}).get(_IN_GROUPS)]
    if not tested:
        return []
    cells = tuple(
        (
            measure_label(row["measure"]),
            contrast(row),
            listing([p_value(p) for p in row["details"][_IN_GROUPS]]),
            number(row["details"]["levene_f"]),
            p_value(row["details"]["levene_p"]),
        )
        for row in tested
    )
    with_one_sd = " Tukey and Kramer's pairs assume both." if any(row["method"] == TUKEY_KRAMER for row in rows) else ""
    table = Table(
        "table-diagnostics-groups",
        "Are the groups normally distributed, and do they spread alike? A small p speaks against it. Welch's tests"
        f" assume the former, and do not need the latter.{with_one_sd}",
        columns(("Measure", "Compared", "Shapiro-Wilk p of each group", "Levene's F", "p"), 2),
        cells,
    )
    doubtful = sum(any(p is not None and p < study.alpha for p in row["details"][_IN_GROUPS]) for row in tested)
    unlike = sum((row["details"]["levene_p"] or 1.0) < study.alpha for row in tested)
    summary = (
        "Are the groups normally distributed, and do they spread alike? Below the"
        f" {100 * study.alpha:g} % level are Shapiro-Wilk's p in {doubtful} and Levene's in {unlike} of"
        f" {counted(len(tested), 'comparison')}"
    )
    return [Folded(summary, (table,))]


def of_sphericity(rows: Sequence[Row], study: Study) -> list[Block]:
    """Whether the differences between conditions vary alike, of which an ANOVA of three conditions or more depends."""
    tested = [row for row in rows if row["status"] == OK and (row["details"] or {}).get("mauchly_w") is not None]
    if not tested:
        return []
    cells = tuple(
        (
            measure_label(row["measure"]),
            contrast(row),
            fraction(row["details"]["mauchly_w"]),
            p_value(row["details"]["mauchly_p"]),
            *(fraction(row["details"][name]) for name in ("epsilon_gg", "epsilon_hf")),
            *(p_value(row["details"][name]) for name in ("p_gg", "p_hf")),
        )
        for row in tested
    )
    table = Table(
        "table-sphericity",
        "Do the differences between conditions vary alike (sphericity)? A small p of Mauchly's test (W) speaks against"
        " it. p of the effect after the corrections of Greenhouse and Geisser, and of Huynh and Feldt.",
        columns(
            (
                "Measure",
                "Effect",
                "W",
                "p of W",
                "Greenhouse-Geisser ε",
                "Huynh-Feldt ε",
                "p, Greenhouse-Geisser",
                "p, Huynh-Feldt",
            ),
            2,
        ),
        cells,
    )
    doubtful = sum((row["details"]["mauchly_p"] or 1.0) < study.alpha for row in tested)
    level = f"below the {100 * study.alpha:g} % level in {doubtful} of {len(tested)}"
    return [Folded(f"Do the differences between conditions vary alike? Mauchly's p is {level}", (table,))]


def _differences(row: Row, conditions: Sequence[str]) -> str:
    """The pair compared, or all conditions, whose residuals are checked."""
    if row["contrast"] is None and "shapiro_w" not in row["details"]:
        return "residuals of all conditions"
    pair = " - ".join(conditions) if row["contrast"] is None else row["contrast"]
    return contrast({**row, "contrast": pair, "details": None})


def _normality(details: Mapping[str, Any]) -> tuple[str, str]:
    prefix = "" if "shapiro_w" in details else "residual_"
    return fraction(details[f"{prefix}shapiro_w"]), p_value(details[f"{prefix}shapiro_p"])


def _outliers(details: Mapping[str, Any]) -> str:
    if "outliers" not in details:
        return NO_VALUE
    if details["outliers"] is None:
        return "no spread"
    return listing(details["outliers"]) if details["outliers"] else "nobody"
