"""What the operator's page shows and may do, read off the state of a run; its lights are `panel`. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipeline.live import health, offers, plan
from pipeline.live.outgoing import Whole
from pipeline.live.watch import Light
from pipeline.study.recording import BUILT_IN

if TYPE_CHECKING:
    from pipeline.live.run_state import StudyRun

__all__ = ["BUILT_IN", "Refusal", "facts", "refusal", "state", "summary"]

_NS_PER_MS = 1e6
_NS_PER_S = 1e9
LEAST_FREE_BYTES = 200_000_000
_UNALIGNED = (
    "The phone's orientation is not known yet: hold it still for a second, then move it about in view of the tracker;"
    " or give a reason to start without it."
)


def phase(run: StudyRun) -> str:
    """The phase as the operator's page names it."""
    if run.phase == "session" and run.attempt is not None:
        return run.attempt.phase
    return run.phase


def red_lights(run: StudyRun, at_ns: int) -> list[str]:
    """What must be there for a task to begin, and is not, in sentences."""
    now, found = run.now, []
    if run.phone is None:
        found.append("No phone is connected. Scan the code with the phone.")
    used = sorted(run.setup.uses(now[0].tasks[now[1]].condition)) if now is not None else []
    found += [
        run.links.get(name) or f"{name} is silent. Turn it on, or give a reason to start without it."
        for name in used
        if health.is_silent(run.health[name], at_ns)
    ]
    if run.phone is not None and run.setup.turned_stream in used and is_unaligned(run):
        found.append(_UNALIGNED)
    if run.disk is not None and run.disk.fault is not None:
        found.append(run.disk.fault)
    elif run.disk is not None and run.disk.free_bytes < LEAST_FREE_BYTES:
        found.append("The disk is nearly full. A study needs 200 MB.")
    return [*found, *(one.text for one in run.checks if one.light == "red")]


def is_unaligned(run: StudyRun) -> bool:
    """Whether the phone's orientation is to be found from its motion, and is not known yet."""
    return run.finds_orientation and not run.motion.is_known


def undone(run: StudyRun, person: plan.Person) -> list[Light]:
    """The checks that must be done before a participant's first task, and of which nothing has been seen."""
    return [] if person.begun else [one for one in run.checks if one.light == "off"]


@dataclass(frozen=True)
class Refusal:
    """Why something cannot be done now, and whether a reason that is given overrules that."""

    why: str
    reason_overrules: bool = False


def refusal(run: StudyRun, what: str, reason: str, at_ns: int) -> Refusal | None:
    """Why something cannot be done now; None where it can."""
    if what == "accept":
        why = offers.refusal(run, reason, at_ns)
        return None if why is None else Refusal(why)
    if what not in _choices(run):
        return Refusal(f"“{what}” is not possible now.")
    if what == "note" and not reason:
        return Refusal("A note needs a text.")
    return _not_to_start(run, reason, at_ns) if what == "start" else None


def _not_to_start(run: StudyRun, reason: str, at_ns: int) -> Refusal | None:
    """Why a task cannot begin; None where it can."""
    red = red_lights(run, at_ns)
    if run.phone is None or (run.disk is not None and run.disk.fault is not None):
        return Refusal(red[0])
    not_done = [] if run.now is None else [one.text for one in undone(run, run.now[0])]
    if reason or not (red or not_done):
        return None
    why = red[0] if red else f"Not all checks are done: {' '.join(not_done)} Or give a reason to start without."
    return Refusal(why, reason_overrules=True)


def _choices(run: StudyRun) -> tuple[str, ...]:
    """What can be done now, what is most likely first."""
    others = ("note", *(("swap",) if len(run.phones) > 1 else ()))
    by_phase: Mapping[str, tuple[str, ...]] = {
        "ready": ("start", "skip", "drop"),
        "session": ("abort", "drop"),
        "writing": (),
        "questionnaire": ("next", "redo", "drop"),
        "cut": ("redo", "keep", "drop"),
    }
    return (*by_phase[run.phase], *others)


def summary(run: StudyRun) -> object:
    """What the operator's state depends on; where it is the same, nothing need be sent."""
    attempt = run.attempt
    within = None if attempt is None else (attempt.phase, attempt.target, attempt.seconds_left)
    fault = None if run.disk is None else run.disk.fault
    pages = run.phones, run.phone, run.operators, run.forms
    # What `run.checks` is made of, as making its sentences for each tick would cost more than all else of it.
    checks = run.watched.found, len(run.watched.reached), run.watched.claims
    return (run.plan, run.phase, within, pages, run.closed, run.agreed, fault, checks, run.offers, run.accepted)


def state(run: StudyRun, client: int) -> Whole:
    """The whole state, for one operator's page."""
    blind, now = run.setup.recording.blind == "both", run.now
    content: dict[str, object] = {
        "study": run.setup.study.title,
        "read_only": client != run.operators[0],
        "demo": bool(run.setup.simulated),
        "participants": [_person(run, person, blind) for person in run.plan.persons],
        "phase": phase(run),
        "next": _next(run),
        "now": None if now is None else _now(run, *now),
        "checks": [{"id": one.id, "light": one.light, "text": one.text} for one in run.checks],
        "log": open_log(run),
        "disk_free_bytes": None if run.disk is None else run.disk.free_bytes,
        "agreement": _agreement(run),
        "links": [{"role": role, "url": url, "qr": f"/qr/{role}.svg"} for role, url in run.setup.links],
        "phones": len(run.phones),
        "questionnaires_open": len(run.forms),
        "offers": offers.shown(run),
        "problems": _problems(run),
    }
    return Whole("state", content)


