"""A sheet of a table as readings: its stamps, and the figures that a stream wants, in SI units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.errors import did_you_mean
from pipeline.sessions.logs.log import Claims, IntArray, Readings, Wanted
from pipeline.sessions.logs.tables.events import events_of
from pipeline.sessions.logs.tables.sheet import Sheet, Vector
from pipeline.statistics.arrays import FloatArray


def readings_of(sheet: Sheet, want: Wanted, sheets: Mapping[str, Sheet]) -> Readings:
    """A sheet's readings; where they cannot be had, none, with the reason in the notes."""
    lost, count = sheet.table.lost, sheet.table.rows
    notes = (f"{lost} lines are left out: they have more or fewer cells than the others",) if lost else ()
    if want.content == "anything":
        return _counted(sheet, want, notes)
    try:
        stamp = _stamps(sheet, want)
        if want.content == "events":
            events = events_of(sheet.table)
            return Readings(stamp, stamp, np.zeros((count, 0)), events, lost, notes)
        values = _values(sheet, want, stamp, sheets)
    except ValueError as error:
        none = np.zeros(0, np.int64)
        return Readings(none, none, np.zeros((0, 3)), (), lost + count, (*notes, str(error)))
    claims = Claims()
    if want.content == "acceleration":
        no_turning = not values[:, 3:6].any()
        claims = Claims(gyroscope_disclaimed=np.full(count, no_turning), force_disclaimed=np.zeros(count, bool))
    return Readings(stamp, stamp, values, (), lost, notes, True, claims)


def _counted(sheet: Sheet, want: Wanted, notes: tuple[str, ...]) -> Readings:
    """How many readings there are, with their times if these are known without study.yaml."""
    nothing = np.zeros((sheet.table.rows, 0))
    try:
        stamp = _stamps(sheet, want)
    except ValueError as error:
        stamp, notes = np.zeros(sheet.table.rows, np.int64), (*notes, str(error))
    return Readings(stamp, stamp, nothing, (), sheet.table.lost, notes)


def _stamps(sheet: Sheet, want: Wanted) -> IntArray:
    """The times of a sheet's lines in ns. ValueError where it has none, or their unit is not known."""
    stated = want.source.fields.get("stamp")
    column = stated[0] if stated is not None else sheet.stamp
    if column is None and sheet.period_s is not None:
        apart: IntArray = np.rint(np.arange(sheet.table.rows) * sheet.period_s * 1e9).astype(np.int64)
        return apart
    if column is None:
        raise ValueError(f"no column of times is known; name it by `fields: {{stamp: …}}`{_there(sheet)}")
    if column not in sheet.table.columns:
        raise ValueError(f'there is no column "{column}" for fields: stamp{_there(sheet, column)}')
    unit_s = want.source.stamp_unit_s or sheet.time_units_s.get(column)
    if unit_s is None:
        raise ValueError(f'the unit of the times in "{column}" is not known; say it by `stamp_unit: s` (or ms, us, ns)')
    return sheet.table.times_ns(column, unit_s)


def _values(sheet: Sheet, want: Wanted, stamp: IntArray, sheets: Mapping[str, Sheet]) -> FloatArray:
    first = _vector(sheet, want.content, want)
    if first is None:
        raise ValueError(
            f"no columns of a {want.content} are known; name them by `fields: {{{want.content}: [x, y, z]}}`"
            f"{_there(sheet)}"
        )
    moved = _figures(sheet, want.content, first, want.source.scale)
    if sheet.zero_is_missing:
        moved[(moved == 0.0).all(axis=1)] = np.nan
    if want.content != "acceleration":
        return moved
    turning = _beside(sheet, "angular_velocity", want, stamp, sheets, 3)
    orientation = _beside(sheet, "orientation", want, stamp, sheets, 4)
    unknown = np.full((len(moved), 4), np.nan)
    return np.hstack(
        [
            moved,
            np.zeros((len(moved), 3)) if turning is None else turning,
            unknown if orientation is None else _of_length_1(orientation),
        ]
    )


def _vector(sheet: Sheet, name: str, want: Wanted) -> Vector | None:
    stated = want.source.fields.get(name)
    if stated is None:
        return sheet.vectors.get(name)
    for column in stated:
        if column not in sheet.table.columns:
            raise ValueError(f'there is no column "{column}" for fields: {name}{_there(sheet, column)}')
    if len(stated) == 1:
        raise ValueError(f"fields: {name} needs one column for each axis")
    return tuple(stated)


def _figures(sheet: Sheet, name: str, columns: Vector, scale: float) -> FloatArray:
    """A vector's figures such that `scale` turns them to SI. ValueError where the file and study.yaml disagree."""
    figures = np.column_stack([sheet.table.numbers(column) for column in columns])
    in_file = sheet.units.get(name) if columns == sheet.vectors.get(name) else None
    if in_file is None:
        return figures
    if scale not in (1.0, in_file):
        raise ValueError(f"study.yaml states another `unit` than the file, which has {in_file:g} of SI")
    return figures * (in_file / scale)


def _beside(
    sheet: Sheet, name: str, want: Wanted, stamp: IntArray, sheets: Mapping[str, Sheet], width: int
) -> FloatArray | None:
    """Angular velocities or orientations, of the same table or of another of the session's: the last at each time.

    Apps for phones write each sensor to a file of its own.
    """
    scale = want.source.turning_scale if name == "angular_velocity" else 1.0
    own = _vector(sheet, name, want)
    if own is not None:
        return _figures(sheet, name, own, scale)
    for other in dict.fromkeys(one.topic for one in sheets.values()):
        beside = sheets[other]
        if beside is sheet or name not in beside.vectors or beside.kind != sheet.kind:
            continue
        times = (
            _stamps(beside, want) if want.source.fields.get("stamp", ("",))[0] in ("", *beside.table.columns) else None
        )
        if times is None or not len(times):
            continue
        figures = _figures(beside, name, beside.vectors[name], scale)
        at = np.searchsorted(times, stamp, side="right") - 1
        return np.where((at >= 0)[:, np.newaxis], figures[np.maximum(at, 0)], 0.0 if width == 3 else np.nan)
    return None


def _of_length_1(turn: FloatArray) -> FloatArray:
    """Orientations, NaN where their length is not 1."""
    with np.errstate(invalid="ignore"):
        length = (turn**2).sum(axis=1)
        unit = (length > 0.8) & (length < 1.25)
    return np.where(unit[:, np.newaxis], turn, np.nan)


def _there(sheet: Sheet, meant: str = "") -> str:
    hint = did_you_mean(meant, sheet.table.columns) if meant else ""
    return (hint if "did you mean" in hint else "") + f" (there: {', '.join(list(sheet.table.columns)[:30])})"
