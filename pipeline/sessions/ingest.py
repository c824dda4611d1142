"""Decodes a log into tables, once. This is the only place that turns SI units into millimetres."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from pipeline.engine.stage import Outcome, Work
from pipeline.errors import PipelineError, SessionError, did_you_mean
from pipeline.sessions.by_parts import let_go, parts_of
from pipeline.sessions.checks import check_rows
from pipeline.sessions.checks.of_log import of_log
from pipeline.sessions.logs import READERS, log_suffix, read_logs
from pipeline.sessions.logs.log import IntArray, Limits, Log, Readings
from pipeline.sessions.stream_quality import clock_went_back, quality_row
from pipeline.sessions.usable import finite, usable, within_a_day
from pipeline.sessions.wanted import of_events, of_stream, wanted_by
from pipeline.study.memory import free_bytes, shortage
from pipeline.study.pseudonyms import SOMEONE_ELSE, Pseudonyms
from pipeline.study.session import Session
from pipeline.study.settings import Study
from pipeline.study.streams import Stream
from pipeline.tables import table as tables
from pipeline.tables.columns import S_PER_NS
from pipeline.tables.table import Row

MM_PER_M = 1000.0
MEMORY_PER_BYTE = 6.0
"""Bytes of memory that a session takes for each of its log, by docs/limits.md."""
MEMORY_PER_BYTE_DECODED = 2.0
"""The same of a log that is decoded while it is read."""
_WHOLE = READERS.keys() - {".mcap", ".db3", ".bag"}  # formats whose file is in memory besides
_NEEDED = ("position", "acceleration", "velocity", "linear")  # without these a session has nothing to fuse
_SAME_CLOCK_S = 3600.0
_TOPICS_MAX = 40  # named in a message
_LATE_S = 0.5  # what an estimator remembers by default


def run(work: Work, with_checks: bool = True) -> Outcome:
    """One session's positions, imu, events, quality and checks; SessionError with the reason if it cannot be used.

    Without checks it takes two thirds of the time, for those who only replay it.
    """
    study, session = work.study, work.session
    _require_memory(session)
    limits = Limits(study.log_limits.unpacked_mib * 2**20, study.log_limits.messages, work.out)
    log = read_logs(session.files, wanted_by(study), limits)
    participant, condition = _participant_and_condition(session, log, study, work.pseudonyms)
    in_part = list(log.faults)
    quality: list[Row] = []
    left_out: list[Row] = []
    found: dict[str, list[tuple[str, Stream, Readings]]] = {"positions": [], "readings": [], "imu": []}
    for name, stream in study.streams.items():
        readings = _stream(log, name, stream, in_part)
        if readings is None:
            continue
        finite, notes = _usable(readings, stream)
        if finite.read == 0:
            fault = f'stream "{name}": topic {stream.topic} holds no usable sample: {"; ".join(notes)}'
            if stream.kind in _NEEDED:
                raise SessionError(fault)
            in_part.append(fault)
        quality.append(quality_row(session.id, name, readings, notes))
        if finite.read < readings.read:
            left_out.append(quality[-1])
        table = {"acceleration": "imu", "velocity": "readings", "linear": "readings"}.get(stream.kind, "positions")
        found[table].append((name, stream, finite))
    events, row, repeated = _events(log, study, session.id, in_part)
    if row is not None:
        quality.append(row)
        if repeated:
            left_out.append(row)
    for table, streams in found.items():
        if streams:
            parts = (part for named in streams for part in _parts(session.id, *named))
            tables.write_parts(table, parts, work.out)
    rows = sum(readings.read for streams in found.values() for *_, readings in streams)
    del found
    tables.give_back(rows)
    tables.write("events", events, work.out)
    tables.write("quality", tables.of_rows("quality", quality), work.out)
    if with_checks:
        tables.write("checks", tables.of_rows("checks", check_rows(session.id, of_log(log, study))), work.out)
    ids = {"participant": participant, "condition": condition, "session": session.id}
    reasons = [f"{row['stream']}: {row['note']}" for row in left_out]
    listed = [{**ids, "what": "samples left out", "reason": reason} for reason in reasons]
    tables.write("exclusions", tables.of_rows("exclusions", listed), work.out)
    if "order" in log.facts:
        order = {"session": session.id, "order": log.facts["order"]}
        tables.write("session_orders", tables.of_rows("session_orders", [order]), work.out)
    if "recorder" in log.facts:
        recorder = _recorder(session.id, log.facts, work.pseudonyms)
        tables.write("recorders", tables.of_rows("recorders", [recorder]), work.out)
    in_part += [f"{row['stream']}: {row['messages_lost']} messages lost" for row in quality if row["messages_lost"]]
    return Outcome(in_part="; ".join(in_part) or None, participant=participant, condition=condition)


def _require_memory(session: Session) -> None:
    """Raise PipelineError, and not SessionError, which would stand in the cache when there is room for the log."""
    size = sum(file.stat().st_size for file in session.files)
    whole = any(log_suffix(file) in _WHOLE for file in session.files)
    lacking = shortage(size, MEMORY_PER_BYTE if whole else MEMORY_PER_BYTE_DECODED, free_bytes())
    if lacking is not None:
        raise PipelineError(f"session {session.id}: {lacking}")


def _recorder(session: str, facts: Mapping[str, str], pseudonyms: Pseudonyms | None) -> Row:
    """What a log that was recorded live says of that."""
    if pseudonyms is not None:  # the operator's reasons are their own words
        facts = {key: pseudonyms.in_text(text) for key, text in facts.items()}
    return {
        "session": session,
        "recorder": facts["recorder"],
        "settings": facts.get("study_digest"),
        "attempt": facts.get("attempt"),
        "started_although": facts.get("started_although"),
        "overruled": facts.get("overruled"),
    }


def _participant_and_condition(
    session: Session, log: Log, study: Study, pseudonyms: Pseudonyms | None
) -> tuple[str, str]:
    """Participant and condition, by the file's name and the log's metadata, which must agree.

    Raises SessionError where they do not, or where neither says.
    """
    ids: dict[str, str] = {}
    for what, by_name in (("participant", session.participant), ("condition", session.condition)):
        fact = log.facts.get(what)
        by_fact = unicodedata.normalize("NFC", fact) if fact else None
        if by_fact and what == "participant" and pseudonyms is not None:
            by_fact = pseudonyms.participants.get(by_fact, SOMEONE_ELSE)
        if by_name and by_fact and by_name != by_fact:
            raise SessionError(f'its name says {what} "{by_name}", its metadata "{by_fact}"; correct one of them')
        known = by_name or by_fact
        if not known:
            raise SessionError(f"neither its name nor its metadata says which {what} it is")
        ids[what] = known
    if ids["condition"] not in study.conditions:
        hint = did_you_mean(ids["condition"], study.conditions)
        raise SessionError(f'condition "{ids["condition"]}" is not in study.yaml{hint}')
    return ids["participant"], ids["condition"]


def _stream(log: Log, name: str, stream: Stream, in_part: list[str]) -> Readings | None:
    """The stream's readings; None for a stream that cannot be used, with the reason in `in_part`.

    Raises SessionError where a sensor is missing, empty or unreadable, or its clock was set back.
    """
    readings = log.topics.get(of_stream(stream).key)
    fault = None
    if readings is None:
        fault = f'stream "{name}": topic {stream.topic} is not in the log{_nearest(stream.topic, log)}'
    elif readings.read == 0:
        why = f": {'; '.join(readings.notes)}" if readings.notes else ""
        fault = f'stream "{name}": topic {stream.topic} holds no samples{why}'
    else:
        back = clock_went_back(readings)
        if back is not None:
            fault = (
                f'stream "{name}": the clock went backwards by {back:.3f} s, so the times of its messages are unknown'
            )
    if fault is None:
        return readings
    if stream.kind in _NEEDED:
        raise SessionError("; ".join([fault, *log.faults]))
    in_part.append(fault)
    return None


def _nearest(topic: str, log: Log) -> str:
    """The end of an error: the topic of the log that was probably meant, and all topics that it has."""
    names = sorted(log.types or log.topics)
    if not names:
        return "; it has no topic at all"
    more = f", and {len(names) - _TOPICS_MAX} more" if len(names) > _TOPICS_MAX else ""
    there = f" (there: {', '.join(names[:_TOPICS_MAX])}{more})"
    meant = did_you_mean(topic, names)
    return (meant if "did you mean" in meant else "") + there


def _usable(readings: Readings, stream: Stream) -> tuple[Readings, list[str]]:
    """The readings that are finite and of the same day as the others, and notes about those left out or late."""
    width = 3 if stream.kind != "acceleration" else 6
    known = finite(readings.values, width)
    notes = [] if known.all() else [f"{int((~known).sum())} samples left out: NaN or infinite"]
    in_time = np.ones(readings.read, bool)
    for times in (readings.stamp_ns, readings.arrival_ns):
        in_time &= within_a_day(times)
    if not in_time.all():
        notes.append(f"{int((~in_time).sum())} samples left out: their time is more than a day off")
    late_s = float(np.median(readings.arrival_ns - readings.stamp_ns)) * S_PER_NS
    if stream.kind in _NEEDED and abs(late_s) > _SAME_CLOCK_S:
        raise SessionError(f"topic {stream.topic}: {_of_two_clocks(readings, late_s)}")
    keep = known & in_time
    delay_s = (readings.arrival_ns - readings.stamp_ns)[keep] * S_PER_NS
    delay_s += stream.latency_s if stream.stamped_on_arrival else 0.0
    if np.any(delay_s > _LATE_S):
        notes.append(
            f"{int((delay_s > _LATE_S).sum())} samples arrive over {_LATE_S:g} s late, and may come too late to fuse"
        )
    if stream.kind == "acceleration" and keep.any():
        unknown = 0
        for part in parts_of(len(keep)):
            unknown += int(np.isnan(readings.values[part, 6][keep[part]]).sum())
            let_go(readings.values)
        if unknown:
            notes.append(f"{unknown} samples without an orientation in the log")
    return usable(readings, keep), notes


def _of_two_clocks(readings: Readings, late_s: float) -> str:
    """What is wrong with stamps far from the arrivals, and what can be written in study.yaml."""
    if not readings.stamp_ns.any():
        return "every stamp is zero: the sender does not stamp; write `stamp: log_time` to take the times of arrival"
    return (
        f"stamps and arrivals are {abs(late_s):.0f} s apart, so they are not of one clock; if the stamps of all "
        "streams are of one (a simulation's, say), write `arrival: stamps` in each to leave the times of arrival aside"
    )


def _parts(session: str, name: str, stream: Stream, readings: Readings) -> Iterator[pa.Table]:
    """A stream's rows of its table, in order of arrival, in millimetres, some at a time."""
    order = np.lexsort((readings.stamp_ns, readings.arrival_ns))
    for begin in range(0, max(len(order), 1), tables.ROWS_AT_ONCE):
        yield _part(session, name, stream, readings, order[begin : begin + tables.ROWS_AT_ONCE])
        let_go(readings.values)