def _person(run: StudyRun, person: plan.Person, blind: bool) -> dict[str, object]:
    return {
        "id": person.id,
        "dropped": person.dropped,
        "tasks": [
            {
                "task": index + 1,
                "label": f"Task {index + 1}",
                "condition": None if blind else task.condition,
                "state": task.state,
                "attempt": task.attempt,
                "trials": _trials(run, person, index),
                "of": len(run.setup.targets_mm),
                "questionnaires": [
                    {
                        "id": name,
                        "answered": sum(one == name for one, _ in task.answers),
                        "of": len(run.plan.wanted(name)),
                        "submitted": name in task.submitted,
                    }
                    for name in run.plan.questionnaires
                ],
            }
            for index, task in enumerate(person.tasks)
        ],
    }


def _trials(run: StudyRun, person: plan.Person, index: int) -> int:
    task = person.tasks[index]
    return run.attempt.selections if run.attempt is not None and task.state == "now" else task.trials


def _next(run: StudyRun) -> dict[str, object]:
    now, choices = run.now, _choices(run)
    main = {"ready": "start", "session": "abort", "questionnaire": "next", "cut": "redo"}.get(run.phase)
    words = {"start": "Start", "abort": "End", "next": "Go on without the questionnaire of", "redo": "Do again"}
    label = "" if now is None or main is None else f"{words[main]} {now[0].id}, Task {now[1] + 1}"
    return {"do": main, "label": label, "others": [what for what in choices if what != main]}


def _now(run: StudyRun, person: plan.Person, index: int) -> dict[str, object]:
    attempt = run.attempt
    running = attempt is not None and attempt.phase == "running"
    return {
        "participant": person.id,
        "task": index + 1,
        "attempt": person.tasks[index].attempt,
        "trial": attempt.trial if attempt is not None and running else None,
        "target": attempt.target if attempt is not None and running else None,
        "seconds": (attempt.clock_ns - attempt.begun_ns) / _NS_PER_S if attempt is not None and running else None,
        "seconds_left": attempt.seconds_left if attempt is not None and attempt.phase == "countdown" else None,
    }


def open_log(run: StudyRun) -> dict[str, object] | None:
    """The log that is written, None while none is."""
    disk, attempt = run.disk, run.attempt
    if attempt is None or attempt.phase == "ended" or disk is None or disk.log_bytes is None:
        return None
    written = None if disk.written_ns is None else (disk.at_ns - disk.written_ns) / _NS_PER_MS
    blind = run.setup.recording.blind == "both"
    name = "the log" if blind else f"{attempt.attempt.participant}_{attempt.attempt.condition}"
    return {"file": name, "bytes": disk.log_bytes, "written_ms": written}


def _agreement(run: StudyRun) -> dict[str, object] | None:
    agreed = run.agreed
    if agreed is None:
        return None
    blind = run.setup.recording.blind == "both"
    return {"mm": agreed.mm, "n": agreed.shown, "file": "the last log" if blind else agreed.file}


def _problems(run: StudyRun) -> list[str]:
    found = []
    if run.disk is not None and run.disk.fault is not None:
        found.append(run.disk.fault)
    for person in run.plan.persons:
        if person.dropped and any(task.state == "done" for task in person.tasks):
            entry = json.dumps({"participant": person.id, "reason": person.left_because or "left"}, ensure_ascii=False)
            found.append(
                f"{person.id} left. To leave out what was recorded of them: exclusions: [{entry}] in study.yaml."
            )
        for index, task in enumerate(person.tasks):
            if task.state == "cut":
                of = f"{task.trials} of {len(run.setup.targets_mm)} targets"
                found.append(f"{person.id}, task {index + 1} was cut after {task.cut_s:.1f} s, {of}: redo or keep it.")
    return found


def facts(run: StudyRun, person: plan.Person, index: int, reason: str, at_ns: int) -> dict[str, str]:
    """What the log says of itself, first of all."""
    setup, hello, mapping = run.setup, run.hello, run.clock.mapping
    condition = person.tasks[index].condition
    name = setup.study.shown[condition]
    settings = setup.study.estimators[name]
    task = setup.task
    found = {
        "participant": person.id,
        "condition": condition,
        "order": str(index + 1),
        "attempt": str(person.tasks[index].attempt + 1),
        "study_digest": setup.digest,
        "recorder": f"steadyhand {setup.version}",
        "estimator": f"{settings.type} {dict(settings.parameters)}",
        "blind": setup.recording.blind,
        "window_mm": "" if task.window_mm is None else f"{task.window_mm[0]:g} × {task.window_mm[1]:g}",
        "px_per_mm": "" if setup.study.display is None else f"{setup.study.display.px_per_mm:g}",
    }
    if setup.simulated:
        found["origin"] = setup.simulated
    if hello is not None:
        found["user_agent"] = hello.agent
        found["screen"] = "" if hello.screen is None else " × ".join(f"{part:g}" for part in hello.screen)
    if mapping is not None:
        drift = f"{mapping.drift * 1e6:.1f} ppm"
        found["clock"] = f"offset {mapping.offset_ms:.3f} ms, {drift}, ± {mapping.uncertainty_ms:.2f} ms"
    found |= {f"check_{one.id}": f"{one.light}: {one.text}" for one in run.checks}
    found |= {f"accepted_{stream}": source for stream, source in run.accepted.items()}
    if reason:
        found["started_although"] = reason
        overruled = [*red_lights(run, at_ns), *(f"{one.id}: not done." for one in undone(run, person))]
        if overruled:
            found["overruled"] = " ".join(overruled)
    return found
