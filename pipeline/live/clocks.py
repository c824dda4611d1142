"""The senders' clocks in a running study: what is heard of them, whose time a stamp is, and what the log says of it.

The log has every exchange with the phone, and every offset by which a sender's own time became a stamp, on
`/recorder/clock`. So a sender's own times can be had back: stamp less offset.
"""

from __future__ import annotations

from pipeline.live import clock, session_state
from pipeline.live.changes import changed
from pipeline.live.clock import OneWay
from pipeline.live.events import NOTHING, Actions, ClockOffset, Reading, Said, Tell, WallClock, Write
from pipeline.live.messages import Ping
from pipeline.live.outgoing import Pong
from pipeline.live.run_state import Stepped, StudyRun, to_attempt
from pipeline.live.session_words import record

CLOCK = "/recorder/clock"
_NS_PER_MS = 1e6


def is_recording(run: StudyRun) -> bool:
    """Whether a log is open."""
    return run.attempt is not None and run.attempt.phase != "ended"


def written(at_ns: int, sender: str, **known: object) -> Write:
    """What is known of a sender's clock, for the log."""
    return record(CLOCK, at_ns, {"sender": sender, **known})


def opening(run: StudyRun, at_ns: int) -> Actions:
    """What is known of the senders that are not asked for their time, for a log that has just been opened."""
    known = ((name, one.mapping) for name, one in run.one_way.items())
    return tuple(written(at_ns, name, offset_ms=one.offset_ms) for name, one in known if one is not None)


def stamped(run: StudyRun, reading: Reading) -> tuple[StudyRun, Reading, Actions]:
    """A reading whose sender says when it measured, with that time by the recorder's clock as its stamp."""
    if reading.stamp_ns is not None or reading.sent_ms is None:
        return run, reading, NOTHING
    name, before = reading.stream, run.one_way.get(reading.stream, OneWay())
    known = clock.arrived(before, reading.sent_ms, reading.arrival_ns / _NS_PER_MS)
    run, mapping = changed(run, one_way={**run.one_way, name: known}), known.mapping
    if mapping is None:
        return run, reading, NOTHING
    reading, actions = changed(reading, stamp_ns=mapping.to_ns(reading.sent_ms)), NOTHING
    if is_recording(run) and (before.mapping is None or mapping.offset_ms != before.mapping.offset_ms):
        actions = (written(reading.arrival_ns, name, offset_ms=mapping.offset_ms),)
    if known.steps > before.steps:
        run, noted = _was_set(run, name, reading.arrival_ns)
        actions = (*actions, *noted)
    return run, reading, actions


def _was_set(run: StudyRun, sender: str, at_ns: int) -> Stepped:
    return to_attempt(run, session_state.Noted(f"the clock of {sender} was set", at_ns, "clock_step"))


def measured(run: StudyRun, offset: ClockOffset) -> Stepped:
    """What a sender's clock was measured to be off goes into the log; stamps have it taken off already."""
    if not is_recording(run):
        return run, NOTHING
    return run, (written(offset.at_ns, offset.sender, offset_ms=offset.offset_ms),)


def pinged(run: StudyRun, event: Said, ping: Ping) -> Stepped:
    """A page asks for the time, and says what came of asking before."""
    at_ms = event.at_ns / _NS_PER_MS
    pong = Tell(event.client, Pong(ping.t1, at_ms, at_ms))
    if ping.last is None or event.client != run.phone:
        return run, (pong,)
    known, before = clock.exchanged(run.clock, ping.last), run.clock
    run, mapping = changed(run, clock=known), known.mapping
    if not is_recording(run):
        return run, (pong,)
    fitted = {} if mapping is None else {"offset_ms": mapping.offset_ms, "drift_ppm": mapping.drift * 1e6}
    uncertain = {} if mapping is None else {"uncertainty_ms": mapping.uncertainty_ms}
    actions: Actions = (pong, written(event.at_ns, "phone", **vars(ping.last), **fitted, **uncertain))
    if known.steps > before.steps:
        run, noted = _was_set(run, "the phone", event.at_ns)
        actions = (*actions, *noted)
    return run, actions


def phone_ns(run: StudyRun, t_ms: float, at_ns: int) -> int:
    """The recorder's time of a phone's time stamp; the message's arrival while the phone's clock is unknown."""
    mapping = run.clock.mapping
    return at_ns if mapping is None else min(mapping.to_ns(t_ms), at_ns)


def wall_clock(run: StudyRun, wall: WallClock) -> Stepped:
    """Stamps go on as before, whatever the wall clock does; the log says what it did."""
    if not is_recording(run):
        return run, NOTHING
    write = written(wall.at_ns, "wall clock", offset_ms=wall.off_ms)
    if not wall.was_set:
        return run, (write,)
    text = f"the wall clock is {wall.off_ms:.0f} ms off now"
    run, noted = to_attempt(run, session_state.Noted(text, wall.at_ns, "wall_clock"))
    return run, (write, *noted)
