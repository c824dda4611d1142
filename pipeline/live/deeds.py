"""What the operator may do, and what follows from it: start, end, decide about a cut log, skip, drop, note, swap,
accept a sender.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pipeline.live import clocks, desk, offers, plan, session, session_state
from pipeline.live.changes import changed
from pipeline.live.events import Accept, Action, Open, Resolve, Said, Tell
from pipeline.live.messages import Do
from pipeline.live.outgoing import Done, PhaseOfTask, Refused
from pipeline.live.plan import Record
from pipeline.live.run_state import Stepped, StudyRun, activate, save, settled, tables, tell_everybody, to_attempt


def do(run: StudyRun, event: Said, do: Do) -> Stepped:
    """An operator's deed, if this page may act and the deed is allowed now; the page learns either."""
    if do.what == "take_over":
        others = tuple(client for client in run.operators if client != event.client)
        return changed(run, operators=(event.client, *others), seen=None), (Tell(event.client, Done(do.id)),)
    if not run.operators or event.client != run.operators[0]:
        return run, (Tell(event.client, Refused(do.id, "Another page may act; press “Take over” first.")),)
    refusal = desk.refusal(run, do.what, do.text.strip(), event.at_ns)
    if refusal is not None:
        return run, (Tell(event.client, Refused(do.id, refusal.why, refusal.reason_overrules)),)
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
        run, saved = save(run, record)
        actions += saved
    run, saved = save(run, {"type": "begun", **ids, "condition": condition, "at_ns": at_ns})
    opened = Open(person.id, condition, desk.facts(run, person, index, reason, at_ns))
    attempt, begun = session.begin(run.setup.attempt(person.id, condition), run.phone, at_ns)
    welcome = () if run.phone is None else (Tell(run.phone, run.setup.welcome(index + 1)),)
    of_clocks = clocks.opening(run, at_ns)
    return changed(run, phase="session", attempt=attempt), (*actions, *saved, opened, *of_clocks, *welcome, *begun)


def _abort(run: StudyRun, reason: str, at_ns: int) -> Stepped:
    return to_attempt(run, session_state.Aborted(reason or "ended by the operator", at_ns))


def _resolve(run: StudyRun, kind: str, reason: str, at_ns: int) -> Stepped:
    now = run.now
    assert now is not None  # noqa: S101
    person, index = now
    task = person.tasks[index]
    record = {"type": kind, "participant": person.id, "condition": task.condition, "reason": reason, "at_ns": at_ns}
    run, saved = save(run, {**record, "trials": task.trials})
    return changed(run, phase="writing"), (*saved, Resolve(person.id, task.condition, kind == "set_aside"))


def _decided(run: StudyRun, record: Record) -> Stepped:
    run, saved = save(run, record)
    run = settled(run)
    return run, (*saved, *tables(run), *tell_everybody(run))


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
        run, ended = to_attempt(run, session_state.Aborted(f"dropped out: {reason}", at_ns))
        run, saved = save(run, record)
        return run, (*ended, *saved)
    if not now[0].begun:
        order = {"order": list(now[0].order), "slot": now[0].slot}
        run, saved = save(run, {"type": "participant", "participant": now[0].id, **order, "at_ns": at_ns})
        actions += saved
    run, decided = _decided(run, record)
    return run, (*actions, *decided)


def _note(run: StudyRun, text: str, at_ns: int) -> Stepped:
    run, noted = to_attempt(run, session_state.Noted(text, at_ns))
    run, saved = save(run, {"type": "note", "text": text, "at_ns": at_ns})
    return run, (*noted, *saved)


def _swap(run: StudyRun, _reason: str, at_ns: int) -> Stepped:
    other = next(client for client in run.phones if client != run.phone)
    before = run.phone
    run, actions = activate(run, other, at_ns)
    told = () if before is None else (Tell(before, PhaseOfTask("second")),)
    return run, (*told, *actions)


def _accept(run: StudyRun, offer_id: str, at_ns: int) -> Stepped:
    """Let a sender without a key feed its stream. The log that is open says so, and so does the file of answers."""
    offer = offers.named(run, offer_id)
    assert offer is not None  # noqa: S101 - it would have been refused
    run = changed(run, accepted={**run.accepted, offer.stream: offer.source})
    text = f"{offer.source}, which sends {offer.sends}, was accepted as {offer.stream}"
    run, noted = _note(run, text, at_ns)
    return run, (Accept(offer.stream, offer.source), *noted)


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
    "accept": _accept,
}
