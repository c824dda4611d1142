"""The answer of a study: by how much each measure differs between the pairs of conditions in question.

The first page and the console print these lines, so that both say the same. A line is a row of `comparisons`, and of
`descriptives` for its means; nothing is computed here but the root of a mean squared error, and a percentage.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.statistics import OK, RATIO
from pipeline.statistics.pairs import names_in
from pipeline.study.measures import headlines, measure
from pipeline.study.statistical_tests import TESTS
from pipeline.words.change import direction, meaningful_reduction
from pipeline.words.comparison import (
    EFFECTS_OF_CONDITION,
    Row,
    decisive_p,
    over_all_pairs,
    shift,
    test_label,
    tested_difference,
)
from pipeline.words.effect_sizes import effect_size
from pipeline.words.names import measure_label
from pipeline.words.numbers import MINUS, NO_VALUE, estimate, interval, number, p_value, percent

LINES_MAX = 12
"""As many lines fit on the first page, with all else that belongs there."""

_SHIFT = " (shift)"
_RATIOS = ("odds ratio", "rate ratio")

HEADER = ("Measure", "Pair", "Means", "Difference [95 % interval]", "Effect size", "p")


@dataclass(frozen=True)
class Line:
    """One pair in one measure, as text. `pair` is `kinect − fusion`: differences are the first named minus the other.

    So they have the sign that they have in results.json, in the figures and in the other tables.
    `significant` is None where the test is undefined.
    """

    measure: str
    pair: str
    means: str
    difference: str
    effect_size: str
    p: str
    significant: bool | None

    @property
    def cells(self) -> tuple[str, ...]:
        """The texts in the order of `HEADER`."""
        return (self.measure, self.pair, self.means, self.difference, self.effect_size, self.p)


def answer(results: Mapping[str, Any]) -> list[Line]:
    """The lines of the answer: the well-known measures first, then others, then questionnaires.

    `results` is the content of results.json. Pairs are those of `question` in study.yaml, or else the baseline with
    each other condition; of groups of participants, all pairs. A measure that several entries test has lines for each,
    which name the test.
    """
    study = results["study"]
    described = {(row["measure"], row["condition"]): row for row in results["descriptives"]}
    rows = list(_pairs_in_question(results["comparisons"], study["conditions"], study["question"]))
    tests: dict[str, set[str]] = {}
    for row, _ in rows:
        tests.setdefault(row["measure"], set()).add(test_label(row))
    return [
        _line(row, pair, described, study["alpha"], names_test=len(tests[row["measure"]]) > 1)
        for row, pair in sorted(rows, key=_rank(rows))
    ]


def with_difference(row: Row, first: Row | None) -> dict[str, Any]:
    """The row with the difference that its test has among its details only, as a mixed ANOVA of two conditions has.

    That one is averaged over the groups. Its share of the `first` condition's mean, a row of `descriptives`, is known
    where the groups are equally large, and that mean is their average too.
    """
    details = row["details"] or {}
    if row["mean_difference"] is not None or row["contrast"] is not None or details.get("difference") is None:
        return dict(row)
    difference, sizes = details["difference"], details.get("n_groups", [])
    is_average = first is not None and first["n"] == row["n"] and len(set(sizes)) <= 1
    mean = first["mean"] if first is not None and is_average else None
    positive = mean is not None and mean > 0 and mean - difference > 0
    return {**row, "mean_difference": difference, "reduction": difference / mean if positive else None}


def averages_unequal_groups(row: Row) -> bool:
    """Is the row's difference another than that of all participants' means?"""
    details = row["details"] or {}
    return "difference" in details and len(set(details.get("n_groups", []))) > 1


def rows_beside_the_answer(results: Mapping[str, Any]) -> list[Row]:
    """The rows of `comparisons` that say something and have no line in the answer.

    Tests of all conditions at once and of other factors, of equivalence, Bayes factors; not the pairs that `question`
    leaves out.
    """
    study = results["study"]
    answering = {
        id(row) for row, _ in _pairs_in_question(results["comparisons"], study["conditions"], study["question"])
    }
    candidates = [row for row in results["comparisons"] if row["contrast"] is None or not _tests_difference(row)]
    return [row for row in candidates if id(row) not in answering]


def _tests_difference(row: Row) -> bool:
    return TESTS[row["test"]].tests_difference


def lines_for_first_page(lines: Sequence[Line], most: int = LINES_MAX) -> list[Line]:
    """All lines, or where they are more than `most`, whole measures from the top, at least one measure."""
    if len(lines) <= most:
        return list(lines)
    on_page: list[Line] = []
    for name in dict.fromkeys(line.measure for line in lines):
        of_measure = [line for line in lines if line.measure == name]
        if on_page and len(on_page) + len(of_measure) > most:
            break
        on_page += of_measure
    return on_page


def notes(results: Mapping[str, Any]) -> str:
    """The note below the table: which way differences go, how many participants, which p is shown, and its level."""
    study = results["study"]
    pairs = list(_pairs_in_question(results["comparisons"], study["conditions"], study["question"]))
    rows = [row for row, _ in pairs if row["status"] == OK]
    counts = sorted({row["n"] for row in rows})
    people = "" if not counts else f" n = {counts[0]}" + (f" to {counts[-1]}" if len(counts) > 1 else "") + "."
    adjusted = any(row["p_adjusted"] is not None for row in rows)
    together = [row for row in rows if over_all_pairs(row)]
    if adjusted:
        kind = "p: adjusted over its family where one is stated, intervals not"
    elif together:
        alone = "" if len(together) == len(rows) else "; others not adjusted"
        kind = f"p and intervals of pairs of groups: over all pairs of a measure, effect sizes not{alone}"
    else:
        kind = "p: not adjusted"
    level = f"level of significance {100 * study['alpha']:g} %"
    has_ratios = any(row["effect_size_name"] in _RATIOS for row in rows)
    ratios = "; ratios: the first named over the other" if has_ratios else ""
    of_squares = any(measure(row["measure"]).unit.endswith("²") for row in rows)
    roots = " (root): of the mean squared error; percentages are of that itself." if of_squares else ""
    any_shift = any(shift(row) is not None for row in rows)
    shifts = f"{_SHIFT}: Hodges and Lehmann's estimate, which belongs to rank tests." if any_shift else ""
    estimates = any(row["effect_size_name"] == "estimate" for row in rows)
    alone = " Effect size –: a model has none but its estimate, which is the difference." if estimates else ""
    marks = f"{ratios}.{roots}{shifts}{alone}{_without_means(results, pairs)}"
    return f"Differences and effect sizes: the first named minus the other{marks}{people} {kind}; {level}."


def _without_means(results: Mapping[str, Any], pairs: Sequence[tuple[Row, tuple[str, str]]]) -> str:
    """Why a line shows no means although the tables have them; empty where none lacks them."""
    described = {(row["measure"], row["condition"]): row for row in results["descriptives"]}
    for row, names in pairs:
        one, other = (described.get((row["measure"], name)) for name in names)
        if row["status"] == OK and one and other and _means(row, one, other) == NO_VALUE:
            return (
                " Means –: those in the tables need not agree with the difference, which is of other participants,"
                " weighs them otherwise, or is a model's estimate."
            )
    return ""


def _pairs_in_question(
    rows: Sequence[Row], conditions: Sequence[str], question: Sequence[Sequence[str]]
) -> Iterator[tuple[Row, tuple[str, str]]]:
    """The rows that test the difference of a pair in `question`, averaged over everything else, each with its pair."""
    pairs = {f"{one} - {other}": (str(one), str(other)) for one, other in question}
    only = next(iter(pairs.values())) if len(conditions) == 2 else None
    for row in rows:
        if not _tests_difference(row):
            continue
        if row["effect"] in EFFECTS_OF_CONDITION:
            pair = only if row["contrast"] is None else pairs.get(row["contrast"])
        else:
            of_groups = TESTS[row["test"]].design == "between" and row["contrast"] is not None
            pair = names_in(row["contrast"]) if of_groups else None
        if pair is not None:
            yield row, pair


def _rank(rows: Sequence[tuple[Row, tuple[str, str]]]) -> Any:
    """A sort key: headlines in their order, other measures, then questionnaires; rows of a measure keep their order."""
    names = list(dict.fromkeys(row["measure"] for row, _ in rows))
    known = headlines(names)
    others = [name for name in names if name not in known]
    order = [*known, *sorted(others, key=lambda name: bool(measure(name).questionnaire))]
    return lambda row_and_pair: order.index(row_and_pair[0]["measure"])


def _line(
    row: Row, pair: tuple[str, str], described: Mapping[tuple[str, str], Row], alpha: float, names_test: bool
) -> Line:
    first, second = pair
    row = with_difference(row, described.get((row["measure"], first)))
    name = measure_label(row["measure"]) + (f", {test_label(row)}" if names_test else "")
    compared = f"{first} {MINUS} {second}"
    means = _means(row, described.get((row["measure"], first)), described.get((row["measure"], second)))
    if row["status"] != OK:
        return Line(name, compared, means, f"{test_label(row)}: {row['status']}", NO_VALUE, NO_VALUE, None)
    p = decisive_p(row)
    size = NO_VALUE if row["effect_size_name"] in (RATIO, "estimate") else effect_size(row)
    significant = None if p is None else p < alpha
    return Line(name, compared, means, _difference(row, pair, bool(significant)), size, p_value(p), significant)


def _means(row: Row, one: Row | None, other: Row | None) -> str:
    """`43.2 → 31.4 s`; of squared errors the roots, in millimetres or pixels: `104 → 79 px (root)`.

    No means where they are of other people than the test, where a model estimates the difference from unequal
    numbers of rows, or where groups of unequal size are averaged: they could contradict the difference beside them.
    """
    if one is None or other is None or row["effect_size_name"] == "estimate":
        return NO_VALUE
    tested = [one["n"] + other["n"]] if TESTS[row["test"]].design == "between" else [one["n"], other["n"]]
    if any(n != row["n"] for n in tested) or averages_unequal_groups(row):
        return NO_VALUE
    first, second, unit = one["mean"], other["mean"], measure(row["measure"]).unit
    if unit.endswith("²") and first >= 0 and second >= 0:
        return f"{number(math.sqrt(first))} → {number(math.sqrt(second))} {unit[:-1]} (root)"
    return f"{number(first)} → {number(second)} {unit}".strip()


def _difference(row: Row, pair: tuple[str, str], significant: bool) -> str:
    """`11.80 s [4.32, 19.28]; fusion 26.7 % lower (better)`, or `fusion = 0.81 × kinect` of geometric means.

    "Better" and "worse" are said of significant differences only.
    """
    first, second = pair
    details, unit = row["details"] or {}, measure(row["measure"]).unit
    if details.get("ratio_to_first") is not None:
        ratio = f"{second} = {number(details['ratio_to_first'])} × {first}"
        bounds = interval(*details["ratio_to_first_ci"])
        return ratio if bounds == NO_VALUE else f"{ratio} {bounds}"
    shifted = shift(row)
    value, low, high = tested_difference(row) if shifted is None else shifted
    if shifted is not None:  # ranks may go the other way than means; what is said goes with the interval beside it
        row = {**row, "mean_difference": value, "reduction": None}
    elif row["mean_difference"] is None:
        if row["effect_size_name"] != "estimate" or row["effect_size"] is None:
            return NO_VALUE
        row = {**row, "mean_difference": row["effect_size"], "reduction": None}
        value, low, high = row["effect_size"], row["ci_low"], row["ci_high"]
    amount = NO_VALUE if value is None else estimate(value, low, high, unit)
    amount += _SHIFT if shifted is not None else ""
    if row["mean_difference"] == 0:
        return amount
    reduction = meaningful_reduction(row)
    share = "" if reduction is None else f"{percent(abs(reduction))} "
    side = direction(row) if significant else direction(row).partition(" ")[0]
    return f"{amount}; {second} {share}{side}"
