"""Every comparison in one table, and what its columns mean."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pipeline.report.document.model import Block, CrossReference, Paragraph, Section, Strong, Table, columns
from pipeline.report.prose.families import families
from pipeline.report.sections import assumptions, normality, values
from pipeline.report.sections.material import Material
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.change import meaningful_reduction
from pipeline.words.comparison import (
    CORRECTED,
    contrast,
    method_in_words,
    shift,
    test_label,
    tested_difference,
    uses_logarithms,
)
from pipeline.words.effect_sizes import effect_size
from pipeline.words.evidence import one_sided_factor, resampled, statistic
from pipeline.words.names import adjustment_label, measure_label
from pipeline.words.numbers import NO_VALUE, estimate, interval, p_value, percent
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
    blocks: list[Block] = [introduction, table, Paragraph((Strong("Methods: "), methods(rows)))]
    return Section(
        "comparisons",
        "All comparisons",
        (*blocks, *assumptions.checked(rows, material.study), *normality.plots(material), *values.tables(material)),
    )


def _note(rows: Sequence[Row], titles: Sequence[str]) -> str:
    """What n and the columns that the table has are of."""
    sentences = [_meaning_of_n(list(dict.fromkeys(row["test"] for row in rows)))]
    if DIFFERENCE in titles:
        sentences.append("Difference: the first minus the second, of means with the interval of a test of means.")
        if any(shift(row) is not None for row in rows):
            sentences.append(SHIFT_NOTE)
    if "Reduction" in titles:
        of_logarithms = (
            "; of tests of logarithms, that of the geometric mean" if any(map(uses_logarithms, rows)) else ""
        )
        sentences.append(f"Reduction: relative to the first, for measures whose zero means none{of_logarithms}.")
    return " ".join(sentences)


SHIFT_NOTE = (
    "The difference beside a rank test is Hodges and Lehmann's shift: the median of all averages of two differences, or"
    " of all differences between the members of two groups; with tied ranks its interval and p need not agree to the"
    " last digit."
)


def _meaning_of_n(tests: Sequence[str]) -> str:
    designs = {TESTS[name].design for name in tests}
    if "between" in designs and designs <= {"between", "either"}:
        return "n: every participant with a value, in a test of two groups those of the two."
    text = "n: participants with a value in every condition"
    of_everybody = [TESTS[name].label for name in tests if not TESTS[name].complete_cases]
    return f"{text}; in the {listing(of_everybody)}, all participants." if of_everybody else f"{text}."


def methods(rows: Sequence[Row]) -> str:
    """Each test with the methods that computed it, and how families of p values were adjusted.

    A row that is undefined was not computed by its method, which is named only where no other row of the test is.
    """
    computed = {test_label(row) for row in rows if row["status"] == "ok"}
    of_test: dict[str, list[Row]] = {}
    for row in rows:
        if row["status"] == "ok" or test_label(row) not in computed:
            of_test.setdefault(test_label(row), []).append(row)
    texts = [f"{test}: {_methods_of(one)}" for test, one in of_test.items()]
    return f"{'; '.join(texts)}. {capitalized(families(rows))}."


def _methods_of(rows: Sequence[Row]) -> str:
    """The methods of one test's rows: first of those of all conditions, then of the pairs that follow them up."""
    whole = list(dict.fromkeys(method_in_words(row) for row in rows if row["contrast"] is None))
    pairs = list(dict.fromkeys(method_in_words(row) for row in rows if row["contrast"] is not None))
    whole = [one for one in whole if f"{one}, {CORRECTED}" not in whole]
    if not pairs or not whole or pairs == whole:
        return ", or ".join(whole or pairs)
    return f"{', or '.join(whole)}, its pairs by {', or '.join(pairs)}"


def _statistic(row: Row) -> str:
    return statistic(row) if row["status"] == "ok" else str(row["status"])


def difference_cell(row: Row) -> str:
    """The difference of the means with its interval; of a rank test its shift."""
    shifted = shift(row)
    if shifted is not None:
        return estimate(*shifted)
    value, low, high = tested_difference(row)
    return NO_VALUE if value is None else estimate(value, low, high)


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
DIFFERENCE = "Difference [95 % interval]"

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
    (DIFFERENCE, difference_cell),
    *ESTIMATES,
    ("Reduction", lambda row: percent(meaningful_reduction(row))),
)
"""The table's columns; a column that no row fills is left out."""
