"""A whole study as it is run: who is next, which pages are there, what the operator may do, and what follows from it.

A pure state machine around the one of an attempt (`session`): `step` gives the state after an event and the actions
that follow. The order of a task is: ready → (start) → practice, countdown, running → writing → questionnaire → ready.
What is decided or answered is a record (`plan`), saved before anything else follows from it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pipeline.live import clock, desk, health, orientation, plan, session
from pipeline.live.changes import changed
from pipeline.live.clock import Clock, OneWay
from pipeline.live.events import (
    NOTHING,
    Action,
    Actions,
    Agreed,
    Close,
    Closed,
    Disk,
    Event,
    Joined,
    Left,
    Open,
    Reading,
    Resolve,
    Said,
    Save,
    Saved,
    Tables,
    Tell,
    Tick,
    WallClock,
    Woke,
    Write,
)
from pipeline.live.health import Health
from pipeline.live.messages import Answer, Do, Drawn, Hello, Motion, Orientation, Ping, Select, Submit
from pipeline.live.orientation import PhoneMotion
from pipeline.live.outgoing import AnswerSaved, Done, Form, FormState, PhaseOfTask, Pong, Refused
from pipeline.live.plan import Person, Plan, Record
from pipeline.live.session import Session
from pipeline.live.setup import Setup
from pipeline.sessions.logs.mcap import Message

LEAST_FREE_BYTES = 200_000_000
CLOCK, RAW = "/recorder/clock", "/phone/raw"
_LIGHTS_NS = 200_000_000
_TRACE_NS = 100_000_000
_TRACES = 60
_NS_PER_MS = 1e6

Phase = Literal["ready", "session", "writing", "questionnaire", "cut"]


@dataclass(frozen=True)
class StudyRun:
    """The state of a study that is run.

    `phone` is the connection of the active phone, `phones` all of them, `operators` those of operator's pages, the one
    that may act first. `asked` remembers what is being saved, by token: whom to tell, and how.
    """

    setup: Setup
    plan: Plan
    phase: Phase = "ready"
    attempt: Session | None = None
    phones: tuple[int, ...] = ()
    phone: int | None = None
    operators: tuple[int, ...] = ()
    forms: tuple[int, ...] = ()
    hello: Hello | None = None
    clock: Clock = field(default_factory=Clock)
    motion: PhoneMotion = field(default_factory=PhoneMotion)
    one_way: Mapping[str, OneWay] = field(default_factory=dict)
    health: Mapping[str, Health] = field(default_factory=dict)
    disk: Disk | None = None
    asked: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    tokens: int = 0
    closed: Closed | None = None
    agreed: Agreed | None = None
    traces: tuple[tuple[int, float | None, float | None], ...] = ()
    lights_ns: int = 0
    drawn: tuple[int, ...] = ()
    seen: object = None

    @property
    def now(self) -> tuple[Person, int] | None:
        """The participant and the index of the task that is under way or next."""
        return plan.current(self.plan)


Stepped = tuple[StudyRun, Actions]


def begin(setup: Setup, known: Plan) -> StudyRun:
    """The state at the start, from what the folder and its records say."""
    if plan.current(known) is None:
        known = plan.with_next_person(known)
    streams = {name: Health() for name in setup.streams}
    return _settled(StudyRun(setup, known, health=streams))


def _settled(run: StudyRun) -> StudyRun:
    """In the phase that the plan says, when no attempt is under way."""
    if plan.current(run.plan) is None:
        run = changed(run, plan=plan.with_next_person(run.plan))
    now = run.now
    assert now is not None  # noqa: S101 - there is always somebody next
    task = now[0].tasks[now[1]]
    phase: Phase = "cut" if task.state == "cut" else "questionnaire" if task.state == "done" else "ready"
    return changed(run, phase=phase, attempt=None)


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
    if reading.stamp_ns is None and reading.sent_ms is not None:
        known = clock.arrived(run.one_way.get(name, OneWay()), reading.sent_ms, reading.arrival_ns / _NS_PER_MS)
        mapping = known.mapping
        stamp = None if mapping is None else mapping.to_ns(reading.sent_ms)
        run, reading = changed(run, one_way={**run.one_way, name: known}), changed(reading, stamp_ns=stamp)
    state = health.heard(run.health[name], reading.arrival_ns, reading.stamp_ns)
    run = changed(run, health={**run.health, name: state})
    if name == run.setup.study.tracker and run.setup.aligner is not None and run.motion.heading is not None:
        stamp = reading.arrival_ns if reading.stamp_ns is None else reading.stamp_ns
        stream = run.setup.streams[name]
        measured = (reading.arrival_ns if stream.stamps_arrival else stamp) - stream.late_ns
        seen = orientation.seen(run.setup.aligner, run.motion, measured, reading.arrival_ns, reading.values)
        run = changed(run, motion=seen)
    return _to_attempt(run, reading) if run.attempt is not None else (run, NOTHING)


def _tick(run: StudyRun, tick: Tick) -> Stepped:
    run, actions = _to_attempt(run, tick)
    if not run.traces or tick.at_ns - run.traces[-1][0] >= _TRACE_NS:
        run = changed(run, traces=(*run.traces[1 - _TRACES :], desk.trace(run, tick.at_ns)))
    if tick.at_ns - run.lights_ns < _LIGHTS_NS:
        return run, actions
    run = changed(run, lights_ns=tick.at_ns, drawn=tuple(at for at in run.drawn if tick.at_ns - at < 10**9))
    lights = desk.lights(run, tick.at_ns) if run.operators else None
    return run, (*actions, *(Tell(client, lights) for client in run.operators if lights is not None))


def _to_attempt(run: StudyRun, event: session.Event) -> Stepped:
    """Hand an event to the attempt, and go on where it ends."""
    if run.attempt is None or run.attempt.phase == "ended":
        return run, NOTHING
    attempt, actions = session.step(run.attempt, event)
    run = changed(run, attempt=attempt)
    if attempt.phase != "ended":
        return run, actions
    set_aside = any(isinstance(action, Close) and action.set_aside for action in actions)
    ended: dict[str, object] = {"type": "set_aside" if set_aside else "finished", "reason": attempt.ended_by}
    run, saved = _save(run, {**_ids(attempt), **ended, "trials": attempt.selections})
    return changed(run, phase="writing"), (*actions, *saved)


def _ids(attempt: Session) -> dict[str, object]:
    return {"participant": attempt.attempt.participant, "condition": attempt.attempt.condition}


def _disk(run: StudyRun, disk: Disk) -> Stepped:
    run = changed(run, disk=disk)
    if disk.fault is not None and run.attempt is not None:
        return _to_attempt(run, session.Aborted(f"the log could not be written: {disk.fault}", disk.at_ns))
    return run, NOTHING


def _woke(run: StudyRun, woke: Woke) -> Stepped:
    return _to_attempt(run, session.Aborted(f"the computer stood still for {woke.seconds:.1f} s", woke.at_ns))


def _wall_clock(run: StudyRun, wall: WallClock) -> Stepped:
    """Stamps go on as before, whatever the wall clock does; the log says what it did."""
    if run.attempt is None or run.attempt.phase == "ended":
        return run, NOTHING
    content = {"sender": "wall clock", "offset_ms": wall.off_ms}
    write = Write(Message(CLOCK, "anything", wall.at_ns, wall.at_ns, event=content))
    if not wall.was_set:
        return run, (write,)
    run, noted = _to_attempt(
        run, session.Noted(f"the wall clock is {wall.off_ms:.0f} ms off now", wall.at_ns, "wall_clock")
    )
    return run, (write, *noted)


def _closed(run: StudyRun, closed: Closed) -> Stepped:
    run = _settled(changed(run, closed=closed))
    return run, (*_tables(run), *_tell_everybody(run))


# --- records


def _save(run: StudyRun, record: Record, client: int | None = None, message_id: str = "") -> Stepped:
    """Make a record part of the plan and of the file; who asked for it is told when it is on disk."""
    token = str(run.tokens + 1)
    asked = run.asked if client is None else {**run.asked, token: (client, message_id)}
    run = changed(run, tokens=run.tokens + 1, asked=asked, plan=plan.after(run.plan, record))
    return run, (Save(record, token),)


def _saved(run: StudyRun, saved: Saved) -> Stepped:
    waiting = run.asked.get(saved.token)
    if waiting is None:
        return run, NOTHING
    client, message_id = waiting
    run = changed(run, asked={token: who for token, who in run.asked.items() if token != saved.token})
    message = Done(message_id) if client in run.operators else AnswerSaved(message_id)
    return run, (Tell(client, message),)


def _tables(run: StudyRun) -> Actions:
    return (Tables(plan.participant_rows(run.plan), plan.rating_rows(run.plan)),)


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
    return _activate(run, event.client, event.at_ns)


def _activate(run: StudyRun, client: int | None, at_ns: int) -> Stepped:
    """Make a phone the active one, or none. Its clock is learned anew: it may be another phone."""
    run = changed(run, phone=client, clock=Clock(), motion=PhoneMotion(), hello=None)
    run, actions = _to_attempt(run, session.PhoneIs(client, at_ns))
    if client is None:
        return run, actions
    return run, (Tell(client, run.setup.welcome(_task_number(run))), *_phone_phase(run), *actions)


def _phone_phase(run: StudyRun) -> Actions:
    """What the phone shows while no attempt is under way."""
    if run.phone is None or (run.attempt is not None and run.attempt.phase != "ended"):
        return NOTHING
    return (Tell(run.phone, PhaseOfTask("done" if run.phase in ("writing", "questionnaire") else "waiting")),)


def _task_number(run: StudyRun) -> int:
    now = run.now
    return 1 if now is None else now[1] + 1


def _left(run: StudyRun, event: Left) -> Stepped:
    def without(clients: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(client for client in clients if client != event.client)

    was_active = event.client == run.phone
    asked = {token: who for token, who in run.asked.items() if who[0] != event.client}
    run = changed(run, phones=without(run.phones), operators=without(run.operators), forms=without(run.forms))
    run = changed(run, asked=asked, seen=None if event.role == "operator" else run.seen)
    if not was_active:
        return run, NOTHING
    run, gone = _activate(run, None, event.at_ns)
    if not run.phones:
        return run, gone
    run, back = _activate(run, run.phones[-1], event.at_ns)
    return run, (*gone, *back)


def _said(run: StudyRun, event: Said) -> Stepped:
    if event.role == "phone" and event.client != run.phone and not isinstance(event.message, Ping):
        return run, NOTHING
    answer = _ANSWERS.get(type(event.message))
    return (run, NOTHING) if answer is None else answer(run, event, event.message)


def _pinged(run: StudyRun, event: Said, ping: Ping) -> Stepped:
    at_ms = event.at_ns / _NS_PER_MS
    pong = Tell(event.client, Pong(ping.t1, at_ms, at_ms))
    if ping.last is None or event.client != run.phone:
        return run, (pong,)
    known, before = clock.exchanged(run.clock, ping.last), run.clock
    run = changed(run, clock=known)
    actions: list[Action] = [pong]
    if run.attempt is not None and run.attempt.phase != "ended":
        mapping = known.mapping
        fitted = {} if mapping is None else {"offset_ms": mapping.offset_ms, "drift_ppm": mapping.drift * 1e6}
        uncertain = {} if mapping is None else {"uncertainty_ms": mapping.uncertainty_ms}
        content = {"sender": "phone", **vars(ping.last), **fitted, **uncertain}
        actions.append(Write(Message(CLOCK, "anything", event.at_ns, event.at_ns, event=content)))
        if known.steps > before.steps:
            run, noted = _to_attempt(run, session.Noted("the phone's clock was set", event.at_ns, "clock_step"))
            actions += noted
    return run, tuple(actions)


def phone_ns(run: StudyRun, t_ms: float, at_ns: int) -> int:
    """The recorder's time of a phone's time stamp; the message's arrival while the phone's clock is unknown."""
    mapping = run.clock.mapping
    return at_ns if mapping is None else min(mapping.to_ns(t_ms), at_ns)


def _drew(run: StudyRun, event: Said, drawn: Drawn) -> Stepped:
    at = phone_ns(run, drawn.t, event.at_ns)
    run = changed(run, drawn=(*run.drawn[-240:], event.at_ns))
    return _to_attempt(run, session.PhoneDrew(drawn.n, at, event.at_ns))


def _pressed(run: StudyRun, event: Said, select: Select) -> Stepped:
    at = phone_ns(run, select.t, event.at_ns)
    return _to_attempt(run, session.PhonePressed(select.n, at, event.at_ns))


def _oriented(run: StudyRun, event: Said, message: Orientation) -> Stepped:
    if run.setup.aligner is None:
        return run, NOTHING
    stamp = phone_ns(run, message.t, event.at_ns)
    return changed(run, motion=orientation.oriented(run.motion, message, stamp)), NOTHING


def _moved(run: StudyRun, event: Said, message: Motion) -> Stepped:
    """A phone's reading, raw and as it is used."""
    setup, at = run.setup, event.at_ns
    if setup.aligner is None or setup.motion_stream is None:
        return run, NOTHING
    stamp = phone_ns(run, message.t, at)
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
    return (changed(run, hello=hello), NOTHING) if event.client == run.phone else (run, NOTHING)


