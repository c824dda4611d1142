"""One attempt at one task, from the first reading of its log to the last: what is shown, what counts, what is logged.

A pure state machine: `step` gives the state after an event and the actions that follow from it.

Exactness. Everything that happens gets an instant later than all before it: a reading's arrival, or that of an
estimate, is the loop's time or the last instant + 1 ns, whichever is later. An estimate is made of exactly the
readings that arrived before its instant. A replay of the log asks for the estimates at the same instants, so it gives
the same ones.

Newest wins. A phone has at most `_UNDER_WAY` estimates that it has not drawn yet. While it has, none is made; the
next one is made when the phone has drawn again, from all that is known then. So nothing queues, however slow the
phone is.

What a reading's stamp may be: not after its arrival, and not more than `_OLDEST_NS` before the stream's newest. A
reading that came before, by its number or as an exact copy, is dropped. Dropped readings are counted, not logged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from fusion_core import Estimator
from pipeline.live.changes import changed
from pipeline.live.events import NOTHING, Action, Actions, Close, Reading, Show, Tell, Tick, Values, Write
from pipeline.live.outgoing import PhaseOfTask, Say, Selected, Shown
from pipeline.live.streams import LiveStream, sample_of
from pipeline.sessions.logs.mcap import Message
from pipeline.tables.columns import S_PER_NS

_UNDER_WAY = 2
_REMEMBERED = 64  # estimates: a selection names one of the last
_OLDEST_NS = 2_000_000_000
_NUMBERS = 512  # of each stream's newest, by which duplicates are told
_NEXT_NS = 1_000  # a trial starts this long after the selection before it, which would else belong to both
_SHOW_EVERY_NS = 16_000_000  # where readings are rarer than frames of a screen
_SILENT_NS = 300_000_000
_LOST_NS = 2_000_000_000
_NS_PER_S = 1_000_000_000
_M_PER_MM = 1e-3

NOTES, DRAWN = "/recorder/notes", "/display/drawn"

Phase = Literal["practice", "countdown", "running", "ended"]


@dataclass(frozen=True)
class Attempt:
    """What does not change during an attempt; `uses` are the streams that change what the estimator shows."""

    participant: str
    condition: str
    estimator: Estimator
    uses: frozenset[str]
    streams: Mapping[str, LiveStream]
    axes: Sequence[str]
    targets_mm: Sequence[tuple[float, float]]
    display_topic: str
    events_topic: str
    practice: int
    countdown_ns: int
    abort_after_ns: int
    confirm_ns: int


@dataclass(frozen=True)
class Estimate:
    """What was sent to the phone: its number, the instant it holds for, and the position in mm."""

    n: int
    instant_ns: int
    mean_mm: tuple[float, ...]


@dataclass(frozen=True)
class Heard:
    """What has come of a stream: `recent` are readings by stamp, for copies.

    Bit i of `numbers` says whether the sender's number `highest` − i has come.
    """

    newest_ns: int = 0
    arrival_ns: int = 0
    last: Values = ()
    recent: tuple[tuple[int, Values], ...] = ()
    highest: int = -1
    numbers: int = 0
    taken: int = 0
    dropped: int = 0
    lost: int = 0
    silent: bool = False
    gone: bool = False


@dataclass(frozen=True)
class Session:
    """The state of an attempt.

    `clock_ns` is the newest instant that was given to anything. `waiting` says that there was something new to show
    while the phone could take nothing.
    """

    attempt: Attempt
    phase: Phase
    since_ns: int
    clock_ns: int
    estimated: Any
    phone: int | None
    phone_gone_ns: int | None = None
    origin_ns: int | None = None
    n: int = 0
    sent: tuple[Estimate, ...] = ()
    under_way: tuple[int, ...] = ()
    drawn: int = 0
    shown_ns: int = 0
    waiting: bool = False
    target: int = 0
    begun_ns: int = 0
    trial_ns: int = 0
    last_press_ns: int = 0
    seconds_left: int = 0
    heard: Mapping[str, Heard] = field(default_factory=dict)
    ignored_presses: int = 0
    ended_by: str = ""

    @property
    def trial(self) -> int:
        """The trial's number, from 1."""
        return self.target + 1

    @property
    def selections(self) -> int:
        """How many trials have their selection."""
        return self.target if self.phase in ("running", "ended") else 0


@dataclass(frozen=True)
class PhoneDrew:
    """Estimate `n` is on the screen since `drawn_ns`."""

    n: int
    drawn_ns: int
    at_ns: int


