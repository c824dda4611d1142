"""What the readings contradict, and the lag between tracker and phone in every session."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pipeline.report.document.model import Block, Folded, Paragraph, Strong, Table, Text, columns
from pipeline.report.sections.material import Material
from pipeline.report.traffic_lights import LIGHTS, SYMBOLS
from pipeline.sessions.checks.agreement import LAG_UNKNOWN
from pipeline.sessions.fusion_checks import WORSE
from pipeline.tables.table import Row
from pipeline.words.numbers import NO_VALUE
from pipeline.words.phrases import counted, listing

_ROWS_MAX = 40
_NAMED_MAX = 3
LAG = "lag"


def blocks(material: Material) -> Iterator[Block]:
    """How many checks were made, those that are not green, and the lags."""
    rows = material.rows("checks")
    if not rows:
        return
    contradicted = sorted(_contradicted(rows), key=lambda row: -LIGHTS.index(row["status"]))
    counts = f"{counted(len(contradicted), 'contradiction')} in {counted(len(rows), 'check')}"
    text = f"{counts} of logs and tables, against each other and study.yaml; docs/checks.md describes each."
    yield Paragraph((Strong("Checks: "), text))
    if contradicted:
        yield _table(contradicted)
    yield from _lags(rows)


def _contradicted(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["status"] != "green"]


def _lags(rows: Sequence[Row]) -> list[Block]:
    """The lag of each session, and what study.yaml says of it."""
    lags = [row for row in rows if row["check"] == LAG]
    if not lags:
        return []
    cells = tuple((row["session"], row["found"], row["expected"]) for row in lags[:_ROWS_MAX])
    more = f" The first {_ROWS_MAX} of {len(lags)}; all are in tables/checks.csv." if len(lags) > _ROWS_MAX else ""
    table = Table(
        "table-lags",
        "Lag of the tracker's time stamps behind the phone's, measured from their movement, with 95 % interval, beside"
        f" the one that study.yaml states.{more}",
        columns(("Session", "Lag found", "Expected"), 3),
        cells,
    )
    apart = sum(row["status"] != "green" for row in lags)
    untold = sum(row["found"] == LAG_UNKNOWN for row in lags)
    summary = f"Lag between tracker and phone: contradicts study.yaml in {apart} of {counted(len(lags), 'session')}"
    if untold:
        summary += f", cannot be told in {untold}"
    return [Folded(summary, (table,))]


def _table(rows: Sequence[Row]) -> Table:
    cells = tuple(
        (
            row["session"] or NO_VALUE,
            row["check"],
            f"{SYMBOLS[row['status']]} {row['status']}",
            row["found"],
            row["expected"],
            row["message"] or "",
        )
        for row in rows[:_ROWS_MAX]
    )
    more = f" The worst {_ROWS_MAX} of {len(rows)}; all are in tables/checks.csv." if len(rows) > _ROWS_MAX else ""
    titles = ("Session", "Check", "Light", "Found", "Expected", "Likely cause and remedy")
    return Table(
        "table-checks",
        f"Where readings contradict each other or study.yaml, the worst first.{more}",
        columns(titles, len(titles)),
        cells,
    )


def caution(material: Material) -> Iterator[Text]:
    """For the first page: which checks are red in which sessions, whose figures are not to be relied on."""
    red = [row for row in material.rows("checks") if row["status"] == "red" and row["session"]]
    if not red:
        return
    sessions = list(dict.fromkeys(row["session"] for row in red))
    kinds = list(dict.fromkeys(row["check"] for row in red))
    more = f" and {counted(len(kinds) - _NAMED_MAX, 'other check')}" if len(kinds) > _NAMED_MAX else ""
    first = red[0]
    text = (
        f"in {counted(len(sessions), 'session')} ({listing(sessions[:_NAMED_MAX])}"
        f"{', …' if len(sessions) > _NAMED_MAX else ''}), by {listing(kinds[:_NAMED_MAX])}{more}. "
        f"{first['session']}: {first['message']}. Do not rely on figures from these sessions before "
        "this is resolved; the table of checks is under “Data quality and exclusions”."
    )
    yield (Strong("The data contradict themselves or study.yaml "), text)


def worse_than_tracker(material: Material) -> Iterator[Text]:
    """For the first page: which estimators made it worse, in how many sessions, with one as an example."""
    compared = [row for row in material.rows("checks") if row["check"].startswith(WORSE)]
    parts = []
    for check in dict.fromkeys(row["check"] for row in compared):
        rows = [row for row in compared if row["check"] == check]
        worse = [row for row in rows if row["message"]]
        if worse:
            example = f"such as {worse[0]['session']}: {worse[0]['message']}"
            parts.append(f"{check.partition(': ')[2]} in {len(worse)} of {counted(len(rows), 'session')} ({example})")
    if parts:
        yield (Strong("Fusion is worse than its tracker alone: "), f"{'; '.join(parts)}.")


def suspicious_values(material: Material) -> Iterator[Text]:
    """For the first page: values in the study's own tables that look wrong."""
    rows = [row for row in _contradicted(material.rows("checks")) if not row["session"]]
    for row in rows[:_NAMED_MAX]:
        yield (Strong("Look at the values: "), f"{row['message']}.")
    if len(rows) > _NAMED_MAX:
        yield (f"The table of checks has {len(rows) - _NAMED_MAX} more such remarks.",)
