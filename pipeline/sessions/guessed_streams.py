"""What a study's logs hold, by a few of them: streams as study.yaml would have them, and what their events can give."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from pipeline.errors import SessionError
from pipeline.sessions.checks.agreement import LAG, LAG_UNKNOWN
from pipeline.sessions.inspection import Inspection, inspected
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Wanted


@dataclass(frozen=True)
class StreamsGuess:
    """Streams and events as in study.yaml, with a remark on each stream for the reader, and what the checks say.

    `event_types` are those that occur, `looked_at` and `unread` how many logs were read and which could not be,
    `condition_facts` the conditions that the logs themselves name, `gravity_guessed` streams whose gravity is a guess.
    """

    streams: Mapping[str, Mapping[str, Any]]
    remarks: Mapping[str, str]
    events: str | None
    event_types: frozenset[str]
    contradictions: tuple[str, ...]
    condition_facts: tuple[str, ...]
    gravity_guessed: frozenset[str]
    looked_at: int
    unread: tuple[str, ...]


def guess_streams(
    logs: Sequence[Path],
    begin: Callable[[int], None] = lambda total: None,
    done: Callable[[], None] = lambda: None,
) -> StreamsGuess | None:
    """The streams of the first log that has any, with noise and latency as the median over all; None if none has.

    `begin` is called with the number of logs, `done` after each.
    """
    begin(len(logs))
    inspections: list[Inspection] = []
    facts: list[str] = []
    unread: list[str] = []
    for path in logs:
        try:
            counted = read_log(path, [])
            inspection = inspected(path, counted)
        except SessionError as error:
            unread.append(f"{path.name}: {error}")
            continue
        finally:
            done()
        inspections.append(inspection)
        facts += [counted.facts["condition"]] if "condition" in counted.facts else []
    usable = [one for one in inspections if one.usable]
    if not usable:
        return None
    first = usable[0]
    streams = {name: dict(stream) for name, stream in first.streams.items()}
    for name, stream in streams.items():
        for key in ("noise_sd_mm", "latency_s"):
            values = [one.streams[name][key] for one in usable if key in one.streams.get(name, {})]
            if key in stream:
                stream[key] = float(f"{median(values):.2g}")
    rates = {topic.name: topic.rate_hz for topic in first.topics}
    return StreamsGuess(
        streams,
        {
            name: _remark(stream, rates.get(stream["topic"]), name in first.guessed, _lag_is_known(usable))
            for name, stream in streams.items()
        },
        first.events,
        _event_types(logs[inspections.index(first)], first.events),
        tuple(f"{finding.check}: {finding.message}" for finding in first.findings if finding.status == "red"),
        tuple(dict.fromkeys(facts)),
        first.guessed,
        len(inspections),
        tuple(unread),
    )


def _event_types(path: Path, topic: str | None) -> frozenset[str]:
    if topic is None:
        return frozenset()
    events = read_log(path, [Wanted(topic, "events")]).topics[topic].events
    return frozenset(str(event.get("type")) for event in events)


def _lag_is_known(inspections: Sequence[Inspection]) -> bool:
    """Is it seen, in one log at least, by how much the tracker's stamps are late?"""
    return any(finding.check == LAG and finding.found != LAG_UNKNOWN for one in inspections for finding in one.findings)


def _remark(stream: Mapping[str, Any], rate_hz: float | None, gravity_is_a_guess: bool, lag_is_known: bool) -> str:
    """What a stream is and how its figures were found, in a few words."""
    what = {
        "position": "the tracker",
        "acceleration": "the phone's accelerometer and gyroscope",
        "reference": "the truth, by the topic's name; make it position if it is a tracker",
        "display": "what was displayed, by the topic's name",
    }[stream["kind"]]
    parts = [what if rate_hz is None else f"{what}, {rate_hz:.0f} Hz"]
    if stream.get("latency_s"):
        parts.append("it stamps on delivery, later than the phone by their common movement")
    elif stream["kind"] == "position" and not lag_is_known:
        parts.append("if it stamps on delivery, say stamp: arrival and latency_s, which these logs do not show")
    if "noise_sd_mm" in stream:
        parts.append("noise as measured")
    if gravity_is_a_guess:
        parts.append("gravity is a guess, for no orientation is logged: give it in the tracker's axes")
    return "; ".join(parts)
