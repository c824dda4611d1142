"""Joins the parts of one recording, such as those that a recorder begins anew when a file has grown large.

The parts follow one another in time, so the seams between them are checked: what is missing there would otherwise look
like a sensor's gap, and a copy of a part like a second recording.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import Claims, IntArray, Log, Readings

_S_PER_NS = 1e-9
_SEAM_S = 0.5  # a longer gap between two parts is said; a recorder opens its next file within milliseconds
_OVERLAP_S = 2.0  # recorders write what they have cached into the next file, but not more than about a second of it
_Item = TypeVar("_Item")

Part = tuple[Path, Log]


def joined(parts: Sequence[Part]) -> Log:
    """One log of all parts, in the order of time. SessionError where they overlap or contradict each other."""
    if len(parts) == 1:
        return parts[0][1]
    in_time = sorted(parts, key=lambda part: _span(part[1])[0])
    facts: dict[str, str] = {}
    for path, log in in_time:
        for key, value in log.facts.items():
            if facts.setdefault(key, value) != value:
                people = (facts[key], value) if key == "participant" else ()
                raise SessionError(
                    f'its parts disagree: {key} is "{facts[key]}" and, in {path.name}, "{value}"', people
                )
    keys = dict.fromkeys(key for _, log in in_time for key in log.topics)
    topics = {key: _readings([log.topics[key] for _, log in in_time if key in log.topics]) for key in keys}
    faults = [f"{path.name}: {fault}" for path, log in in_time for fault in log.faults]
    return Log(facts, topics, (*faults, *seams(in_time)), _merged(in_time, lambda log: log.types))


def seams(in_time: Sequence[Part]) -> list[str]:
    """What is missing between parts that have a topic in common. SessionError where two overlap."""
    found = []
    with_messages = [(path.name, log, *_span(log)) for path, log in in_time if _arrivals(log)]
    for (before, one, _, ended_s), (after, other, began_s, _) in pairwise(with_messages):
        if not one.topics.keys() & other.topics.keys():
            continue
        if began_s < ended_s - _OVERLAP_S:
            raise SessionError(
                f"{before} and {after} overlap by {ended_s - began_s:.1f} s, so they are not parts of one recording; "
                "keep the files of one recording in the session, or give each recording its own name"
            )
        if began_s - ended_s > _SEAM_S:
            found.append(f"nothing was recorded for {began_s - ended_s:.1f} s between {before} and {after}")
    return found


def _arrivals(log: Log) -> list[IntArray]:
    return [readings.arrival_ns for readings in log.topics.values() if readings.read]


def _span(log: Log) -> tuple[float, float]:
    """First and last arrival in s; infinite for a log without a message."""
    arrivals = _arrivals(log)
    if not arrivals:
        return float("inf"), float("-inf")
    first, last = min(int(one.min()) for one in arrivals), max(int(one.max()) for one in arrivals)
    return first * _S_PER_NS, last * _S_PER_NS


def _merged(parts: Sequence[Part], of: Callable[[Log], Mapping[str, _Item]]) -> dict[str, _Item]:
    merged: dict[str, _Item] = {}
    for _, log in parts:
        merged |= of(log)
    return merged


def _readings(parts: Sequence[Readings]) -> Readings:
    if len(parts) == 1:
        return parts[0]
    lost = [part.lost for part in parts]
    return Readings(
        np.concatenate([part.stamp_ns for part in parts]),
        np.concatenate([part.arrival_ns for part in parts]),
        np.concatenate([part.values for part in parts]),
        tuple(event for part in parts for event in part.events),
        None if None in lost else sum(one for one in lost if one is not None),
        tuple(note for part in parts for note in part.notes),
        any(part.sampled for part in parts),
        _claims(parts),
    )


def _claims(parts: Sequence[Readings]) -> Claims:
    """Those of all parts; none where one part has none, for they go by the place of each reading."""

    def column(name: str) -> np.ndarray[Any, Any]:
        columns = [getattr(part.claims, name) for part in parts]
        whole = all(len(one) == part.read for one, part in zip(columns, parts, strict=True))
        return np.concatenate(columns) if whole else columns[0][:0]

    names = dict.fromkeys(name for part in parts for name in part.claims.frames)
    numbers = {name: index for index, name in enumerate(names)}
    frames = [
        np.array([numbers[name] for name in part.claims.frames], np.int64)[part.claims.frame]
        for part in parts
        if len(part.claims.frame)
    ]
    whole = sum(map(len, frames)) == sum(part.read for part in parts)
    return Claims(
        tuple(names) if whole else (),
        np.concatenate(frames) if whole and frames else np.zeros(0, np.int64),
        column("orientation_length"),
        column("force_disclaimed"),
        column("gyroscope_disclaimed"),
    )
