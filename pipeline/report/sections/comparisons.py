"""Every comparison in one table, and what its columns mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pipeline.report.document.model import Block, CrossReference, Folded, Paragraph, Section, Strong, Table, columns
from pipeline.report.prose.families import families
from pipeline.report.sections.material import Material
from pipeline.statistics.diagnostics import OUTLIER_RULE
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.change import meaningful_reduction
from pipeline.words.comparison import contrast, test_label, uses_logarithms
from pipeline.words.effect_sizes import effect_size
from pipeline.words.evidence import one_sided_factor, resampled, statistic
from pipeline.words.names import adjustment_label, measure_label
from pipeline.words.numbers import NO_VALUE, fraction, interval, number, p_value, percent
from pipeline.words.phrases import all_of, capitalized, listing


def anchor(at: int) -> str:
    """The id of a comparison's row, by its place in the table `comparisons`."""
    return f"comparison-{at + 1}"


def section(material: Material) -> Section | None:
    """All comparisons; None where nothing was compared."""
    rows = material.rows("comparisons")
    if not rows:
        return None
    shown_columns = [
        (title, cell) for title, cell in _columns(rows) if any(cell(row) not in (NO_VALUE, "") for row in rows)
    ]
    table = Table(
        "table-comparisons",
        f"{all_of(len(rows), 'comparison')} of the study. p is the probability of a difference at least as large"
        f" if there were none; the study's level of significance is {100 * material.study.alpha:g} %.",
        columns([title for title, _ in shown_columns], 3),
        tuple(tuple(cell(row) for _, cell in shown_columns) for row in rows),
        _note(rows, [title for title, _ in shown_columns]),
        tuple(anchor(at) for at in range(len(rows))),
    )
    text = "Every test of the study, one row each. The words and symbols are explained in the "
    introduction = Paragraph((text, CrossReference("glossary", "glossary"), "."))
    blocks: list[Block] = [introduction, table, Paragraph((Strong("Methods: "), _methods(rows)))]
    return Section(
        "comparisons",
        "All comparisons",
        tuple(blocks + _diagnostics(rows, material.study.conditions, material.study.alpha)),
    )


def _note(rows: Sequence[Row], titles: Sequence[str]) -> str:
    """What n and the columns that the table has are of."""
    sentences = [_meaning_of_n(list(dict.fromkeys(row["test"] for row in rows)))]
    if _MEAN_DIFFERENCE in titles:
        sentences.append("Mean difference: first minus second condition, with the interval of a test of means.")
    if "Reduction" in titles:
        of_logarithms = (
            "; of tests of logarithms, that of the geometric mean" if any(map(uses_logarithms, rows)) else ""
        )
        sentences.append(f"Reduction: relative to the first, for measures whose zero means none{of_logarithms}.")
    return " ".join(sentences)


def _meaning_of_n(tests: Sequence[str]) -> str:
    designs = {TESTS[name].design for name in tests}
    if "between" in designs and designs <= {"between", "either"}:
        return "n: every participant with a value, in a test of two groups those of the two."
    text = "n: participants with a value in every condition"
    of_everybody = [TESTS[name].label for name in tests if not TESTS[name].complete_cases]
    return f"{text}; in the {listing(of_everybody)}, all participants." if of_everybody else f"{text}."


def _methods(rows: Sequence[Row]) -> str:
    """Each test with the methods that computed it, and how families of p values were adjusted.

    A row that is undefined was not computed by its method, which is named only where no other row of the test is.
    """
    methods_of: dict[str, list[str]] = {}
    computed = {test_label(row) for row in rows if row["status"] == "ok"}
    for row in rows:
        if row["status"] != "ok" and test_label(row) in computed:
            continue
        methods_of.setdefault(test_label(row), []).append(row["method"])
    texts = [f"{test}: {', or '.join(dict.fromkeys(methods))}" for test, methods in methods_of.items()]
    return f"{'; '.join(texts)}. {capitalized(families(rows))}."


def _diagnostics(rows: Sequence[Row], conditions: Sequence[str], alpha: float) -> list[Block]:
    """Normality and outliers of the differences that are tested, once for each measure and pair."""
    tested: dict[tuple[str, str], Row] = {}
    for row in rows:
        details = row["details"] or {}
        if "shapiro_w" in details or "residual_shapiro_w" in details:
            tested.setdefault((row["measure"], _differences(row, conditions)), row)
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
    doubtful = sum(p is not None and p < alpha for p in ps)
    level = f"below the {100 * alpha:g} % level in {doubtful} of {len(tested)}"
    summary = f"Are the differences normally distributed? Shapiro-Wilk's p is {level}"
    return [Folded(summary, (table,))]


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


def _statistic(row: Row) -> str:
    return statistic(row) if row["status"] == "ok" else str(row["status"])


def _mean_difference(row: Row) -> str:
    bounds = interval(*((row["details"] or {}).get("ci_difference") or (None, None)))
    return " ".join(part for part in (number(row["mean_difference"]), bounds) if part != NO_VALUE) or NO_VALUE


def _columns(rows: Sequence[Row]) -> list[tuple[str, Callable[[Row], str]]]:
    """The table's columns; where all rows are adjusted in one way, the heading says which, once."""
    methods = {adjustment_label(row["adjust"]) for row in rows if row["p_adjusted"] is not None}
    if len(methods) != 1:
        return list(_COLUMNS)
    one = (f"p ({methods.pop()})", lambda row: p_value(row["p_adjusted"]))
    return [one if title == _ADJUSTED else (title, cell) for title, cell in _COLUMNS]


def _adjusted_p(row: Row) -> str:
    adjusted = row["p_adjusted"]
    return NO_VALUE if adjusted is None else f"{p_value(adjusted)} ({adjustment_label(row['adjust'])})"


def _corrected_p(row: Row) -> str:
    return p_value((row["details"] or {}).get("p_gg"))


def _bootstrap(row: Row) -> str:
    """The bootstrap interval of the mean difference, or why there is none."""
    details = row["details"] or {}
    bounds = resampled(details)
    return interval(bounds[0], bounds[1]) if bounds else str(details.get("no_bootstrap", NO_VALUE))


ESTIMATES: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("Bootstrap 95 % interval", _bootstrap),
    ("Permutation p", lambda row: p_value((row["details"] or {}).get("permutation_p"))),
    ("One-sided Bayes factor", lambda row: one_sided_factor(row).removeprefix("= ") or NO_VALUE),
)
"""Columns of the bootstrap and permutation estimates that an entry of study.yaml may ask for beside its test."""

_EMPTY = (NO_VALUE, "")
_ADJUSTED = "p adjusted"
_MEAN_DIFFERENCE = "Mean difference [95 % interval]"

_COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("Measure", lambda row: measure_label(row["measure"])),
    ("Test", test_label),
    ("Compared", contrast),
    ("n", lambda row: f"{row['n']}"),
    ("Statistic", _statistic),
    ("p", lambda row: p_value(row["p"])),
    ("p corrected", _corrected_p),
    (_ADJUSTED, _adjusted_p),
    ("Effect size [95 % interval]", effect_size),
    (_MEAN_DIFFERENCE, _mean_difference),
    *ESTIMATES,
    ("Reduction", lambda row: percent(meaningful_reduction(row))),
)
"""The table's columns; a column that no row fills is left out."""