# --- questionnaires


def form(run: StudyRun) -> Form | FormState:
    """What a questionnaire's page shows now."""
    now = run.now
    if now is None or run.phase != "questionnaire":
        return FormState("waiting" if now is not None and now[1] == 0 else "thanks")
    person, index = now
    name = plan.open_questionnaire(run.plan, person.tasks[index])
    known = next((one for one in run.setup.recording.questionnaires if one.id == name), None)
    if known is None:
        return FormState("waiting")
    answers, own = person.tasks[index].answers, known.id not in desk.BUILT_IN
    items = [
        {
            "id": item.id,
            "text": item.text if own else None,
            "low": item.low if own else None,
            "high": item.high if own else None,
            "steps": item.steps,
            "value": answers.get((known.id, item.id)),
        }
        for item in known.items
    ]
    ids = [one.id for one in run.setup.recording.questionnaires]
    return Form(
        known.id, f"Task {index + 1}", known.title if own else None, items, [], ids.index(known.id) + 1, len(ids)
    )


def _answered(run: StudyRun, event: Said, answer: Answer) -> Stepped:
    now = run.now
    known = next((one for one in run.setup.recording.questionnaires if one.id == answer.questionnaire), None)
    item = None if known is None else next((one for one in known.items if one.id == answer.item), None)
    if now is None or run.phase != "questionnaire" or known is None or item is None or answer.value > item.steps:
        return run, (Tell(event.client, Refused(answer.id, "This questionnaire is not open.")),)
    person, index = now
    if plan.open_questionnaire(run.plan, person.tasks[index]) != known.id:
        return run, (Tell(event.client, Refused(answer.id, "This questionnaire is not open.")),)
    record = {
        "type": "answer",
        "participant": person.id,
        "condition": person.tasks[index].condition,
        "questionnaire": known.id,
        "item": item.id,
        "value": answer.value,
        "at_ns": event.at_ns,
    }
    return _save(run, record, event.client, answer.id)


