"""The answer of a study: for each pair of conditions that is asked about, by how much a measure differs.

The first page and the console print these lines, so that both say the same. A line is a row of `comparisons`, and of
`descriptives` for its means; nothing is computed here but the root of a mean squared error.
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
from pipeline.words.comparison import EFFECTS_OF_CONDITION, Row, decisive_p, test_label
from pipeline.words.effect_sizes import effect_size
from pipeline.words.names import measure_label
from pipeline.words.numbers import MINUS, NO_VALUE, interval, number, p_value, percent

LINES_MAX = 12
"""As many lines fit on the first page, with all else that belongs there."""

_SIGNED = ("Cohen's d_z", "Cohen's d_av", "matched-pairs rank-biserial", "rank-biserial")

HEADER = ("Measure", "Pair", "Means", "Difference [95 % interval]", "Effect size", "p")


@dataclass(frozen=True)
class Line:
    """One pair in one measure, as text. `pair` is `fusion − kinect`: differences are the first named minus the other.

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
    """The lines of all measures but questionnaires, the well-known first, then those of questionnaires.

    `results` is the content of results.json. Pairs are those of `question` in study.yaml, or else the baseline with
    each other condition; of groups of participants, all pairs. A measure that several entries test has lines for each,
    which name the test.
    """
    study = results["study"]
    described = {(row["measure"], row["condition"]): row for row in results["descriptives"]}
    rows = list(_asked_about(results["comparisons"], study["conditions"], study["question"]))
    tests: dict[str, set[str]] = {}
    for row, _ in rows:
        tests.setdefault(row["measure"], set()).add(test_label(row))
    return [
        _line(row, pair, described, study["alpha"], names_test=len(tests[row["measure"]]) > 1)
        for row, pair in sorted(rows, key=_rank(rows))
    ]


def not_answered(results: Mapping[str, Any]) -> list[Row]:
    """Rows without a line: of all conditions, of other factors, TOST, Bayes; not pairs that nobody asked about."""
    study = results["study"]
    asked = [id(row) for row, _ in _asked_about(results["comparisons"], study["conditions"], study["question"])]
    pairs = [row for row in results["comparisons"] if row["contrast"] is None or not _of_difference(row)]
    return [row for row in pairs if id(row) not in asked]


def _of_difference(row: Row) -> bool:
    return TESTS[row["test"]].tests_difference


def shown(lines: Sequence[Line], most: int = LINES_MAX) -> list[Line]:
    """The lines for a first page: all, or where they are too many, whole measures from the top, at least one."""
    if len(lines) <= most:
        return list(lines)
    kept: list[Line] = []
    for name in dict.fromkeys(line.measure for line in lines):
        of_measure = [line for line in lines if line.measure == name]
        if kept and len(kept) + len(of_measure) > most:
            break
        kept += of_measure
    return kept


def notes(results: Mapping[str, Any]) -> str:
    """What the columns mean: the side of the differences, how many people they are of, which p is shown, its level."""
    rows = [row for row in results["comparisons"] if row["status"] == OK]
    counts = sorted({row["n"] for row in rows})
    people = "" if not counts else f" n = {counts[0]}" + (f" to {counts[-1]}" if len(counts) > 1 else "") + "."
    adjusted = any(row["p_adjusted"] is not None for row in rows)
    kind = "p: adjusted over its family where one is stated" if adjusted else "p: not adjusted"
    level = f"level of significance {100 * results['study']['alpha']:g} %"
    return f"Differences and effect sizes: the first named minus the other.{people} {kind}; {level}."


def _asked_about(
    rows: Sequence[Row], conditions: Sequence[str], question: Sequence[Sequence[str]]
) -> Iterator[tuple[Row, tuple[str, str]]]:
    """The rows whose p is evidence of a difference between one of the pairs, over all else, each with its pair."""
    pairs = {f"{one} - {other}": (str(one), str(other)) for one, other in question}
    only = next(iter(pairs.values())) if len(conditions) == 2 else None
    for row in rows:
        if not _of_difference(row):
            continue
        if row["effect"] in EFFECTS_OF_CONDITION:
            pair = only if row["contrast"] is None else pairs.get(row["contrast"])
        else:
            of_groups = TESTS[row["test"]].design == "between" and row["contrast"] is not None
            pair = names_in(row["contrast"]) if of_groups else None
        if pair is not None:
            yield row, pair


