"""The state of a study that is run, and the steps that everything that changes it shares.

Saving a record, handing an event to the attempt, making a phone the active one, and telling pages what is next:
readings (`study_run`), the operator (`deeds`) and questionnaires (`forms`) all do these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pipeline.live import checks, desk, plan, session, session_state
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
    Dropped,
    Offer,
    Save,
    Tables,
    Tell,
)
from pipeline.live.health import Health
from pipeline.live.messages import Hello
from pipeline.live.orientation import PhoneMotion
from pipeline.live.outgoing import Form, FormState, PhaseOfTask
from pipeline.live.plan import Person, Plan, Record
from pipeline.live.session_state import Session
from pipeline.live.setup import Setup
from pipeline.live.watch import Light, Watched
from pipeline.study.recording import pair_id

Phase = Literal["ready", "session", "writing", "questionnaire", "cut"]


@dataclass(frozen=True)
class StudyRun:
    """The state of a study that is run.

    `phone` is the connection of the active phone, `phones` all of them, `ids` which phone each is of, `operators` those
    of operator's pages, the one that may act first. `asked` remembers what is being saved, by token: whom to tell, and
    how. The active phone was heard at `heard_ns`, None before it has asked for the time; `is_away` since it is silent.
    `links` says of streams whose sender is not connected what is wrong. `offers` are the senders that are not
    heard, `accepted` the address of the one that the operator lets feed a stream.
    """

    setup: Setup
    plan: Plan
    phase: Phase = "ready"
    attempt: Session | None = None
    phones: tuple[int, ...] = ()
    ids: Mapping[int, str] = field(default_factory=dict)
    phone: int | None = None
    operators: tuple[int, ...] = ()
    forms: tuple[int, ...] = ()
    hello: Hello | None = None
    heard_ns: int | None = None
    is_away: bool = False
    is_hidden: bool = False
    battery: float | None = None
    clock: Clock = field(default_factory=Clock)
    motion: PhoneMotion = field(default_factory=PhoneMotion)
    one_way: Mapping[str, OneWay] = field(default_factory=dict)
    health: Mapping[str, Health] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    disk: Disk | None = None
    dropped: Dropped | None = None
    offers: tuple[Offer, ...] = ()
    accepted: Mapping[str, str] = field(default_factory=dict)
    asked: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    tokens: int = 0
    closed: Closed | None = None
    agreed: Agreed | None = None
    traces: tuple[tuple[int, float | None, float | None], ...] = ()
    lights_ns: int = 0
    drawn: tuple[int, ...] = ()
    watched: Watched = field(default_factory=Watched)
    seen: object = None

    @property
    def now(self) -> tuple[Person, int] | None:
        """The participant and the index of the task that is under way or next."""
        return plan.current(self.plan)

    @property
    def finds_orientation(self) -> bool:
        """Whether the phone's orientation is found from its motion: its page sends it, or a sender brings none."""
        return self.setup.aligner is not None and (self.setup.motion_stream is not None or self.motion.source != "none")

    @property
    def checks(self) -> tuple[Light, ...]:
        """The lights of the checks before a task, and of what the last readings claim."""
        found = self.watched.found
        missing = {name: Light(name, "off", text) for name, text in checks.NOT_YET.items()}
        reached = checks.reach(len(self.watched.reached), len(self.setup.corners_mm))
        known = {**missing, checks.REACH: reached, **found}
        return (*(known[name] for name in self.setup.guided), *self.watched.claims)


Stepped = tuple[StudyRun, Actions]


def begin(setup: Setup, known: Plan) -> StudyRun:
    """The state at the start, from what the folder and its records say."""
    if plan.current(known) is None:
        known = plan.with_next_person(known)
    streams = {name: Health() for name in setup.streams}
    return settled(StudyRun(setup, known, health=streams))


def settled(run: StudyRun) -> StudyRun:
    """In the phase that the plan says, when no attempt is under way."""
    if plan.current(run.plan) is None:
        run = changed(run, plan=plan.with_next_person(run.plan))
    now = run.now
    assert now is not None  # noqa: S101 - there is always somebody next
    task = now[0].tasks[now[1]]
    phase: Phase = "cut" if task.state == "cut" else "questionnaire" if task.state == "done" else "ready"
    return changed(run, phase=phase, attempt=None)