def _submitted(run: StudyRun, event: Said, submit: Submit) -> Stepped:
    now = run.now
    if now is None or run.phase != "questionnaire":
        return run, (Tell(event.client, AnswerSaved(submit.id)),)
    person, index = now
    task = person.tasks[index]
    if plan.open_questionnaire(run.plan, task) != submit.questionnaire:
        return run, (Tell(event.client, AnswerSaved(submit.id)), Tell(event.client, form(run)))
    missing = plan.missing_items(run.plan, task, submit.questionnaire)
    if missing:
        return run, (Tell(event.client, Refused(submit.id, f"Not answered yet: {', '.join(missing)}.")),)
    record = {"type": "submitted", "participant": person.id, "condition": task.condition, "at_ns": event.at_ns}
    run, saved = _save(run, {**record, "questionnaire": submit.questionnaire}, event.client, submit.id)
    run = _settled(run)
    return run, (*saved, *_tables(run), *_tell_everybody(run))


def _tell_everybody(run: StudyRun) -> Actions:
    """The phone and the questionnaire's page learn what is next."""
    told: list[Action] = [Tell(client, form(run)) for client in run.forms]
    if run.phone is not None:
        told.append(Tell(run.phone, run.setup.welcome(_task_number(run))))
    return (*told, *_phone_phase(run))