@dataclass(frozen=True)
class PhonePressed:
    """The button was pressed at `pressed_ns` (recorder time), with estimate `n` on the screen."""

    n: int
    pressed_ns: int
    at_ns: int


@dataclass(frozen=True)
class PhoneIs:
    """The phone is this connection now; None: it is gone."""

    client: int | None
    at_ns: int


@dataclass(frozen=True)
class Aborted:
    """Somebody ends the attempt, for a reason."""

    reason: str
    at_ns: int


@dataclass(frozen=True)
class Noted:
    """The operator's note."""

    text: str
    at_ns: int
    kind: str = "note"


Event = Reading | PhoneDrew | PhonePressed | PhoneIs | Aborted | Noted | Tick
Stepped = tuple[Session, Actions]


def begin(attempt: Attempt, phone: int | None, at_ns: int) -> Stepped:
    """The state when the log has just been opened."""
    heard = {name: Heard(arrival_ns=at_ns) for name in attempt.streams}
    state = Session(attempt, "practice", at_ns, at_ns, attempt.estimator.start(), phone, heard=heard)
    if attempt.practice:
        state, actions = _note(state, at_ns, "practice", f"{attempt.practice} targets")
        return state, (*actions, *_tell_phase(state))
    return _count_down(state, at_ns)


def step(state: Session, event: Event) -> Stepped:
    """The state after an event, and what follows from it. Nothing does once the attempt has ended."""
    if state.phase == "ended":
        return state, NOTHING
    stepped: Stepped = _STEPS[type(event)](state, event)
    return stepped


# --- readings


def _read(state: Session, reading: Reading) -> Stepped:
    stream, heard = state.attempt.streams[reading.stream], state.heard[reading.stream]
    if reading.seq is not None and _came_before(heard, reading.seq):
        return _with_heard(state, reading.stream, changed(heard, dropped=heard.dropped + 1)), NOTHING
    arrival = max(reading.arrival_ns, state.clock_ns + 1)
    unstamped = stream.stamps_arrival or reading.stamp_ns is None
    stamp = arrival if unstamped or reading.stamp_ns is None else min(reading.stamp_ns, arrival)
    copy = not unstamped and (stamp, reading.values) in heard.recent
    if copy or stamp < heard.newest_ns - _OLDEST_NS:
        return _with_heard(state, reading.stream, changed(heard, dropped=heard.dropped + 1)), NOTHING
    used = stream.name in state.attempt.uses
    origin = arrival if state.origin_ns is None else state.origin_ns
    sample = sample_of(stream, stamp, arrival, reading.values, origin) if used else None
    if used and sample is None:  # logged, a replay would carry its orientation on and use it
        heard = changed(_numbered(heard, reading.seq), arrival_ns=arrival, dropped=heard.dropped + 1)
        return _with_heard(state, reading.stream, heard), NOTHING
    heard = _numbered(heard, reading.seq)
    heard = changed(
        heard,
        newest_ns=max(heard.newest_ns, stamp),
        arrival_ns=arrival,
        last=reading.values,
        recent=() if unstamped else _recent(heard.recent, stamp, reading.values),
        taken=heard.taken + 1,
    )
    state = changed(_with_heard(state, reading.stream, heard), clock_ns=arrival, origin_ns=origin)
    write = Write(Message(stream.topic, stream.content, stamp, arrival, np.array(reading.values)))
    if sample is not None:
        estimated = state.attempt.estimator.update(state.estimated, stream.name, sample)
        state = changed(state, estimated=estimated)
    if not stream.is_sensor:
        return state, (write,)
    state, shown = _show(state, arrival)
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


def _with_heard(state: Session, name: str, heard: Heard) -> Session:
    return changed(state, heard={**state.heard, name: heard})


# --- what is shown


def _show(state: Session, at_ns: int) -> Stepped:
    """Send the phone an estimate for now, if it can take one and there is one."""
    if state.phone is None or state.origin_ns is None:
        return state, NOTHING
    if len(state.under_way) >= _UNDER_WAY:
        return changed(state, waiting=True), NOTHING
    instant = max(at_ns, state.clock_ns + 1)
    mean, _ = state.attempt.estimator.predict(state.estimated, (instant - state.origin_ns) * S_PER_NS)
    if not np.isfinite(mean).all():
        return state, NOTHING
    estimate = Estimate(state.n + 1, instant, tuple(mean.tolist()))
    state = changed(
        state,
        n=estimate.n,
        clock_ns=instant,
        shown_ns=instant,
        waiting=False,
        sent=(*state.sent[1 - _REMEMBERED :], estimate),
        under_way=(*state.under_way, estimate.n),
    )
    x, y = (estimate.mean_mm[list(state.attempt.axes).index(axis)] for axis in "xy")
    assert state.phone is not None  # noqa: S101
    return state, (Show(state.phone, Shown(estimate.n, x, y, state.trial), instant),)