def _part(session: str, name: str, stream: Stream, readings: Readings, which: IntArray) -> pa.Table:
    columns: dict[str, Any] = {
        "session": session,
        "stream": name,
        "time_ns": readings.stamp_ns[which],
        "arrival_ns": readings.arrival_ns[which],
    }
    values = np.ascontiguousarray(readings.values[which].T)
    own = stream.kind in ("velocity", "linear")
    for index, axis in enumerate("xyz"):
        column = f"a{axis}_mm_s2" if stream.kind == "acceleration" else axis if own else f"{axis}_mm"
        columns[column] = values[index] * MM_PER_M
    if stream.kind == "acceleration":
        columns |= {f"g{axis}_rad_s": values[3 + index] for index, axis in enumerate("xyz")}
        columns |= {f"q{axis}": values[6 + index] for index, axis in enumerate("xyzw")}
        return tables.of_columns("imu", len(which), columns)
    return tables.of_columns("readings" if own else "positions", len(which), columns)


def _events(log: Log, study: Study, session: str, in_part: list[str]) -> tuple[pa.Table, Row | None, int]:
    """The session's events by arrival, each once; their row of `quality`; and how many were repetitions."""
    nothing = tables.of_rows("events", [])
    if study.events is None:
        return nothing, None, 0
    readings = log.topics.get(of_events(study.events).key)
    if readings is None or (readings.read == 0 and not readings.notes):
        in_part.append(f"events: topic {study.events.topic} holds none")
        return nothing, None, 0
    if readings.read == 0:
        in_part.append(f"events: {'; '.join(readings.notes)}")
    order = np.argsort(readings.arrival_ns, kind="stable")
    rows = [_event(session, int(readings.arrival_ns[at]), readings.events[at]) for at in order]
    once = list({tuple(row.values()): row for row in rows}.values())
    repeated = len(rows) - len(once)
    notes = [f"{repeated} repeated events left out"] if repeated else []
    return tables.of_rows("events", once), quality_row(session, "events", readings, notes), repeated


def _event(session: str, time_ns: int, event: Mapping[str, Any]) -> Row:
    row: Row = {"session": session, "time_ns": time_ns, "type": event["type"]}
    trial: Any = event.get("trial")
    row["trial"] = None if trial is None else int(trial)
    for axis in "xyz":
        for key, column in ((f"target_{axis}", f"target_{axis}_mm"), (axis, f"{axis}_mm")):
            value = event.get(key)
            row[column] = value * MM_PER_M if isinstance(value, float) and np.isfinite(value) else None
    return row