# --- the operator


def _do(run: StudyRun, event: Said, do: Do) -> Stepped:
    if do.what == "take_over":
        others = tuple(client for client in run.operators if client != event.client)
        return changed(run, operators=(event.client, *others), seen=None), (Tell(event.client, Done(do.id)),)
    if not run.operators or event.client != run.operators[0]:
        return run, (Tell(event.client, Refused(do.id, "Another page may act; press “Take over” first.")),)
    allowed, why = desk.may(run, do.what, do.text.strip(), event.at_ns)
    if not allowed:
        return run, (Tell(event.client, Refused(do.id, why)),)
    run, actions = _DEEDS[do.what](run, do.text.strip(), event.at_ns)
    return run, (*actions, Tell(event.client, Done(do.id)))


def _start(run: StudyRun, reason: str, at_ns: int) -> Stepped:
    now = run.now
    assert now is not None  # noqa: S101 - there is always somebody next
    person, index = now
    condition, ids = person.tasks[index].condition, {"participant": person.id}
    actions: list[Action] = []
    if not person.begun:
        record = {"type": "participant", **ids, "order": list(person.order), "slot": person.slot, "at_ns": at_ns}
        run, saved = _save(run, record)
        actions += saved
    run, saved = _save(run, {"type": "begun", **ids, "condition": condition, "at_ns": at_ns})
    opened = Open(person.id, condition, desk.facts(run, person, index, reason))
    attempt, begun = session.begin(run.setup.attempt(person.id, condition), run.phone, at_ns)
    welcome = () if run.phone is None else (Tell(run.phone, run.setup.welcome(index + 1)),)
    return changed(run, phase="session", attempt=attempt), (*actions, *saved, opened, *welcome, *begun)


