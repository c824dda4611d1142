"""Tests and families that were planned, beside those that were done.

Entries of `comparisons` are held against each other measure by measure, whatever entry or pattern (`nasa_tlx/*`) a
measure stands in; measures of which the same is to be said share a row again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from pipeline.analysis.preregistration.verdicts import AS_PLANNED, DEVIATION, EXPLORATORY, NOT_PLANNED, as_text, point
from pipeline.study.comparison import Comparison, matching_measures
from pipeline.study.preregistration import Registered
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.names import adjustment_label
from pipeline.words.phrases import counted, listing

_NAMED_MAX = 4
_APART = ("measure", "test", "adjust", "family", "hypothesis", "direction")
_OPTIONS = tuple(name for name in Comparison.model_fields if name not in _APART)


def entries_of(comparisons: Iterable[Comparison], known: Sequence[str]) -> dict[str, list[Comparison]]:
    """The entries of each measure, patterns resolved by the measures of the data."""
    found: dict[str, list[Comparison]] = {}
    for entry in comparisons:
        for name in dict.fromkeys(name for pattern in entry.measures for name in measures_of(pattern, known)):
            found.setdefault(name, []).append(entry)
    return found


def measures_of(pattern: str, known: Sequence[str]) -> list[str]:
    """The measures a pattern stands for, never a total; itself where the data have none."""
    return matching_measures(pattern, known) or [pattern]


_Pair = tuple[str, Comparison | None, Comparison | None]
"""A measure, the entry that was planned for it and the one that was done in its place; None where there is none."""


def _pairs(plan: Registered, now: Registered, known: Sequence[str]) -> list[_Pair]:
    planned, done = entries_of(plan.comparisons, known), entries_of(now.comparisons, known)
    return [
        (measure, before, after)
        for measure in dict.fromkeys([*planned, *done])
        for before, after in _paired(planned.get(measure, []), done.get(measure, []))
    ]


def test_rows(plan: Registered, now: Registered, known: Sequence[str]) -> Iterator[Row]:
    """Each test that was planned or made. One of a measure that has no planned test is exploratory."""
    said: dict[tuple[str, str, str], list[str]] = {}
    for measure, before, after in _pairs(plan, now, known):
        texts = (
            NOT_PLANNED if before is None else described(before),
            "not tested" if after is None else described(after),
        )
        verdict = EXPLORATORY if before is None else AS_PLANNED if texts[0] == texts[1] else DEVIATION
        said.setdefault((*texts, verdict), []).append(measure)
    for (before_text, after_text, verdict), measures in said.items():
        yield point("test", before_text, after_text, verdict, together(measures, plan, now, known))


def _paired(
    planned: Sequence[Comparison], done: Sequence[Comparison]
) -> Iterator[tuple[Comparison | None, Comparison | None]]:
    """Planned entries with those done in their place: the same one first, then the same test, then in their order."""
    left, right = list(planned), list(done)
    for alike in (lambda a, b: described(a) == described(b), lambda a, b: a.test == b.test, lambda a, b: True):
        for before in list(left):
            after = next((one for one in right if alike(before, one)), None)
            if after is not None:
                left.remove(before)
                right.remove(after)
                yield before, after
    yield from ((before, None) for before in left)
    yield from ((None, after) for after in right)


def described(entry: Comparison) -> str:
    """The test with those of its options that are not the default: `Wilcoxon (zeros: pratt)`."""
    stated = entry.model_dump(mode="json", exclude_defaults=True)
    options = [f"{name}: {as_text(stated[name])}" for name in _OPTIONS if name in stated]
    return TESTS[entry.test].label + (f" ({'; '.join(options)})" if options else "")


def together(measures: Sequence[str], plan: Registered, now: Registered, known: Sequence[str]) -> str:
    """The measures' names, with a pattern of study.yaml in the place of those that it stands for, if all are there."""
    named = list(measures)
    for pattern in (name for one in (*plan.comparisons, *now.comparisons) for name in one.measures if "*" in name):
        meant = measures_of(pattern, known)
        if set(meant) <= set(named):
            named[named.index(meant[0])] = pattern
            named = [name for name in named if name not in meant or name == pattern]
    return ", ".join(named)


# Families ---------------------------------------------------------------------------------------------------------


def family_rows(plan: Registered, now: Registered, known: Sequence[str]) -> Iterator[Row]:
    """How each planned test's p is adjusted, and over which others."""
    said: dict[tuple[str, str, str], list[str]] = {}
    for measure, before, after in _pairs(plan, now, known):
        if before is not None and after is not None:
            planned, done = _family(before, plan, known), _family(after, now, known)
            verdict = AS_PLANNED if planned == done else DEVIATION
            said.setdefault((_family_text(planned), _family_text(done), verdict), []).append(measure)
    for (before_text, after_text, verdict), measures in said.items():
        named = together(list(dict.fromkeys(measures)), plan, now, known)
        yield point("adjustment of p", before_text, after_text, verdict, named)


_Family = tuple[str, tuple[str, ...]]
"""An adjustment, and the measures and tests it is over; over none where p is not adjusted."""


def _family(entry: Comparison, registered: Registered, known: Sequence[str]) -> _Family:
    """That of an entry: its own measures, or those of every entry that names the same family."""
    if entry.adjust == "none":
        return entry.adjust, ()
    sharing = [one for one in registered.comparisons if entry.family is not None and one.family == entry.family]
    members = (f"{name} by {TESTS[one.test].label}" for one in sharing or [entry] for name in entries_of([one], known))
    return entry.adjust, tuple(sorted(members))


def _family_text(family: _Family) -> str:
    adjust, members = family
    if adjust == "none":
        return "not adjusted"
    over = listing(list(members)) if len(members) <= _NAMED_MAX else counted(len(members), "test")
    return f"{adjustment_label(adjust)} over {over}"
