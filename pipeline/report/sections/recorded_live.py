"""How sessions were recorded live: by what, with which settings, and what was overruled to begin."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from pipeline.report.document.model import Block, Folded, Paragraph, Strong, Table, Text, columns
from pipeline.report.sections.material import Material
from pipeline.tables.table import Row
from pipeline.words.phrases import counted, listing

_ROWS_MAX = 40
_SHOWN = 6


def blocks(material: Material) -> Iterator[Block]:
    """A paragraph, and a table of what was begun over a red light or without a check; nothing if none was live."""
    rows = material.rows("recorders")
    if not rows:
        return
    by = listing([f"{name} ({count})" for name, count in sorted(Counter(row["recorder"] for row in rows).items())])
    again = [row["session"] for row in rows if row["attempt"] not in (None, "1")]
    said = f"{counted(len(rows), 'session')} recorded live, by {by}."
    if again:
        said += f" At a further attempt: {listing(again[:_SHOWN])}{' and others' if len(again) > _SHOWN else ''}."
    yield Paragraph((said, *(f" {words}" for words in _other_settings(rows))))
    overruled = [row for row in rows if row["overruled"]]
    if overruled:
        yield Folded(
            f"Begun over a red light, or without a check: {counted(len(overruled), 'session')}", (_table(overruled),)
        )


def cautions(material: Material) -> Iterator[Text]:
    """What a reader of the first page should know of it."""
    said = list(_other_settings(material.rows("recorders")))
    if said:
        yield (Strong("Settings: "), *said)


def _other_settings(rows: list[Row]) -> Iterator[str]:
    """Which sessions were recorded with other settings than most."""
    by_settings = Counter(row["settings"] for row in rows if row["settings"])
    if len(by_settings) < 2:
        return
    usual = by_settings.most_common(1)[0][0]
    others = [row["session"] for row in rows if row["settings"] not in (None, usual)]
    named = f"{listing(others[:_SHOWN])}{' and others' if len(others) > _SHOWN else ''}"
    yield (
        f"study.yaml was changed while the study was recorded: {named} had other settings than"
        f" {counted(by_settings[usual], 'session')}, so what was shown may not be what they give now."
    )


def _table(rows: list[Row]) -> Table:
    more = f" The first {_ROWS_MAX} of {len(rows)}." if len(rows) > _ROWS_MAX else ""
    return Table(
        "table-overruled",
        f"What the operator's page said before the task, and the reason to begin all the same.{more}",
        columns(("Session", "Overruled", "Reason"), 3),
        tuple((row["session"], row["overruled"], row["started_although"]) for row in rows[:_ROWS_MAX]),
    )
