"""The page that plays sessions and shows their traces, the only one that needs its scripts.

It loads nothing from elsewhere.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from pipeline.report.document.html import write_page
from pipeline.report.document.model import Link
from pipeline.statistics.arrays import FloatArray

BUDGET_BYTES = 4_500_000  # for all sessions' data as text: a page of less than 5 MB can be sent by mail
_EVENT_BYTES = 100  # of one event as text, at the most
_TENTHS = 10
_STEPS_S = tuple(
    1e-3 * size * 10**power for power in range(8) for size in (1, 1.5, 2, 3, 5, 7)
)  # steps of time, of each of which the first reading is kept
_SCRIPTS = ("shapes.js", "scene.js", "player.js", "traces.js")  # the last one begins
_SCRIPT_ENDS = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}

Kind = Literal["tracker", "estimator", "display", "reference"]


@dataclass(frozen=True)
class Series:
    """One line of a session: `time_s` (n,) rises, `value_mm` (n, axes); `place` is that of its colour."""

    name: str
    kind: Kind
    axes: tuple[str, ...]
    time_s: FloatArray
    value_mm: FloatArray
    place: int = 0


@dataclass(frozen=True)
class Event:
    """A trial's start or a selection: where its target was and where was selected in the plane, in mm, if known."""

    type: Literal["trial_start", "selection"]
    time_s: float
    target_mm: tuple[float, float] | None
    selected_mm: tuple[float, float] | None


@dataclass(frozen=True)
class Scene:
    """What a session is played on: two axes, the task in them in mm, and the lines that are shown at first.

    `displayed` is the line that the participant saw, `displayed_by` the estimator behind it, and `compared` the line to
    compare it with; None where there is none.
    """

    plane: tuple[str, str]
    displayed: str | None
    displayed_by: str | None
    compared: str | None
    events: tuple[Event, ...] = ()
    path_mm: tuple[tuple[float, float], ...] = ()
    targets_mm: tuple[tuple[float, float], ...] = ()
    target_diameter_mm: float | None = None
    window_mm: tuple[float, float] | None = None


@dataclass(frozen=True)
class Traces:
    """One session's lines, and the scene it can be played on if it has one."""

    session: str
    participant: str | None
    condition: str | None
    series: tuple[Series, ...]
    scene: Scene | None = None


def render(title: str, origin: str, sessions: Iterable[Traces], count: int, path: Path) -> None:
    """Write the page of `count` sessions, each in steps of time as fine as its share of the page allows."""
    packed = [_packed_within(traces, BUDGET_BYTES // max(count, 1)) for traces in sessions]
    data = json.dumps(packed, ensure_ascii=False, separators=(",", ":"))
    for character, escaped in _SCRIPT_ENDS.items():
        data = data.replace(character, escaped)
    back = Link("Back to the report", "report.html")
    write_page("traces.html.jinja", _SCRIPTS, path, origin, title=title, data=data, back=back)


def _packed_within(traces: Traces, budget: int) -> dict[str, Any]:
    """A session packed, and thinned until it fits; if none fits, the coarsest step is taken.

    Events get a quarter of the room; those that do not fit are left out, and counted.
    """
    packed = pack(traces, 0.0, budget // 4 // _EVENT_BYTES)
    budget -= _EVENT_BYTES * len(packed["scene"]["events"]) if packed["scene"] else 0
    if len(packed["data"]) <= budget:
        return packed
    finer = _mean_interval_s(traces) * len(packed["data"]) / budget / 2  # finer steps would not fit, or barely
    for step_s in [step for step in _STEPS_S if step >= finer] or _STEPS_S[-1:]:
        packed = {**pack(traces, step_s), "scene": packed["scene"]}
        if len(packed["data"]) <= budget:
            break
    return packed


def _mean_interval_s(traces: Traces) -> float:
    """Mean time between the readings of the series with most of them."""
    densest = max(traces.series, key=lambda series: len(series.time_s))
    return float(np.ptp(densest.time_s)) / len(densest.time_s)


def pack(traces: Traces, step_s: float, events: int = 0) -> dict[str, Any]:
    """A session as an object for JSON.

    `data` is base64 of zlib of the series one after the other: first its times in 0.1 ms, then each axis in 0.1 mm.
    Each is stored as differences in zigzag int32, the lowest bytes of all values first. traces.js unpacks it.
    The scene has at most so many `events`.
    """
    listed, parts, left_out = [], [], 0
    for series in traces.series:
        storable = _storable(series)
        left_out += len(storable) - int(storable.sum())
        time_s, value_mm = series.time_s[storable], series.value_mm[storable]
        thin = _first_of_each_step(time_s, step_s)
        parts += [_bytes(time_s[thin] * 1e3), *(_bytes(column) for column in value_mm[thin].T)]
        listed.append(
            {"name": series.name, "kind": series.kind, "axes": series.axes, "n": int(thin.sum()), "place": series.place}
        )
    return {
        "session": traces.session,
        "participant": traces.participant,
        "condition": traces.condition,
        "step_s": step_s,
        "left_out": left_out,
        "series": listed,
        "scene": traces.scene and _packed_scene(traces.scene, events),
        "data": base64.b64encode(zlib.compress(b"".join(parts), 6)).decode(),
    }


def _packed_scene(scene: Scene, events: int) -> dict[str, Any]:
    """A scene as an object for JSON: places are [x, y] in 0.1 mm as the lines' are; unknown ones are null."""
    return {
        "plane": scene.plane,
        "displayed": scene.displayed,
        "displayed_by": scene.displayed_by,
        "compared": scene.compared,
        "path": scene.path_mm,
        "targets": scene.targets_mm,
        "diameter": scene.target_diameter_mm,
        "window": scene.window_mm,
        "events": [
            {
                "type": event.type,
                "time": round(event.time_s, 4),
                "target": _rounded(event.target_mm),
                "at": _rounded(event.selected_mm),
            }
            for event in scene.events[:events]
        ],
        "events_left_out": max(len(scene.events) - events, 0),
    }


def _rounded(place_mm: tuple[float, float] | None) -> list[float] | None:
    return None if place_mm is None else [round(along, 1) for along in place_mm]


def _storable(series: Series) -> npt.NDArray[np.bool_]:
    """Which readings fit into an int32 as tenths."""
    largest = (2**31 - 1) / _TENTHS - 1
    inside = (np.abs(series.time_s * 1e3) < largest) & (np.abs(series.value_mm) < largest).all(axis=1)
    return np.asarray(inside, dtype=np.bool_)


def _first_of_each_step(time_s: FloatArray, step_s: float) -> npt.NDArray[np.bool_]:
    """Which readings are the first of their step of time."""
    if step_s == 0:
        return np.ones(len(time_s), dtype=np.bool_)
    steps = np.floor(time_s / step_s)
    return np.diff(steps, prepend=-np.inf) > 0


def _bytes(values: FloatArray) -> bytes:
    """Tenths as zigzag differences in planes of bytes: slow changes are nearly all zeros, which compress well."""
    tenths = np.rint(values * _TENTHS).astype(np.int32)
    with np.errstate(over="ignore"):  # differences wrap around, and back again when they are summed
        change = np.diff(tenths, prepend=np.int32(0))
    zigzag = ((change.astype(np.int32) << 1) ^ (change.astype(np.int32) >> 31)).astype("<u4")
    return zigzag.view(np.uint8).reshape(-1, 4).T.tobytes()
