"""A page for each participant of a study with many sessions or participants."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.report.document import html
from pipeline.report.document.model import Block, Document, Link, Pages, Paragraph, Section, Table, columns
from pipeline.report.sections.material import ORIGINS, Material
from pipeline.report.sections.traces import PAGE as TRACES
from pipeline.tables.catalogue import TABLES
from pipeline.tables.columns import TEXT
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import reference_phrase
from pipeline.words.names import measure_label
from pipeline.words.numbers import NO_VALUE, milliseconds, number, percent
from pipeline.words.phrases import counted

FOLDER = "participants"
_MANY = 40  # of sessions or participants: the report's own tables show no more than the first rows then
Cell = Callable[[Any], str]

_TABLES: dict[str, tuple[str, tuple[tuple[str, str, Cell], ...]]] = {
    "quality": (
        "The sensor streams as they were recorded.",
        (
            ("Session", "session", str),
            ("Stream", "stream", str),
            ("Messages", "messages_read", str),
            ("Lost", "messages_lost", lambda lost: "unknown" if lost is None else str(lost)),
            ("Rate (Hz)", "rate_hz", partial(number, digits=1)),
            ("Longest gap (s)", "gap_max_s", number),
            ("Jitter (ms)", "jitter_ms", lambda ms: number(ms, 1) if ms is None or ms >= 0.05 else "0.0"),
            ("Note", "note", lambda note: note or ""),
        ),
    ),
    "accuracy": (
        "How far each estimator was from {standard}, and how late.",
        (
            ("Session", "session", str),
            ("Estimator", "estimator", str),
            ("RMSE (mm)", "rmse_mm", number),
            ("Stated SD (mm)", "sd_mm", number),
            ("In 95 % interval", "coverage_95", partial(percent, digits=0)),
            ("Lag (ms)", "lag_s", milliseconds),
            ("Jitter (mm)", "jitter_mm", number),
        ),
    ),
    "exclusions": (
        "What is missing or was left out, and why.",
        (
            ("Condition", "condition", lambda name: name or NO_VALUE),
            ("Session", "session", lambda name: name or NO_VALUE),
            ("Measure", "measure", lambda name: measure_label(name) if name else "all"),
            ("What", "what", str),
            ("Reason", "reason", lambda reason: reason or ""),
        ),
    ),
}


def section(material: Material) -> Section | None:
    """Links to the pages; None where the study is small enough for one page."""
    people = _people(material)
    if not people:
        return None
    text = (
        f"Each of the {counted(len(people), 'participant')} has a page with their values, sessions and gaps, in the"
        f" folder {FOLDER} beside this report; report.zip holds all of it."
    )
    links = tuple(Link(person, f"{FOLDER}/{name}") for name, person in people.items())
    return Section("participants", "Participants one by one", (Paragraph((text,)), Pages("Participants", links)))


def write(material: Material, folder: Path) -> None:
    """Write one page per participant, where there are many."""
    people = _people(material)
    if not people:
        return
    folder.mkdir()
    values = {name: material.participant_means(name) for name in dict.fromkeys(material.measures["measure"])}
    sessions, rows = _by_person(material)
    standard = reference_phrase(row["reference"] for row in material.rows("accuracy"))
    for name, person in people.items():
        sections = (
            Section("measures", "Measures", (_measures(material.study.conditions, values, person),)),
            *_sessions(sessions.get(person, {}), rows.get(person, {}), standard),
        )
        html.render(_document(material, person, sections), folder, folder / name)


def _by_person(material: Material) -> tuple[dict[str, dict[str, int]], dict[str, dict[str, list[Row]]]]:
    """By participant: their sessions with their places among all, and their rows of each table shown."""
    sessions: dict[str, dict[str, int]] = {}
    participant_of: dict[str, str] = {}
    for place, session in enumerate(material.sessions, 1):
        if session.participant is not None:
            sessions.setdefault(session.participant, {})[session.id] = place
            participant_of[session.id] = session.participant
    rows: dict[str, dict[str, list[Row]]] = {}
    for name in _TABLES:
        for row in material.rows(name):
            person = participant_of.get(row["session"], row.get("participant"))
            if person is not None:
                rows.setdefault(person, {}).setdefault(name, []).append(row)
    return sessions, rows


def _people(material: Material) -> dict[str, str]:
    """Participants by the file name of their page; empty where there are too few for pages.

    Pages are numbered, because ids may hold characters that no file name can.
    """
    people = {str(person) for person in material.measures["participant"].dropna()}
    people |= {session.participant for session in material.sessions if session.participant is not None}
    people |= {row["participant"] for row in material.rows("exclusions") if row["participant"] is not None}
    if max(len(people), len(material.sessions)) <= _MANY:
        return {}
    return {f"{index:04d}.html": person for index, person in enumerate(sorted(people), 1)}


def _document(material: Material, person: str, sections: tuple[Section, ...]) -> Document:
    back = Link("Back to the report", "../report.html")
    return Document(f"Participant {person}", material.study.title, ORIGINS[material.study.data_origin], sections, back)


def _measures(conditions: Sequence[str], values: Mapping[str, pd.DataFrame], person: str) -> Table:
    """Every measure of a participant, one column per condition."""
    cells = [
        (measure_label(measure), *map(number, of_all.loc[[person]].to_numpy(np.float64)[0].tolist()))
        for measure, of_all in values.items()
        if person in of_all.index
    ]
    return Table(
        "table-measures",
        "The participant's own values, averaged over everything but the condition.",
        columns(("Measure", *conditions), 1),
        tuple(cells),
    )


def _sessions(mine: Mapping[str, int], rows: Mapping[str, list[Row]], standard: str) -> Iterator[Section]:
    """A participant's sessions and rows; `mine` has their places, `standard` is what errors are measured from."""
    blocks: list[Block] = []
    if mine:
        blocks.append(
            Pages(
                "Traces", tuple(Link(f"Traces of {session}", f"../{TRACES}#{place}") for session, place in mine.items())
            )
        )
    blocks += [_table(name, rows[name], standard) for name in _TABLES if name in rows]
    if blocks:
        yield Section("sessions", "Sessions and gaps", tuple(blocks))


def _table(name: str, rows: Sequence[Row], standard: str) -> Table:
    caption, shown = _TABLES[name]
    titles = [title for title, _, _ in shown]
    kinds = {column.name: column.kind for column in TABLES[name].columns}
    first_number = next((at for at, (_, key, _) in enumerate(shown) if kinds[key] != TEXT), len(titles))
    cells = tuple(tuple(cell(row[key]) for _, key, cell in shown) for row in rows)
    return Table(f"table-{name}", caption.format(standard=standard), columns(titles, first_number), cells)
