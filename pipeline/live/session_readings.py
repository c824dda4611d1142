"""Which readings an attempt takes, with which stamps: those are logged, and update the estimate."""

from __future__ import annotations

import numpy as np

from pipeline.live import lever_arm
from pipeline.live.changes import changed
from pipeline.live.events import NOTHING, Reading, Values, Write
from pipeline.live.session_shown import show
from pipeline.live.session_state import Heard, Session, Stepped, with_heard
from pipeline.live.streams import sample_of
from pipeline.sessions.logs.mcap import Message

_OLDEST_NS = 2_000_000_000
_NUMBERS = 512  # of each stream's newest, by which duplicates are told


def read(state: Session, reading: Reading) -> Stepped:
    """One more reading."""
    stream, heard = state.attempt.streams[reading.stream], state.heard[reading.stream]
    if reading.seq is not None and _came_before(heard, reading.seq):
        return with_heard(state, reading.stream, changed(heard, dropped=heard.dropped + 1)), NOTHING
    arrival = max(reading.arrival_ns, state.clock_ns + 1)
    unstamped = stream.stamps_arrival or reading.stamp_ns is None
    stamp = arrival if unstamped or reading.stamp_ns is None else min(reading.stamp_ns, arrival)
    # What is newer than all before it is the copy of none; looked for, it would be compared with hundreds.
    copy = not unstamped and stamp <= heard.newest_ns and (stamp, reading.values) in heard.recent
    if copy or stamp < heard.newest_ns - _OLDEST_NS:
        return with_heard(state, reading.stream, changed(heard, dropped=heard.dropped + 1)), NOTHING
    used = stream.name in state.attempt.uses
    origin = arrival if state.origin_ns is None else state.origin_ns
    sample = sample_of(stream, stamp, arrival, reading.values, origin) if used else None
    if sample is not None and stream.content == "position":
        sample = lever_arm.less(state, stream, sample, stamp)
    if used and sample is None:  # logged, a replay would use it: carry its orientation on, say
        heard = changed(_numbered(heard, reading.seq), arrival_ns=arrival, dropped=heard.dropped + 1)
        return with_heard(state, reading.stream, heard), NOTHING
    heard = changed(
        _numbered(heard, reading.seq),
        newest_ns=max(heard.newest_ns, stamp),
        arrival_ns=arrival,
        last=reading.values,
        recent=() if unstamped else _recent(heard.recent, stamp, reading.values),
        taken=heard.taken + 1,
    )
    estimated = state.estimated
    if sample is not None:
        estimated = state.attempt.estimator.update(estimated, stream.name, sample)
    all_heard = {**state.heard, reading.stream: heard}
    arms = lever_arm.after(state, stream, stamp, reading.values)
    state = changed(state, heard=all_heard, clock_ns=arrival, origin_ns=origin, estimated=estimated, arms=arms)
    write = Write(Message(stream.topic, stream.content, stamp, arrival, np.array(reading.values)))
    if not stream.is_sensor:
        return state, (write,)
    state, shown = show(state, arrival)
    return state, (write, *shown)


def _came_before(heard: Heard, seq: int) -> bool:
    behind = heard.highest - seq
    return seq > 0 and 0 <= behind < _NUMBERS and bool(heard.numbers >> behind & 1)


def _numbered(heard: Heard, seq: int | None) -> Heard:
    """With one more of the sender's numbers; a gap in them is counted as lost, and taken back if it fills later.

    A number far behind the highest, or 0, is that of a sender that has begun again.
    """
    if seq is None:
        return heard
    ahead = seq - heard.highest
    if heard.highest < 0 or seq == 0 or ahead <= -_NUMBERS:
        return changed(heard, highest=seq, numbers=1)
    if ahead < 0:
        return changed(heard, numbers=heard.numbers | 1 << -ahead, lost=max(heard.lost - 1, 0))
    numbers = (heard.numbers << ahead | 1) & (1 << _NUMBERS) - 1 if ahead < _NUMBERS else 1
    return changed(heard, highest=seq, numbers=numbers, lost=heard.lost + min(ahead - 1, _NUMBERS))


def _recent(recent: tuple[tuple[int, Values], ...], stamp: int, values: Values) -> tuple[tuple[int, Values], ...]:
    if recent and recent[0][0] < stamp - 2 * _OLDEST_NS:  # seldom, and many at once
        recent = tuple(one for one in recent if one[0] >= stamp - _OLDEST_NS)
    return (*recent, (stamp, values))