def _drew(state: Session, event: PhoneDrew) -> Stepped:
    """What was drawn is what was displayed."""
    estimate = _sent(state, event.n)
    if estimate is None or event.n <= state.drawn:
        return state, NOTHING
    state = changed(state, drawn=event.n, under_way=tuple(n for n in state.under_way if n > event.n))
    drawn_ns = min(max(event.drawn_ns, estimate.instant_ns), max(event.at_ns, estimate.instant_ns))
    written = (
        Write(
            Message(state.attempt.display_topic, "position", estimate.instant_ns, drawn_ns, _metres(state, estimate))
        ),
        _json(DRAWN, drawn_ns, {"n": event.n, "drawn_at": drawn_ns}),
    )
    if not state.waiting:
        return state, written
    state, shown = _show(state, event.at_ns)
    return state, (*written, *shown)


def _sent(state: Session, n: int) -> Estimate | None:
    return next((one for one in reversed(state.sent) if one.n == n), None)


def _metres(state: Session, estimate: Estimate) -> Any:
    """The position (3,) in m, 0 on axes that are not analysed."""
    place = dict(zip(state.attempt.axes, estimate.mean_mm, strict=True))
    return np.array([place.get(axis, 0.0) for axis in "xyz"]) * _M_PER_MM


# --- trials


def _pressed(state: Session, event: PhonePressed) -> Stepped:
    estimate = _sent(state, event.n)
    repeated = event.pressed_ns <= state.last_press_ns + state.attempt.confirm_ns
    if estimate is None or repeated or state.phase not in ("practice", "running"):
        return changed(state, ignored_presses=state.ignored_presses + 1), NOTHING
    state = changed(state, last_press_ns=event.pressed_ns)
    if state.phase == "practice":
        return _practised(state, event.at_ns)
    at = min(max(event.pressed_ns, state.trial_ns + 1), max(event.at_ns, state.trial_ns + 1))
    place = dict(zip("xyz", _metres(state, estimate).tolist(), strict=True))
    where = {axis: place[axis] for axis in "xyz" if axis in state.attempt.axes}
    actions: list[Action] = [_event(state, at, type="selection", trial=state.trial, **where)]
    actions += _to_phone(state, Selected(state.trial))
    state = changed(state, target=state.target + 1, trial_ns=at + _NEXT_NS)
    if state.target == len(state.attempt.targets_mm):
        state, ended = _end(state, at + _NEXT_NS, "finished")
        return state, (*actions, *ended)
    actions.append(_trial_start(state))
    return state, (*actions, *_tell_phase(state))


def _practised(state: Session, at_ns: int) -> Stepped:
    state = changed(state, target=state.target + 1)
    if state.target < state.attempt.practice:
        return state, _tell_phase(state)
    return _count_down(changed(state, target=0), at_ns)


