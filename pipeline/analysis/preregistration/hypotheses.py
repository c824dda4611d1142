"""What was expected of each measure, beside what was found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.analysis.preregistration.tests import entries_of
from pipeline.analysis.preregistration.verdicts import DEVIATION, NOT_PLANNED, point
from pipeline.study.comparison import Comparison
from pipeline.study.preregistration import Registered
from pipeline.tables.table import Row
from pipeline.words.comparison import decisive_p
from pipeline.words.sentences import brief_sentence


@dataclass(frozen=True)
class Done:
    """What the study came to: its measures, how many people have a value, and the rows of `comparisons`, in full."""

    measures: Sequence[str]
    participants: int
    comparisons: Sequence[Row]


def hypothesis_rows(plan: Registered, now: Registered, done: Done, alpha: float) -> Iterator[Row]:
    """What was expected of a measure, and what was found; or what study.yaml says now in its place.

    A hypothesis that came later is a deviation too: it may have been made to fit the results.
    """
    planned, stated = _stated_of(plan), _stated_of(now)
    for title in dict.fromkeys([*planned, *stated]):
        before, after = planned.get(title, {}), stated.get(title, {})
        lost, new = ([text for text in one if text not in other] for one, other in ((before, after), (after, before)))
        for text in lost:
            yield point("hypothesis", text, "; ".join(new) or "none stated", DEVIATION, title)
        if new and not lost:
            yield point("hypothesis", NOT_PLANNED, "; ".join(new), DEVIATION, title)
        for text, entry in after.items():
            if text in before:
                for measure in entries_of([entry], done.measures):
                    yield _found(entry, text, measure, done, alpha)


def _stated_of(registered: Registered) -> dict[str, dict[str, Comparison]]:
    """The hypotheses of each entry's measures, each with the entry that states it."""
    found: dict[str, dict[str, Comparison]] = {}
    for entry in registered.comparisons:
        text = hypothesis(entry, registered.conditions)
        if text is not None:
            found.setdefault(entry.title, {}).setdefault(text, entry)
    return found


def hypothesis(entry: Comparison, conditions: Sequence[str]) -> str | None:
    """In the study's words, and with the direction: `kinect > fusion`; None where nothing is stated."""
    parts = [entry.hypothesis] if entry.hypothesis is not None else []
    if entry.direction is not None:
        sign = "<" if entry.direction == "less" else ">"
        pair = entry.is_within or entry.between in (None, "condition")
        first, second = conditions[:2] if pair and len(conditions) == 2 else ("the first", "the second")
        parts.append(f"{first} {sign} {second}")
    return "; ".join(parts) or None


def _found(entry: Comparison, stated: str, measure: str, done: Done, alpha: float) -> Row:
    """The one row that can speak for or against a direction; where there are several, a reader has to look."""
    rows = [
        row
        for row in done.comparisons
        if (row["measure"], row["test"]) == (measure, entry.test)
        and row["mean_difference"] is not None
        and row["status"] == "ok"
    ]
    if len(rows) != 1 or entry.direction is None:
        return point("hypothesis", stated, "see the comparisons", "see the comparisons", measure)
    (row,) = rows
    p, difference = decisive_p(row), row["mean_difference"]
    fits = (difference < 0) == (entry.direction == "less") and difference != 0
    significant = p is not None and p < alpha
    verdict = "not supported" if not significant else "supported" if fits else "opposite"
    return point("hypothesis", stated, brief_sentence(row), verdict, measure)
