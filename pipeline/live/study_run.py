"""A whole study as it is run: who is next, which pages are there, what the operator may do, and what follows from it.

A pure state machine around the one of an attempt (`session`): `step` gives the state after an event and the actions
that follow. The order of a task is: ready → (start) → practice, countdown, running → writing → questionnaire → ready.
What is decided or answered is a record (`plan`), saved before anything else follows from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from pipeline.live import checking, clocks, deeds, desk, forms, health, orientation, panel, presence, session_state
from pipeline.live.changes import changed
from pipeline.live.events import (
    NOTHING,
    Action,
    Actions,
    Agreed,
    ClockOffset,
    Closed,
    Disk,
    Dropped,
    Event,
    Examined,
    Joined,
    Left,
    Link,
    Offered,
    Reading,
    Replace,
    Said,
    Saved,
    Tell,
    Tick,
    WallClock,
    Woke,
    Write,
)
from pipeline.live.messages import (
    Answer,
    Battery,
    Do,
    Drawn,
    Hello,
    Motion,
    Orientation,
    Ping,
    Select,
    Submit,
    Visible,
)
from pipeline.live.orientation import PhoneMotion
from pipeline.live.outgoing import AnswerSaved, Done, PhaseOfTask
from pipeline.live.run_state import Stepped, StudyRun, activate, form, settled, tables, tell_everybody, to_attempt
from pipeline.sessions.logs.mcap import Message

LEAST_FREE_BYTES = 200_000_000
RAW = "/phone/raw"
LIGHTS_NS = 200_000_000
_TRACE_NS = 100_000_000
_TRACES = 60
_NS_PER_MS = 1e6


def step(run: StudyRun, event: Event) -> Stepped:
    """The state after an event, and the actions that follow from it."""
    after, actions = _STEPS[type(event)](run, event)
    if isinstance(event, Reading) or (isinstance(event, Said) and isinstance(event.message, Motion | Orientation)):
        return after, actions
    seen = desk.summary(after)
    if seen == after.seen:
        return after, actions
    after = changed(after, seen=seen)
    return after, (*actions, *(Tell(client, desk.state(after, client)) for client in after.operators))


# --- readings, time


def _reading(run: StudyRun, reading: Reading) -> Stepped:
    name = reading.stream
    if name not in run.health:
        return run, NOTHING
    run, reading, of_clock = clocks.stamped(run, reading)
    state = health.heard(run.health[name], reading.arrival_ns, reading.stamp_ns)
    news: dict[str, object] = {"health": {**run.health, name: state}}
    if name == run.setup.tracker and run.setup.aligner is not None and run.motion.heading is not None:
        stamp = reading.arrival_ns if reading.stamp_ns is None else reading.stamp_ns
        stream = run.setup.streams[name]
        measured = (reading.arrival_ns if stream.stamps_arrival else stamp) - stream.late_ns
        news["motion"] = orientation.seen(run.setup.aligner, run.motion, measured, reading.arrival_ns, reading.values)
    run, reading = _turned(changed(run, **news), reading)
    run = changed(run, watched=checking.kept(run, reading))
    if run.attempt is None:
        return run, NOTHING
    run, actions = to_attempt(run, reading)
    return run, (*of_clock, *actions)


def _turned(run: StudyRun, reading: Reading) -> tuple[StudyRun, Reading]:
    """An acceleration that brings no orientation with the one that is found from the motion, NaN while it is unknown.

    A phone's page has it found already (`_moved`), from what the browser says too.
    """
    setup, values = run.setup, reading.values
    if setup.aligner is None or reading.stream != setup.turned_stream or setup.motion_stream is not None:
        return run, reading
    if math.isfinite(values[9]):
        return (changed(run, motion=PhoneMotion()) if run.finds_orientation else run), reading
    stream = setup.streams[reading.stream]
    stamp = reading.arrival_ns if stream.stamps_arrival or reading.stamp_ns is None else reading.stamp_ns
    motion, found = orientation.turned(
        setup.aligner, run.motion, values[:3], values[3:6], stamp - stream.late_ns, reading.arrival_ns
    )
    return changed(run, motion=motion), reading if found is None else changed(reading, values=found)


def _tick(run: StudyRun, tick: Tick) -> Stepped:
    run, missed = presence.missed(run, tick.at_ns)
    run, actions = to_attempt(run, tick)
    run, examine = checking.examine(run, tick.at_ns)
    actions = (*missed, *actions, *examine)
    if not run.traces or tick.at_ns - run.traces[-1][0] >= _TRACE_NS:
        run = changed(run, traces=(*run.traces[1 - _TRACES :], panel.trace(run, tick.at_ns)))
    if tick.at_ns - run.lights_ns < LIGHTS_NS:
        return run, actions
    run = changed(run, lights_ns=tick.at_ns, drawn=tuple(at for at in run.drawn if tick.at_ns - at < 10**9))
    lights = panel.lights(run, tick.at_ns) if run.operators else None
    return run, (*actions, *(Tell(client, lights) for client in run.operators if lights is not None))


def _disk(run: StudyRun, disk: Disk) -> Stepped:
    run = changed(run, disk=disk)
    if disk.fault is not None and run.attempt is not None:
        return to_attempt(run, session_state.Aborted(f"the log could not be written: {disk.fault}", disk.at_ns))
    return run, NOTHING


def _woke(run: StudyRun, woke: Woke) -> Stepped:
    return to_attempt(run, session_state.Aborted(f"the computer stood still for {woke.seconds:.1f} s", woke.at_ns))


def _linked(run: StudyRun, link: Link) -> Stepped:
    """A sender's connection is lost, or back: its light says so, and the log of a task has a note."""
    others = {name: problem for name, problem in run.links.items() if name != link.stream}
    run = changed(run, links={**others, link.stream: link.problem} if link.problem else others)
    if run.attempt is None or run.attempt.phase == "ended":
        return run, NOTHING
    return to_attempt(run, session_state.Noted(link.problem or f"{link.stream}: connected", link.at_ns, "sender"))