def to_attempt(run: StudyRun, event: session_state.Event) -> Stepped:
    """Hand an event to the attempt, and go on where it ends."""
    if run.attempt is None or run.attempt.phase == "ended":
        return run, NOTHING
    attempt, actions = session.step(run.attempt, event)
    run = changed(run, attempt=attempt)
    if attempt.phase != "ended":
        return run, actions
    set_aside = any(isinstance(action, Close) and action.set_aside for action in actions)
    ended: dict[str, object] = {"type": "set_aside" if set_aside else "finished", "reason": attempt.ended_by}
    run, saved = save(run, {**ids_of(attempt), **ended, "trials": attempt.selections})
    return changed(run, phase="writing"), (*actions, *saved)


def ids_of(attempt: Session) -> dict[str, object]:
    """An attempt's columns in tables and records: participant and condition."""
    return {"participant": attempt.attempt.participant, "condition": attempt.attempt.condition}


def save(run: StudyRun, record: Record, client: int | None = None, message_id: str = "") -> Stepped:
    """Make a record part of the plan and of the file; who asked for it is told when it is on disk."""
    token = str(run.tokens + 1)
    asked = run.asked if client is None else {**run.asked, token: (client, message_id)}
    run = changed(run, tokens=run.tokens + 1, asked=asked, plan=plan.after(run.plan, record))
    return run, (Save(record, token),)


def tables(run: StudyRun) -> Actions:
    """What participants.csv and questionnaires.csv hold now, to be written."""
    return (Tables(plan.participant_rows(run.plan), plan.rating_rows(run.plan)),)


def activate(run: StudyRun, client: int | None, at_ns: int) -> Stepped:
    """Make a phone the active one, or none. Its clock is learned anew: it may be another phone."""
    motion = run.motion if run.setup.motion_stream is None else PhoneMotion()
    run = changed(run, phone=client, clock=Clock(), motion=motion, hello=None, watched=_forgotten(run))
    run = changed(run, heard_ns=None, is_away=False, is_hidden=False, battery=None)
    run, actions = to_attempt(run, session_state.PhoneIs(client, at_ns))
    if client is None:
        return run, actions
    return run, (Tell(client, run.setup.welcome(task_number(run))), *phone_phase(run), *actions)


def _forgotten(run: StudyRun) -> Watched:
    """What is still known when the phone is another: the tracker's readings, and what they reached."""
    setup, watched = run.setup, run.watched
    others = {name: kept for name, kept in watched.streams.items() if name != setup.motion_stream}
    found = {} if setup.motion_stream is not None else {k: v for k, v in watched.found.items() if k != checks.TAP}
    return changed(watched, streams=others, found=found, claims=())


def phone_phase(run: StudyRun) -> Actions:
    """What the phone shows while no attempt is under way."""
    if run.phone is None or (run.attempt is not None and run.attempt.phase != "ended"):
        return NOTHING
    if run.phase in ("writing", "questionnaire"):
        return (Tell(run.phone, PhaseOfTask("done")),)
    return (Tell(run.phone, PhaseOfTask("checks" if wants_checks(run) else "waiting")),)


def wants_checks(run: StudyRun) -> bool:
    """Whether the participant is asked to do the checks: a task is next, and something has not been seen yet."""
    return run.phase == "ready" and any(one.light == "off" for one in run.checks)


def task_number(run: StudyRun) -> int:
    """The place of the task that is under way or next, from 1."""
    now = run.now
    return 1 if now is None else now[1] + 1


def form(run: StudyRun) -> Form | FormState:
    """What a questionnaire's page shows now."""
    now = run.now
    if now is None or run.phase != "questionnaire":
        return FormState("thanks" if now is None or now[1] > 0 or _follows_somebody(run, now[0]) else "waiting")
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
    pairs = [
        {"id": pair_id(one), "first": one[0], "second": one[1], "value": answers.get((known.id, pair_id(one)))}
        for one in known.pairs
    ]
    title = known.title if own else None
    return Form(known.id, f"Task {index + 1}", title, items, pairs, ids.index(known.id) + 1, len(ids))


def _follows_somebody(run: StudyRun, person: Person) -> bool:
    """Is a participant who has not begun preceded by one who has: whose page still thanks them?"""
    return not person.begun and any(one.begun for one in run.plan.persons)


def tell_everybody(run: StudyRun) -> Actions:
    """The phone and the questionnaire's page learn what is next."""
    told: list[Action] = [Tell(client, form(run)) for client in run.forms]
    if run.phone is not None:
        told.append(Tell(run.phone, run.setup.welcome(task_number(run))))
    return (*told, *phone_phase(run))
