"""OptiTrack Motive's CSV: a line of facts, then lines of types, names, ids and quantities above those of the axes.

    Format Version,1.23,Take Name,…,Length Units,Meters,Coordinate Space,Global
    (blank)
    ,,Type,Rigid Body,Rigid Body,…         or, in older files, without "Type"
    ,,Name,Hand,Hand,…
    ,,ID,…
    ,,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,…
    Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,…

A body that is not seen leaves its cells empty. (docs.optitrack.com, Data Export: CSV)
"""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.tables.sheet import LENGTHS, Sheet
from pipeline.sessions.logs.tables.table import table_of
from pipeline.sessions.logs.tables.text import Text, split_line

_MARK = "Format Version"
_AXES = {"Position": "xyz", "Rotation": "xyzw"}
_VECTOR = {"Position": "position", "Rotation": "orientation"}


def recognised(text: Text) -> bool:
    """Whether the first line is Motive's."""
    return text.head[0].lstrip('"').startswith(_MARK)


def sheets(path: Path, text: Text) -> list[Sheet]:
    """Every rigid body and marker of a take. SessionError where the lines above the figures are not as known."""
    facts = split_line(text.head[0], ",")
    stated = dict(zip(facts[::2], facts[1::2], strict=False))
    unit = LENGTHS.get(stated.get("Length Units", "").casefold())
    if unit is None:
        raise SessionError(
            f'its first line gives no known length as "Length Units": "{stated.get("Length Units", "")}"'
        )
    at = next((index for index, line in enumerate(text.head) if line.startswith("Frame,")), None)
    if at is None:
        raise SessionError('it has no line that begins with "Frame"; export the take with its header')
    above = [split_line(line, ",") for line in text.head[:at] if line.strip(" ,")][1:]
    axes = split_line(text.head[at], ",")
    names = next((row for row in above if "Name" in row[:3]), above[1] if len(above) > 1 else [])
    quantities = above[-1] if above else []
    columns = [f"{_cell(names, place)}|{_cell(quantities, place)}|{axis}" for place, axis in enumerate(axes)]
    columns[0], columns[1] = "Frame", "Time"
    table = table_of(text.below(at + 1), columns, ",")
    bodies = []
    for body in dict.fromkeys(_cell(names, place) for place in range(2, len(axes))):
        vectors = {
            _VECTOR[quantity]: tuple(f"{body}|{quantity}|{axis.upper()}" for axis in wanted)
            for quantity, wanted in _AXES.items()
            if all(f"{body}|{quantity}|{axis.upper()}" in table.columns for axis in wanted)
        }
        if body and "position" in vectors:
            bodies.append(Sheet(body, "OptiTrack Motive", table, "Time", {"Time": 1.0}, vectors, {"position": unit}))
    return bodies


def _cell(row: list[str], place: int) -> str:
    return row[place] if place < len(row) else ""