def _count_down(state: Session, at_ns: int) -> Stepped:
    left = -(-state.attempt.countdown_ns // _NS_PER_S)
    state = changed(state, phase="countdown", since_ns=at_ns, seconds_left=left)
    return state, _tell_phase(state)


def _start(state: Session, at_ns: int) -> Stepped:
    at = max(at_ns, state.clock_ns + 1)
    state = changed(state, phase="running", since_ns=at, clock_ns=at, begun_ns=at, trial_ns=at, target=0)
    begun = (_event(state, at, type="session_start"), _trial_start(state))
    return state, (*begun, *_tell_phase(state))


def _end(state: Session, at_ns: int, reason: str, *, set_aside: bool = False) -> Stepped:
    actions: list[Action] = []
    if state.begun_ns:
        actions.append(_event(state, max(at_ns, state.trial_ns), type="session_end"))
    _, noted = _note(state, at_ns, "end", reason)
    state = changed(state, phase="ended", ended_by=reason)
    phase = _to_phone(state, PhaseOfTask("waiting" if set_aside else "done"))
    return state, (*actions, *noted, *phase, Close(set_aside))


def _trial_start(state: Session) -> Write:
    x, y = state.attempt.targets_mm[state.target]
    aimed = {"target_x": x * _M_PER_MM, "target_y": y * _M_PER_MM}
    return _event(state, state.trial_ns, type="trial_start", trial=state.trial, **aimed)


def _event(state: Session, at_ns: int, **event: object) -> Write:
    return Write(Message(state.attempt.events_topic, "events", at_ns, at_ns, event=event))


# --- time and faults


def _tick(state: Session, at_ns: int) -> Stepped:
    actions: Actions = NOTHING
    if state.phone_gone_ns is not None and at_ns - state.phone_gone_ns > _LOST_NS:
        return _end(state, at_ns, "the phone was away for over 2 s", set_aside=True)
    if state.phase == "countdown":
        left_ns = state.since_ns + state.attempt.countdown_ns - at_ns
        if left_ns <= 0:
            state, actions = _start(state, at_ns)
        elif -(-left_ns // _NS_PER_S) < state.seconds_left:
            state = changed(state, seconds_left=-(-left_ns // _NS_PER_S))
            actions = _tell_phase(state)
    elif state.phase == "running" and at_ns - state.begun_ns > state.attempt.abort_after_ns:
        return _end(state, at_ns, "out of time")
    state, silence = _listen(state, at_ns)
    if at_ns - state.shown_ns >= _SHOW_EVERY_NS:
        state, shown = _show(state, at_ns)
        return state, (*actions, *silence, *shown)
    return state, (*actions, *silence)


def _listen(state: Session, at_ns: int) -> Stepped:
    """Notes where a sensor that is used falls silent, is lost, or comes back."""
    actions: list[Action] = []
    for name in sorted(state.attempt.uses):
        heard = state.heard[name]
        since = at_ns - heard.arrival_ns
        silent, gone = since > _SILENT_NS, since > _LOST_NS
        if (silent, gone) == (heard.silent, heard.gone):
            continue
        state = _with_heard(state, name, changed(heard, silent=silent, gone=gone))
        kind = "sensor_lost" if gone else "sensor_silent" if silent else "sensor_back"
        actions += _note(state, at_ns, kind, f"{name}, trial {state.trial}")[1]
        if silent != heard.silent:
            actions += _to_phone(state, Say("Please wait.", "wait") if silent else Say(""))
    return state, tuple(actions)


def _phone_is(state: Session, event: PhoneIs) -> Stepped:
    if event.client is None:
        gone = event.at_ns if state.phone_gone_ns is None else state.phone_gone_ns
        state = changed(state, phone=None, phone_gone_ns=gone, under_way=())
        return _note(state, event.at_ns, "phone_away", "")
    heard = {name: changed(one, highest=-1) for name, one in state.heard.items()}  # a page counts from 0 again
    state = changed(state, phone=event.client, phone_gone_ns=None, under_way=(), heard=heard)
    state, noted = _note(state, event.at_ns, "phone_back", "")
    return state, (*noted, *_tell_phase(state))


def _note(state: Session, at_ns: int, kind: str, text: str) -> Stepped:
    return state, (_json(NOTES, at_ns, {"type": kind, "text": text}),)


def _json(topic: str, at_ns: int, content: Mapping[str, object]) -> Write:
    return Write(Message(topic, "anything", at_ns, at_ns, event=content))


def _tell_phase(state: Session) -> Actions:
    seconds = float(state.seconds_left) if state.phase == "countdown" else None
    numbered = state.phase in ("practice", "running")
    phase = PhaseOfTask(
        state.phase,  # type: ignore[arg-type]
        state.trial if numbered else None,
        state.target if numbered else None,
        seconds,
    )
    return _to_phone(state, phase)


def _to_phone(state: Session, message: PhaseOfTask | Selected | Say) -> Actions:
    return () if state.phone is None else (Tell(state.phone, message),)


_STEPS: Mapping[type, Callable[[Session, Any], Stepped]] = {
    Reading: _read,
    PhoneDrew: _drew,
    PhonePressed: _pressed,
    PhoneIs: _phone_is,
    Aborted: lambda state, event: _end(state, event.at_ns, event.reason, set_aside=True),
    Noted: lambda state, event: _note(state, event.at_ns, event.kind, event.text),
    Tick: lambda state, event: _tick(state, event.at_ns),
}
