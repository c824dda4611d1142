"""Tables as logs: CSV and TSV of apps for phones, motion-capture systems, datasets, and any other.

Each dialect is a small module that turns a file into `Sheet`s; this one chooses among them by a file's content, and
`readings` turns a sheet into readings. A table has no times of arrival: a reading arrived when it was stamped.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits, Log, MessageType, Readings, Wanted
from pipeline.sessions.logs.tables import motive, named, qualisys, trajectory, vicon
from pipeline.sessions.logs.tables.readings import readings_of
from pipeline.sessions.logs.tables.sheet import Sheet
from pipeline.sessions.logs.tables.text import read_text

_DIALECTS = (motive, qualisys, vicon, trajectory)
"""Tried in this order; what none recognises has one line of names."""

_DAY_NS = 86_400 * 10**9


def read(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The wanted topics of one table. SessionError for a file that is none."""
    return read_all([path], tuple(wanted), limits)


def read_all(paths: Sequence[Path], wanted: Sequence[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The wanted topics of a session's tables: sheets by their bodies' names, or by the file's where it holds one."""
    listed: dict[str, Sheet] = {}
    by_file: dict[str, Sheet] = {}
    faults: list[str] = []
    for path in paths:
        try:
            own = _sheets(path, limits)
        except SessionError as error:
            if len(paths) == 1:
                raise
            faults.append(f"{path.name}: {error}")
            continue
        listed |= {sheet.topic: sheet for sheet in own}
        if len(own) == 1:
            by_file[path.stem] = own[0]
    sheets = by_file | listed
    types = {name: MessageType(sheet.kind, "table", None) for name, sheet in listed.items()}
    wants = wanted or tuple(Wanted(name, "anything") for name in listed)
    topics = {want.key: readings_of(sheets[want.topic], want, sheets) for want in wants if want.topic in sheets}
    _one_clock({want.topic: topics[want.key] for want in wants if want.key in topics and want.content != "anything"})
    return Log({}, topics, tuple(faults), types)


def _sheets(path: Path, limits: Limits) -> list[Sheet]:
    text = read_text(path, limits)
    dialect = next((one for one in _DIALECTS if one.recognised(text)), named)
    found: list[Sheet] = dialect.sheets(path, text)
    if not found:
        raise SessionError("it holds no body with a position")
    return found


def _one_clock(topics: Mapping[str, Readings]) -> None:
    """Raise SessionError where the times of two tables are more than a day apart: they are not of one clock."""
    begins = {name: int(readings.stamp_ns[0]) for name, readings in topics.items() if readings.read}
    if begins and max(begins.values()) - min(begins.values()) > _DAY_NS:
        late, early = max(begins, key=lambda name: begins[name]), min(begins, key=lambda name: begins[name])
        raise SessionError(
            f"the times of {late} and {early} are more than a day apart, so they are not of one clock; take another "
            "column of times by `fields: {stamp: …}` in study.yaml (Sensor Logger has seconds_elapsed)"
        )