def _abort(run: StudyRun, reason: str, at_ns: int) -> Stepped:
    return _to_attempt(run, session.Aborted(reason or "ended by the operator", at_ns))


def _resolve(run: StudyRun, kind: str, reason: str, at_ns: int) -> Stepped:
    now = run.now
    assert now is not None  # noqa: S101
    person, index = now
    task = person.tasks[index]
    record = {"type": kind, "participant": person.id, "condition": task.condition, "reason": reason, "at_ns": at_ns}
    run, saved = _save(run, {**record, "trials": task.trials})
    return changed(run, phase="writing"), (*saved, Resolve(person.id, task.condition, kind == "set_aside"))


def _decided(run: StudyRun, record: Record) -> Stepped:
    run, saved = _save(run, record)
    run = _settled(run)
    return run, (*saved, *_tables(run), *_tell_everybody(run))


def _skip(run: StudyRun, reason: str, at_ns: int) -> Stepped:
    now = run.now
    assert now is not None  # noqa: S101
    ids = {"participant": now[0].id, "condition": now[0].tasks[now[1]].condition}
    return _decided(run, {"type": "skipped", **ids, "reason": reason, "at_ns": at_ns})


def _next(run: StudyRun, reason: str, at_ns: int) -> Stepped:
    """Go on though a questionnaire is open: its missing answers stay missing."""
    now = run.now
    assert now is not None  # noqa: S101
    person, index = now
    name = plan.open_questionnaire(run.plan, person.tasks[index])
    ids = {"participant": person.id, "condition": person.tasks[index].condition, "questionnaire": name}
    return _decided(run, {"type": "left_open", **ids, "reason": reason, "at_ns": at_ns})


def _drop(run: StudyRun, reason: str, at_ns: int) -> Stepped:
    now = run.now
    assert now is not None  # noqa: S101
    actions: list[Action] = []
    record = {"type": "dropped", "participant": now[0].id, "reason": reason, "at_ns": at_ns}
    if run.attempt is not None and run.attempt.phase != "ended":
        run, ended = _to_attempt(run, session.Aborted(f"dropped out: {reason}", at_ns))
        run, saved = _save(run, record)
        return run, (*ended, *saved)
    if not now[0].begun:
        order = {"order": list(now[0].order), "slot": now[0].slot}
        run, saved = _save(run, {"type": "participant", "participant": now[0].id, **order, "at_ns": at_ns})
        actions += saved
    run, decided = _decided(run, record)
    return run, (*actions, *decided)


def _note(run: StudyRun, text: str, at_ns: int) -> Stepped:
    run, noted = _to_attempt(run, session.Noted(text, at_ns))
    run, saved = _save(run, {"type": "note", "text": text, "at_ns": at_ns})
    return run, (*noted, *saved)


def _swap(run: StudyRun, _reason: str, at_ns: int) -> Stepped:
    other = next(client for client in run.phones if client != run.phone)
    before = run.phone
    run, actions = _activate(run, other, at_ns)
    told = () if before is None else (Tell(before, PhaseOfTask("second")),)
    return run, (*told, *actions)


_DEEDS: Mapping[str, Callable[[StudyRun, str, int], Stepped]] = {
    "start": _start,
    "abort": _abort,
    "redo": lambda run, reason, at_ns: _resolve(run, "set_aside", reason, at_ns),
    "keep": lambda run, reason, at_ns: _resolve(run, "finished", reason, at_ns),
    "skip": _skip,
    "next": _next,
    "drop": _drop,
    "note": _note,
    "swap": _swap,
}
_ANSWERS: Mapping[type, Callable[[StudyRun, Said, Any], Stepped]] = {
    Ping: _pinged,
    Motion: _moved,
    Orientation: _oriented,
    Drawn: _drew,
    Select: _pressed,
    Hello: _greeted,
    Answer: _answered,
    Submit: _submitted,
    Do: _do,
}
_STEPS: Mapping[type, Callable[[StudyRun, Any], Stepped]] = {
    Reading: _reading,
    Tick: _tick,
    Said: _said,
    Joined: _joined,
    Left: _left,
    Disk: _disk,
    Saved: _saved,
    Closed: _closed,
    Woke: _woke,
    WallClock: _wall_clock,
    Agreed: lambda run, event: (changed(run, agreed=event), NOTHING),
}
