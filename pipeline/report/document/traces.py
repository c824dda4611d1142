"""The page of the sessions' traces, the only one that needs its script. It loads nothing from elsewhere."""

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
_TENTHS = 10
_STEPS_S = tuple(
    1e-3 * size * 10**power for power in range(8) for size in (1, 1.5, 2, 3, 5, 7)
)  # steps of time, of each of which the first reading is kept
_SCRIPT_ENDS = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}

Kind = Literal["tracker", "estimator", "display", "reference"]


@dataclass(frozen=True)
class Series:
    """One line of a session: `time_s` (n,) rises, `value_mm` (n, axes)."""

    name: str
    kind: Kind
    axes: tuple[str, ...]
    time_s: FloatArray
    value_mm: FloatArray


@dataclass(frozen=True)
class Traces:
    """One session's lines."""

    session: str
    participant: str | None
    condition: str | None
    series: tuple[Series, ...]


def render(title: str, origin: str, sessions: Iterable[Traces], count: int, path: Path) -> None:
    """Write the page of `count` sessions, each in steps of time as fine as its share of the page allows."""
    packed = [_packed_within(traces, BUDGET_BYTES // max(count, 1)) for traces in sessions]
    data = json.dumps(packed, ensure_ascii=False, separators=(",", ":"))
    for character, escaped in _SCRIPT_ENDS.items():
        data = data.replace(character, escaped)
    back = Link("Back to the report", "report.html")
    write_page("traces.html.jinja", "traces.js", path, origin, title=title, data=data, back=back)


def _packed_within(traces: Traces, budget: int) -> dict[str, Any]:
    """A session packed, and thinned until it fits; if none fits, the coarsest step is taken."""
    packed = _packed(traces, 0.0)
    if len(packed["data"]) <= budget:
        return packed
    finer = _mean_interval_s(traces) * len(packed["data"]) / budget / 2  # finer steps would not fit, or barely
    for step_s in [step for step in _STEPS_S if step >= finer] or _STEPS_S[-1:]:
        packed = _packed(traces, step_s)
        if len(packed["data"]) <= budget:
            break
    return packed


def _mean_interval_s(traces: Traces) -> float:
    """Mean time between the readings of the series with most of them."""
    densest = max(traces.series, key=lambda series: len(series.time_s))
    return float(np.ptp(densest.time_s)) / len(densest.time_s)


def _packed(traces: Traces, step_s: float) -> dict[str, Any]:
    """A session as an object for JSON.

    `data` is base64 of zlib of the series one after the other: first its times in 0.1 ms, then each axis in 0.1 mm.
    Each is stored as differences in zigzag int32, the lowest bytes of all values first. traces.js unpacks it.
    """
    listed, parts, left_out = [], [], 0
    for series in traces.series:
        storable = _storable(series)
        left_out += len(storable) - int(storable.sum())
        time_s, value_mm = series.time_s[storable], series.value_mm[storable]
        thin = _first_of_each_step(time_s, step_s)
        parts += [_bytes(time_s[thin] * 1e3), *(_bytes(column) for column in value_mm[thin].T)]
        listed.append({"name": series.name, "kind": series.kind, "axes": series.axes, "n": int(thin.sum())})
    return {
        "session": traces.session,
        "participant": traces.participant,
        "condition": traces.condition,
        "step_s": step_s,
        "left_out": left_out,
        "series": listed,
        "data": base64.b64encode(zlib.compress(b"".join(parts), 6)).decode(),
    }


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
