"""Of a study with many sessions or participants, a page for each participant."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pipeline import tables
from pipeline.document import html
from pipeline.document.model import Block, Document, Link, Pages, Paragraph, Section, Table, columns
from pipeline.sections.material import ORIGINS, Material, Row
from pipeline.sections.traces import PAGE as TRACES
from pipeline.wording import NOTHING, counted, measure_label, number, percent, seconds

FOLDER = "participants"
_MANY = 40  # of sessions or participants: the report's own tables show no more than the first rows then
Cell = Callable[[Any], str]

_SHOWN: dict[str, tuple[str, tuple[tuple[str, str, Cell], ...]]] = {
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
        "How far each estimator was from the reference, and how late.",
        (
            ("Session", "session", str),
            ("Estimator", "estimator", str),
            ("RMSE (mm)", "rmse_mm", number),
            ("Stated SD (mm)", "sd_mm", number),
            ("In 95 % interval", "coverage_95", partial(percent, digits=0)),
            ("Lag (ms)", "lag_s", seconds),
            ("Jitter (mm)", "jitter_mm", number),
        ),
    ),
    "exclusions": (
        "What is missing or was left out, and why.",
        (
            ("Condition", "condition", lambda name: name or NOTHING),
            ("Session", "session", lambda name: name or NOTHING),
            ("Measure", "measure", lambda name: measure_label(name) if name else "all"),
            ("What", "what", str),
            ("Reason", "reason", lambda reason: reason or ""),
        ),
    ),
}
_TEXTS = {"Session", "Stream", "Note", "Estimator", "Condition", "Measure", "What", "Reason"}


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
    """A page a participant, where there are many."""
    for name, person in _people(material).items():
        folder.mkdir(exist_ok=True)
        html.render(_document(material, person), folder, folder / name)


def _people(material: Material) -> dict[str, str]:
    """Participants by the name of their page, which is a number: their ids may hold anything; none where few."""
    known = {str(person) for person in material.measures["participant"].dropna()}
    known |= {session.participant for session in material.sessions if session.participant is not None}
    known |= {row["participant"] for row in material.rows("exclusions") if row["participant"] is not None}
    if max(len(known), len(material.sessions)) <= _MANY:
        return {}
    return {f"{index:04d}.html": person for index, person in enumerate(sorted(known), 1)}


def _document(material: Material, person: str) -> Document:
    sections = [
        Section("measures", "Measures", (_measures(material, person),)),
        *_sessions(material, person),
    ]
    back = Link("Back to the report", "../report.html")
    origin = ORIGINS[material.study.data_origin]
    return Document(f"Participant {person}", material.study.title, origin, tuple(sections), back)


def _measures(material: Material, person: str) -> Table:
    """Every measure, a column a condition."""
    conditions = material.study.conditions
    mine = material.measures[material.measures["participant"] == person]
    cells = []
    for measure in dict.fromkeys(mine["measure"]):
        (values,) = tables.participant_means(mine, str(measure), conditions).to_numpy("float64")
        cells.append((measure_label(str(measure)), *(number(float(value)) for value in values)))
    return Table(
        "table-measures",
        "The participant's own values, means over everything but the condition.",
        columns(("Measure", *conditions), 1),
        tuple(cells),
    )


def _sessions(material: Material, person: str) -> Iterator[Section]:
    mine = {session.id: index for index, session in enumerate(material.sessions, 1) if session.participant == person}
    blocks: list[Block] = []
    if mine:
        blocks.append(Pages("Traces", tuple(Link(f"Traces of {one}", f"../{TRACES}#{at}") for one, at in mine.items())))
    for name in _SHOWN:
        rows = [
            row
            for row in material.rows(name)
            if row["session"] in mine or (name == "exclusions" and row["participant"] == person)
        ]
        if rows:
            blocks.append(_table(name, rows))
    if blocks:
        yield Section("sessions", "Sessions and gaps", tuple(blocks))


def _table(name: str, rows: Sequence[Row]) -> Table:
    caption, shown = _SHOWN[name]
    titles = [title for title, _, _ in shown]
    texts = next((at for at, title in enumerate(titles) if title not in _TEXTS), len(titles))
    cells = tuple(tuple(cell(row[key]) for _, key, cell in shown) for row in rows)
    return Table(f"table-{name}", caption, columns(titles, texts), cells)
