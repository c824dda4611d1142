"""Tables for figures of one session: the seconds with the largest turn, the estimators' lead, and what arrived when."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.compute as pc

from fusion_core import Samples, accuracy
from pipeline.sessions.growing import Growing
from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.recording import SETTLED_S, Recording, Tracked, within
from pipeline.statistics.arrays import FloatArray, run_of
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.columns import S_PER_NS

EXCERPT_S = 4.0  # long enough for a reach, short enough to see single frames
_TURN_SHARE = 0.25  # of the largest range that a turn needs to be one of the hand's
_STRETCHES = 120  # of a session at the most
_STRETCH_NS = 1_000_000_000  # at the least


def excerpt(study: Study, session: str, loaded: Recording, tracks: Mapping[str, Tracked]) -> pd.DataFrame:
    """The table `excerpts`: the stretch and axis in which the tracker turns most. `raw`, the tracker, is left out."""
    name = study.stream_of_kind("position")
    if name is None or len(loaded.samples[name]) == 0:
        return tables.frame("excerpts", [])
    tracker = loaded.samples[name]
    axis, begin = liveliest(tracker)
    letter = study.axes_of(name)[axis]
    parts = [_cut(begin, "tracker", name, tracker.arrival, tracker.value[:, axis])]
    if loaded.reference is not None:
        of_reference = study.stream_of_kind("reference") or "reference"
        column = study.axes.index(letter)
        parts.append(_cut(begin, "reference", of_reference, loaded.reference.time, loaded.reference.value[:, column]))
    felt = study.stream_of_kind("acceleration")
    if felt is not None:
        samples = within(study, felt, loaded, begin, begin + EXCERPT_S)
        parts.append(
            _cut(begin, "acceleration", felt, samples.time, samples.value[:, study.axes_of(felt).index(letter)])
        )
    of_estimates = study.axes.index(letter)
    for estimator, tracked in tracks.items():
        for shown in tracked.parts() if study.estimators[estimator].type != "raw" else ():
            mean, sd = shown.mean[:, of_estimates], shown.sd[:, of_estimates]
            part = _cut(begin, "estimate", estimator, loaded.to_s(shown.time_ns), mean, sd)
            if len(part):
                parts.append(part)
    return tables.as_table("excerpts", pd.concat(parts).assign(session=session, axis=letter))


def _cut(
    begin: float, kind: str, name: str, time: FloatArray, value: FloatArray, sd: FloatArray | None = None
) -> pd.DataFrame:
    """The part of a signal that is in the stretch."""
    inside = (time >= begin) & (time <= begin + EXCERPT_S)
    spread = np.full(len(time), np.nan) if sd is None else sd
    columns = {"time_s": time[inside], "value": value[inside], "sd": spread[inside]}
    return pd.DataFrame(columns).assign(kind=kind, name=name)


def liveliest(tracker: Samples) -> tuple[int, float]:
    """The axis and the begin (s) of the stretch in which the tracker goes furthest there and back.

    An estimator that lags is seen where the hand turns. Where even the largest turn is small beside the largest range,
    nothing but noise turns, and the stretch with that range is taken.
    """
    most = {"turn": (-1.0, 0, float(tracker.arrival[0])), "range": (-1.0, 0, float(tracker.arrival[0]))}
    last = max(tracker.arrival[-1] - EXCERPT_S, tracker.arrival[0])
    for begin in np.arange(tracker.arrival[0], last + 1e-9, 0.5):
        first = np.searchsorted(tracker.arrival, begin)
        inside = tracker.value[first : np.searchsorted(tracker.arrival, begin + EXCERPT_S, side="right")]
        if len(inside) < 2:
            continue
        for axis, value in enumerate(inside.T):
            for what, size in (("turn", _turn_mm(value)), ("range", float(np.ptp(value)))):
                if size > most[what][0]:
                    most[what] = (size, axis, float(begin))
    _, axis, begin = most["turn" if most["turn"][0] > _TURN_SHARE * most["range"][0] else "range"]
    return axis, begin


def _turn_mm(value: FloatArray) -> float:
    """How far values (n,) in mm go to some point and come back from it, whichever is less; either way round."""
    turns = []
    for signed in (value, -value):
        there = signed - np.minimum.accumulate(signed)
        back = signed - np.minimum.accumulate(signed[::-1])[::-1]
        turns.append(float(np.minimum(there, back).max()))
    return max(turns)


def lead_curves(study: Study, session: str, loaded: Recording, tracks: Mapping[str, Tracked]) -> pd.DataFrame:
    """The table `lead_curves`: each estimator's cross-correlation with the tracker, at leads within ±0.5 s."""
    name = study.tracker
    parts = [tables.frame("lead_curves", [])]
    if name is None or len(loaded.samples[name]) == 0:
        return parts[0]
    tracker = loaded.samples[name]
    for estimator, tracked in tracks.items():
        times, means = Growing(np.float64), Growing(np.float64, len(study.axes))
        for shown in tracked.parts():
            time = loaded.to_s(shown.time_ns)
            settled = run_of(time >= tracker.arrival[0] + SETTLED_S)
            times.add(time[settled])
            means.add(shown.mean[settled])
        tables.give_back(len(times))
        curve = accuracy.lead_curve(times.whole(), means.whole(), tracker)
        if curve is None or not np.max(np.abs(curve[1])) > 0:
            continue
        near = np.abs(curve[0]) <= accuracy.LAG_RANGE_S
        part = pd.DataFrame({"lead_s": curve[0][near], "correlation_mm2": curve[1][near]})
        parts.append(tables.as_table("lead_curves", part.assign(session=session, estimator=estimator)))
    return parts[0] if len(parts) == 1 else pd.concat(parts[1:])


def rates(ingested: Path) -> Iterator[dict[str, Any]]:
    """Rows of `stream_rates`: how many messages of each stream arrived in each stretch of the session."""
    arrivals = _arrivals(ingested)
    if not arrivals:
        return
    first = min(int(arrival[0]) for arrival in arrivals.values())
    last = max(int(arrival[-1]) for arrival in arrivals.values())
    count = int(np.clip((last - first) // _STRETCH_NS, 1, _STRETCHES))
    edges = first + (last + 1 - first) * np.arange(count + 1) // count
    for (session, stream), arrival in arrivals.items():
        stretch = np.searchsorted(edges, arrival, side="right") - 1
        silence = np.zeros(count)
        np.maximum.at(silence, stretch, np.diff(arrival, prepend=first) * S_PER_NS)
        for index, messages in enumerate(np.bincount(stretch, minlength=count)):
            yield {
                "session": session,
                "stream": stream,
                "time_ns": int(edges[index]),
                "duration_s": float(edges[index + 1] - edges[index]) * S_PER_NS,
                "messages": int(messages),
                "gap_max_s": float(silence[index]),
            }


def _arrivals(ingested: Path) -> dict[tuple[str, str], IntArray]:
    """The sorted arrivals of each session's streams in ns, in the order of the tables."""
    found: dict[tuple[str, str], Growing] = {}
    for name in ("positions", "readings", "imu"):
        for part in tables.read_parts(name, ingested, ("session", "stream", "arrival_ns")):
            for stream in pc.unique(part["stream"]).to_pylist():
                own = found.setdefault((part["session"][0].as_py(), stream), Growing(np.int64))
                own.add(tables.matching(part, "stream", stream)["arrival_ns"])
    return {key: np.sort(arrival.whole()) for key, arrival in found.items()}
