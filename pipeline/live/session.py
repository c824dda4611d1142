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

from collections.abc import Callable, Mapping
from typing import Any

from pipeline.live.changes import changed
from pipeline.live.events import NOTHING, Action, Actions, Close, Reading, Tick, Write
from pipeline.live.outgoing import PhaseOfTask, Say, Selected
from pipeline.live.session_readings import read
from pipeline.live.session_shown import drew, metres, sent, show
from pipeline.live.session_state import (
    Aborted,
    Attempt,
    Event,
    Heard,
    Noted,
    PhoneDrew,
    PhoneIs,
    PhonePressed,
    Session,
    Stepped,
    with_heard,
)
from pipeline.live.session_words import event_of, note, tell_phase, to_phone

_NEXT_NS = 1_000  # a trial starts this long after the selection before it, which would else belong to both
_SHOW_EVERY_NS = 16_000_000  # where readings are rarer than frames of a screen
_SILENT_NS = 300_000_000
_LOST_NS = 2_000_000_000
_NS_PER_S = 1_000_000_000
_M_PER_MM = 1e-3


def begin(attempt: Attempt, phone: int | None, at_ns: int) -> Stepped:
    """The state when the log has just been opened."""
    heard = {name: Heard(arrival_ns=at_ns) for name in attempt.streams}
    state = Session(attempt, "practice", at_ns, at_ns, attempt.estimator.start(), phone, heard=heard)
    if attempt.practice:
        state, actions = note(state, at_ns, "practice", f"{attempt.practice} targets")
        return state, (*actions, *tell_phase(state))
    return _count_down(state, at_ns)


def step(state: Session, event: Event) -> Stepped:
    """The state after an event, and what follows from it. Nothing does once the attempt has ended."""
    if state.phase == "ended":
        return state, NOTHING
    stepped: Stepped = _STEPS[type(event)](state, event)
    return stepped


# --- trials


def _pressed(state: Session, event: PhonePressed) -> Stepped:
    estimate = sent(state, event.n)
    repeated = event.pressed_ns <= state.last_press_ns + state.attempt.confirm_ns
    if estimate is None or repeated or state.phase not in ("practice", "running"):
        return changed(state, ignored_presses=state.ignored_presses + 1), NOTHING
    state = changed(state, last_press_ns=event.pressed_ns)
    if state.phase == "practice":
        return _practised(state, event.at_ns)
    at = min(max(event.pressed_ns, state.trial_ns + 1), max(event.at_ns, state.trial_ns + 1))
    place = dict(zip("xyz", metres(state, estimate).tolist(), strict=True))
    where = {axis: place[axis] for axis in "xyz" if axis in state.attempt.axes}
    actions: list[Action] = [event_of(state, at, type="selection", trial=state.trial, **where)]
    actions += to_phone(state, Selected(state.trial))
    state = changed(state, target=state.target + 1, trial_ns=at + _NEXT_NS)
    if state.target == len(state.attempt.targets_mm):
        state, ended = _end(state, at + _NEXT_NS, "finished")
        return state, (*actions, *ended)
    actions.append(_trial_start(state))
    return state, (*actions, *tell_phase(state))


def _practised(state: Session, at_ns: int) -> Stepped:
    state = changed(state, target=state.target + 1)
    if state.target < state.attempt.practice:
        return state, tell_phase(state)
    return _count_down(changed(state, target=0), at_ns)


def _count_down(state: Session, at_ns: int) -> Stepped:
    left = -(-state.attempt.countdown_ns // _NS_PER_S)
    state = changed(state, phase="countdown", since_ns=at_ns, seconds_left=left)
    return state, tell_phase(state)


def _start(state: Session, at_ns: int) -> Stepped:
    at = max(at_ns, state.clock_ns + 1)
    state = changed(state, phase="running", since_ns=at, clock_ns=at, begun_ns=at, trial_ns=at, target=0)
    begun = (event_of(state, at, type="session_start"), _trial_start(state))
    return state, (*begun, *tell_phase(state))


def _end(state: Session, at_ns: int, reason: str, *, set_aside: bool = False) -> Stepped:
    actions: list[Action] = []
    if state.begun_ns:
        actions.append(event_of(state, max(at_ns, state.trial_ns), type="session_end"))
    _, noted = note(state, at_ns, "end", reason)
    state = changed(state, phase="ended", ended_by=reason)
    phase = to_phone(state, PhaseOfTask("waiting" if set_aside else "done"))
    return state, (*actions, *noted, *phase, Close(set_aside))


def _trial_start(state: Session) -> Write:
    x, y = state.attempt.targets_mm[state.target]
    aimed = {"target_x": x * _M_PER_MM, "target_y": y * _M_PER_MM}
    return event_of(state, state.trial_ns, type="trial_start", trial=state.trial, **aimed)


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
            actions = tell_phase(state)
    elif state.phase == "running" and at_ns - state.begun_ns > state.attempt.abort_after_ns:
        return _end(state, at_ns, "out of time")
    state, silence = _listen(state, at_ns)
    if at_ns - state.shown_ns >= _SHOW_EVERY_NS:
        state, shown = show(state, at_ns)
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
        state = with_heard(state, name, changed(heard, silent=silent, gone=gone))
        kind = "sensor_lost" if gone else "sensor_silent" if silent else "sensor_back"
        actions += note(state, at_ns, kind, f"{name}, trial {state.trial}")[1]
        if silent != heard.silent:
            actions += to_phone(state, Say("Please wait.", "wait") if silent else Say(""))
    return state, tuple(actions)


def _phone_is(state: Session, event: PhoneIs) -> Stepped:
    if event.client is None:
        since = event.at_ns if event.gone_ns is None else event.gone_ns
        gone = since if state.phone_gone_ns is None else state.phone_gone_ns
        state = changed(state, phone=None, phone_gone_ns=gone, under_way=())
        return note(state, event.at_ns, "phone_away", "")
    heard = {name: changed(one, highest=-1) for name, one in state.heard.items()}  # a page counts from 0 again
    state = changed(state, phone=event.client, phone_gone_ns=None, under_way=(), heard=heard)
    state, noted = note(state, event.at_ns, "phone_back", "")
    return state, (*noted, *tell_phase(state))


_STEPS: Mapping[type, Callable[[Session, Any], Stepped]] = {
    Reading: read,
    PhoneDrew: drew,
    PhonePressed: _pressed,
    PhoneIs: _phone_is,
    Aborted: lambda state, event: _end(state, event.at_ns, event.reason, set_aside=True),
    Noted: lambda state, event: note(state, event.at_ns, event.kind, event.text),
    Tick: lambda state, event: _tick(state, event.at_ns),
}