def _closed(run: StudyRun, closed: Closed) -> Stepped:
    run = settled(changed(run, closed=closed))
    return run, (*tables(run), *tell_everybody(run))


# --- what was saved


def _saved(run: StudyRun, saved: Saved) -> Stepped:
    waiting = run.asked.get(saved.token)
    if waiting is None:
        return run, NOTHING
    client, message_id = waiting
    run = changed(run, asked={token: who for token, who in run.asked.items() if token != saved.token})
    message = Done(message_id) if client in run.operators else AnswerSaved(message_id)
    return run, (Tell(client, message),)


# --- pages


def _joined(run: StudyRun, event: Joined) -> Stepped:
    if event.role == "operator":
        return changed(run, operators=(*run.operators, event.client), seen=None), NOTHING
    if event.role == "questionnaire":
        run = changed(run, forms=(*run.forms, event.client))
        return run, (Tell(event.client, form(run)),)
    run = changed(run, phones=(*run.phones, event.client))
    if run.phone is not None:
        return run, (Tell(event.client, PhaseOfTask("second")),)
    return activate(run, event.client, event.at_ns)


def _left(run: StudyRun, event: Left) -> Stepped:
    def without(clients: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(client for client in clients if client != event.client)

    was_active = event.client == run.phone
    asked = {token: who for token, who in run.asked.items() if who[0] != event.client}
    run = changed(run, ids={client: name for client, name in run.ids.items() if client != event.client})
    run = changed(run, phones=without(run.phones), operators=without(run.operators), forms=without(run.forms))
    run = changed(run, asked=asked, seen=None if event.role == "operator" else run.seen)
    if not was_active:
        return run, NOTHING
    run, gone = activate(run, None, event.at_ns)
    if not run.phones:
        return run, gone
    run, back = activate(run, run.phones[-1], event.at_ns)
    return run, (*gone, *back)


def _said(run: StudyRun, event: Said) -> Stepped:
    if event.role == "phone" and event.client != run.phone and not isinstance(event.message, Ping | Hello):
        return run, NOTHING
    back: Actions = NOTHING
    if event.role == "phone" and event.client == run.phone:
        run, back = presence.heard(run, event)
    answer = _ANSWERS.get(type(event.message))
    if answer is None:
        return run, back
    run, actions = answer(run, event, event.message)
    return run, (*back, *actions)


def _drew(run: StudyRun, event: Said, drawn: Drawn) -> Stepped:
    at = clocks.phone_ns(run, drawn.t, event.at_ns)
    run = changed(run, drawn=(*run.drawn[-240:], event.at_ns))
    return to_attempt(run, session_state.PhoneDrew(drawn.n, at, event.at_ns))


def _pressed(run: StudyRun, event: Said, select: Select) -> Stepped:
    at = clocks.phone_ns(run, select.t, event.at_ns)
    if run.attempt is None:
        return checking.tapped(run, (event.at_ns - at) / _NS_PER_MS)
    return to_attempt(run, session_state.PhonePressed(select.n, at, event.at_ns))


def _oriented(run: StudyRun, event: Said, message: Orientation) -> Stepped:
    if run.setup.aligner is None:
        return run, NOTHING
    stamp = clocks.phone_ns(run, message.t, event.at_ns)
    return changed(run, motion=orientation.oriented(run.motion, message, stamp)), NOTHING


def _moved(run: StudyRun, event: Said, message: Motion) -> Stepped:
    """A phone's reading, raw and as it is used."""
    setup, at = run.setup, event.at_ns
    if setup.aligner is None or setup.motion_stream is None:
        return run, NOTHING
    stamp = clocks.phone_ns(run, message.t, at)
    motion, values = orientation.moved(setup.aligner, run.motion, message, stamp, at)
    run, actions = changed(run, motion=motion), list[Action]()
    if run.attempt is not None and run.attempt.phase != "ended":
        q = None if motion.browser is None else motion.browser[1]
        raw = {"t": message.t, "a": message.a, "r": message.r, "q": q, "i": message.interval, "seq": message.seq}
        actions.append(Write(Message(RAW, "anything", stamp, at, event=raw)))
    if values is None:
        return run, tuple(actions)
    run, read = _reading(run, Reading(setup.motion_stream, stamp, at, values, message.seq))
    return run, (*actions, *read)


def _greeted(run: StudyRun, event: Said, hello: Hello) -> Stepped:
    """A page says who it is. A phone that is back takes the place of its own old connection, and of nobody else's."""
    if event.role != "phone":
        return run, NOTHING
    others = [client for client, name in run.ids.items() if hello.id and name == hello.id and client != event.client]
    ids = {client: name for client, name in run.ids.items() if client not in others}
    phones = tuple(client for client in run.phones if client not in others)
    was_active = run.phone in others
    run = changed(run, ids={**ids, event.client: hello.id}, phones=phones)
    actions: Actions = tuple(map(Replace, others))
    if was_active:
        run, activated = activate(run, event.client, event.at_ns)
        actions = (*actions, *activated)
    return (changed(run, hello=hello) if event.client == run.phone else run), actions


_ANSWERS: Mapping[type, Callable[[StudyRun, Said, Any], Stepped]] = {
    Ping: clocks.pinged,
    Motion: _moved,
    Orientation: _oriented,
    Drawn: _drew,
    Select: _pressed,
    Visible: presence.hidden,
    Battery: presence.charged,
    Hello: _greeted,
    Answer: forms.answered,
    Submit: forms.submitted,
    Do: deeds.do,
}
_STEPS: Mapping[type, Callable[[StudyRun, Any], Stepped]] = {
    Reading: _reading,
    Link: _linked,
    ClockOffset: clocks.measured,
    Tick: _tick,
    Said: _said,
    Joined: _joined,
    Left: _left,
    Disk: _disk,
    Saved: _saved,
    Closed: _closed,
    Woke: _woke,
    WallClock: clocks.wall_clock,
    Dropped: lambda run, event: (changed(run, dropped=event), NOTHING),
    Offered: lambda run, event: (changed(run, offers=event.offers), NOTHING),
    Examined: checking.examined,
    Agreed: lambda run, event: (changed(run, agreed=event), NOTHING),
}