def _rank(rows: Sequence[tuple[Row, tuple[str, str]]]) -> Any:
    """A sort key: headlines in their order, other measures, then questionnaires; rows keep their order otherwise."""
    names = list(dict.fromkeys(row["measure"] for row, _ in rows))
    known = headlines(names)
    others = [name for name in names if name not in known]
    order = [*known, *sorted(others, key=lambda name: bool(measure(name).questionnaire))]
    return lambda found: order.index(found[0]["measure"])


def _line(
    row: Row, pair: tuple[str, str], described: Mapping[tuple[str, str], Row], alpha: float, names_test: bool
) -> Line:
    first, second = pair
    name = measure_label(row["measure"]) + (f", {test_label(row)}" if names_test else "")
    compared = f"{second} {MINUS} {first}"
    both = _means(row, described.get((row["measure"], first)), described.get((row["measure"], second)))
    if row["status"] != OK:
        return Line(name, compared, both, f"{test_label(row)}: {row['status']}", NO_VALUE, NO_VALUE, None)
    p = decisive_p(row)
    size = NO_VALUE if row["effect_size_name"] in (RATIO, "estimate") else effect_size(_of_second_minus_first(row))
    significant = None if p is None else p < alpha
    return Line(name, compared, both, _difference(row, bool(significant)), size, p_value(p), significant)


def _of_second_minus_first(row: Row) -> Row:
    """The row with its effect size the other way round, where that has a sign."""
    if row["effect_size_name"] not in _SIGNED or row["effect_size"] is None:
        return row
    low, high = (None if bound is None else -bound for bound in (row["ci_high"], row["ci_low"]))
    return {**row, "effect_size": -row["effect_size"], "ci_low": low, "ci_high": high}


def _means(row: Row, one: Row | None, other: Row | None) -> str:
    """`43.2 → 31.4 s`; of squared errors the roots, in millimetres or pixels: `104 → 79 px (root)`.

    Nothing where they are of other people than the test, or a model estimates the difference from rows of unequal
    number: they could contradict the difference beside them.
    """
    if one is None or other is None or not one["n"] == other["n"] == row["n"] or row["effect_size_name"] == "estimate":
        return NO_VALUE
    first, second, unit = one["mean"], other["mean"], measure(row["measure"]).unit
    if unit.endswith("²") and first >= 0 and second >= 0:
        return f"{number(math.sqrt(first))} → {number(math.sqrt(second))} {unit[:-1]} (root)"
    return f"{number(first)} → {number(second)} {unit}".strip()


def _difference(row: Row, significant: bool) -> str:
    """`−11.80 s [−19.28, −4.32], 26.7 % lower (better)`, or by what factor geometric means differ.

    Whether that is better is said of a significant difference only.
    """
    details, unit = row["details"] or {}, measure(row["measure"]).unit
    if details.get("ratio_to_first") is not None:
        bounds = interval(*details["ratio_to_first_ci"])
        return f"× {number(details['ratio_to_first'])} {'' if bounds == NO_VALUE else bounds}".strip()
    if row["mean_difference"] is None:
        if row["effect_size_name"] != "estimate" or row["effect_size"] is None:
            return NO_VALUE
        return _signed(row["effect_size"], (row["ci_low"], row["ci_high"]), unit)
    amount = _signed(row["mean_difference"], details.get("ci_difference") or (None, None), unit)
    if row["mean_difference"] == 0:
        return amount
    reduction = meaningful_reduction(row)
    share = "" if reduction is None else f"{percent(abs(reduction))} "
    side = direction(row) if significant else direction(row).partition(" ")[0]
    return f"{amount}, {share}{side}"


def _signed(first_minus_second: float, bounds: Sequence[float | None], unit: str) -> str:
    """The second minus the first, with its unit and interval."""
    low, high = bounds
    value = number(-first_minus_second or 0.0)
    sign = "+" if first_minus_second < 0 else ""
    text = f"{sign}{value} {unit}".strip()
    return text if low is None or high is None else f"{text} {interval(-high or 0.0, -low or 0.0)}"
