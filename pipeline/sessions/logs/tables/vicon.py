"""Vicon Nexus's CSV: a section of trajectories or segments, its rate, names, axes and units above the figures.

    Trajectories                               or Segments, Objects
    100
    ,,Subject:hand,,,Subject:head,,
    Frame,Sub Frame,X,Y,Z,X,Y,Z                or RX,RY,RZ,TX,TY,TZ
    ,,mm,mm,mm,mm,mm,mm

A section ends with an empty line; what was not seen is an empty cell.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.tables.sheet import LENGTHS, Sheet
from pipeline.sessions.logs.tables.table import table_of
from pipeline.sessions.logs.tables.text import Text, split_line

_SECTIONS = ("Trajectories", "Segments", "Objects")
_HEADER_LINES = 5


def recognised(text: Text) -> bool:
    """Whether the first line names one of Vicon's sections."""
    return text.head[0].strip(', "') in _SECTIONS and len(text.head) > _HEADER_LINES


def sheets(path: Path, text: Text) -> list[Sheet]:
    """Every marker, segment or object of the first section. SessionError where its rate or a unit is not known."""
    rate, names, axes, units = (split_line(line, ",") for line in text.head[1:_HEADER_LINES])
    try:
        period_s = 1.0 / float(rate[0])
    except (LookupError, ValueError, ZeroDivisionError):
        raise SessionError(f'its second line is no rate: "{text.head[1][:40]}"') from None
    bodies: list[str] = []
    columns = ["Frame", "Sub Frame"]
    for place in range(2, len(axes)):
        name = names[place] if place < len(names) else ""
        bodies += [name] if name else []
        columns.append(f"{bodies[-1] if bodies else ''}|{axes[place]}")
    section = bytes(text.below(_HEADER_LINES)).split(b"\n\n", 1)[0]
    table = table_of(section, columns, ",")
    found = []
    for body in dict.fromkeys(bodies):
        candidates = [tuple(f"{body}|{prefix}{axis}" for axis in "XYZ") for prefix in ("", "T")]
        vector = next((one for one in candidates if table.columns.keys() >= set(one)), None)
        if vector is None:
            continue
        unit = LENGTHS.get(units[columns.index(vector[0])].casefold() if len(units) >= len(columns) else "mm")
        if unit is None:
            raise SessionError(f'its unit "{units[columns.index(vector[0])]}" is no known length')
        name = body.rpartition(":")[2]
        found.append(Sheet(name, "Vicon", table, None, {}, {"position": vector}, {"position": unit}, period_s))
    return found
