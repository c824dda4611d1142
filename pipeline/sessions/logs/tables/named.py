"""Tables with one line of names: apps for phones, datasets, and any other, by the names and units of their columns.

Sensor Logger   time (ns since 1970), seconds_elapsed, z, y, x; each sensor in a file of its own
phyphox         "Time (s)", "Acceleration x (m/s^2)", …
EuRoC           #timestamp [ns], p_RS_R_x [m], …, q_RS_w [], …; or w_RS_S_x [rad s^-1], …, a_RS_S_x [m s^-2]
any other       time or t; x, y, z; what is called otherwise is said by `fields:` in study.yaml
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pipeline.sessions.logs.tables.sheet import LENGTHS, TIMES, Sheet, Vector
from pipeline.sessions.logs.tables.table import table_of
from pipeline.sessions.logs.tables.text import Text, separator_of, split_line
from pipeline.study.units import G_M_S2, RAD_PER_DEG

_WITH_UNIT = re.compile(r"^(?P<name>.*?)\s*[(\[](?P<unit>[^)\]]*)[)\]]$")
_STAMPS = ("timestamp", "time", "t", "time_s", "time_ms", "time_us", "time_ns", "seconds_elapsed", "stamp")
_WORDS: Mapping[str, tuple[str, ...]] = {
    "position": ("", "p", "pos", "position", "p_rs_r"),
    "acceleration": ("a", "acc", "acceleration", "accelerometer", "a_rs_s", "linear_acceleration"),
    "angular_velocity": ("w", "gyro", "gyroscope", "gyr", "angular_velocity", "w_rs_s"),
    "orientation": ("q", "quat", "quaternion", "orientation", "q_rs"),
    "velocity": ("v", "vel", "velocity"),
}
"""What a vector's columns are called before the axis; an x alone is a position, or what the file's name says."""

_OF_FILE: Mapping[str, str] = {
    "accelerometer": "acceleration",
    "totalacceleration": "acceleration",
    "acceleration": "acceleration",
    "accelerometeruncalibrated": "acceleration",
    "gyroscope": "angular_velocity",
    "gyroscopeuncalibrated": "angular_velocity",
    "orientation": "orientation",
}
SENSOR_LOGGER, SINCE_START = "Sensor Logger", "seconds_elapsed"
TOTAL_ACCELERATION = "TotalAcceleration"
"""Sensor Logger's acceleration with gravity; its Accelerometer is without."""

_SENSOR_LOGGER_S = {"time": 1e-9, SINCE_START: 1.0}
_ACCELERATIONS = {"m/s^2": 1.0, "m/s²": 1.0, "m/s2": 1.0, "m s^-2": 1.0, "g": G_M_S2}
_TURNINGS = {"rad/s": 1.0, "rad s^-1": 1.0, "deg/s": RAD_PER_DEG, "°/s": RAD_PER_DEG}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "position": LENGTHS,
    "acceleration": _ACCELERATIONS,
    "angular_velocity": _TURNINGS,
    "velocity": {"m/s": 1.0, "mm/s": 0.001, "cm/s": 0.01, "m s^-1": 1.0},
}


def sheets(path: Path, text: Text) -> list[Sheet]:
    """The one sheet of a table with a line of names."""
    separator = separator_of(text.head[0])
    header = [cell.lstrip("#").strip() for cell in split_line(text.head[0], separator)]
    table = table_of(text.below(1), header, separator)
    plain = {name: _without_unit(name) for name in table.columns}
    stamp = next((name for key in _STAMPS for name, (bare, _) in plain.items() if bare == key), None)
    kind = SENSOR_LOGGER if set(_SENSOR_LOGGER_S) <= set(header) else "table"
    times = {name: _time_unit_s(bare, unit, kind) for name, (bare, unit) in plain.items()}
    vectors, units = vectors_of(table.columns, path.stem)
    if kind == SENSOR_LOGGER:  # x, y, z of its Gravity or Magnetometer are no position
        vectors = {name: columns for name, columns in vectors.items() if name != "position"}
    known = {name: unit_s for name, unit_s in times.items() if unit_s is not None}
    return [Sheet(path.stem, kind, table, stamp, known, vectors, units)]


def vectors_of(names: Iterable[str], of: str) -> tuple[dict[str, Vector], dict[str, float]]:
    """The vectors among columns, and how much of SI their units are; `of`, a sensor, says what x, y, z alone are."""
    plain = {name: _without_unit(name) for name in names}
    vectors = _vectors(plain, _OF_FILE.get(_letters(of)))
    units = {}
    for vector, columns in vectors.items():
        stated = {plain[column][1] for column in columns}
        scale = _UNITS.get(vector, {}).get(next(iter(stated))) if len(stated) == 1 else None
        if scale is not None:
            units[vector] = scale
    return vectors, units


def _without_unit(name: str) -> tuple[str, str]:
    """A column's name in small letters, and its unit if it has one in brackets."""
    match = _WITH_UNIT.match(name)
    bare, unit = (match["name"], match["unit"]) if match is not None else (name, "")
    return bare.strip().casefold().replace(" ", "_"), unit.strip()


def _letters(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.casefold())


def _time_unit_s(bare: str, unit: str, kind: str) -> float | None:
    if kind == SENSOR_LOGGER and bare in _SENSOR_LOGGER_S:
        return _SENSOR_LOGGER_S[bare]
    return TIMES.get(unit) or TIMES.get(bare.rpartition("_")[2])


def _vectors(plain: Mapping[str, tuple[str, str]], of_file: str | None) -> dict[str, Vector]:
    bare = {name: column for column, (name, _) in plain.items()}
    found: dict[str, Vector] = {}
    for vector, words in _WORDS.items():
        axes = "xyzw" if vector == "orientation" else "xyz"
        for word in words:
            columns = _columns(bare, word, axes)
            if columns is not None:
                found.setdefault(vector if word or of_file is None else of_file, columns)
                break
    return found


def _columns(bare: Mapping[str, str], word: str, axes: Sequence[str]) -> Vector | None:
    for joint in ("_", "", ".") if word else ("",):
        names = [f"{word}{joint}{axis}" for axis in axes]
        if all(name in bare for name in names):
            return tuple(bare[name] for name in names)
    return None
