"""What the operator's page shows and may do, read off the state of a run. Pure."""

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

__all__ = ["BUILT_IN", "Refusal", "facts", "lights", "refusal", "state", "summary", "trace"]

_NS_PER_MS = 1e6
_NS_PER_S = 1e9
_LEAST_FREE_BYTES = 200_000_000
_LATE_WRITE_MS = 2_000.0
_LOW_BATTERY = 0.2
_LATELY_NS = 10_000_000_000
_UNKNOWN = "Its orientation is not known yet: hold it still, then move it."
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
    elif run.disk is not None and run.disk.free_bytes < _LEAST_FREE_BYTES:
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
        "log": _log(run),
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


def _log(run: StudyRun) -> dict[str, object] | None:
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


def lights(run: StudyRun, at_ns: int) -> Whole:
    """The lights and traces."""
    attempt = run.attempt
    found: dict[str, object] = {}
    for name, one in run.health.items():
        lost = attempt.heard[name].lost if attempt is not None else 0
        light = health.light(one, at_ns, lost)
        problem = run.links.get(name) or (None if one.count else _not_yet(run, name))
        if (
            name == run.setup.turned_stream != run.setup.motion_stream
            and is_unaligned(run)
            and light["light"] == "green"
        ):
            light = {**light, "light": "amber", "text": f"{light['text']}. {_UNKNOWN}"}
        found[name] = {**light, "light": "red", "text": problem} if problem else light
    found |= {
        "senders": _senders_light(run, at_ns),
        "phone": _phone_light(run),
        "clock": _clock_light(run),
        "disk": _disk_light(run),
        "log": _log_light(run),
    }
    mapping = run.clock.mapping
    return Whole(
        "lights",
        {
            "lights": found,
            "drawn_hz": float(len(run.drawn)),
            "round_trip_ms": None if mapping is None else round(2 * mapping.uncertainty_ms, 2),
            "traces": {
                "t_s": [round((at - at_ns) / _NS_PER_S, 2) for at, _, _ in run.traces],
                "raw_mm": [raw for _, raw, _ in run.traces],
                "shown_mm": [shown for _, _, shown in run.traces],
            },
        },
    )


def _not_yet(run: StudyRun, name: str) -> str | None:
    """What is said of a sender by UDP of which nothing has come, as a firewall or a wrong address leave it."""
    port = run.setup.recording.senders[name].port
    return None if port is None else f"Nothing has come to UDP port {port}: see the sender's address, and the firewall."


def _senders_light(run: StudyRun, at_ns: int) -> dict[str, object]:
    """What was sent and not taken: amber for ten seconds after each."""
    dropped = run.dropped
    if dropped is None:
        return {"light": "off", "text": "Nothing was dropped."}
    counted = ", ".join(f"{reason} ({count})" for reason, count in sorted(dropped.counts.items()))
    lately = at_ns - dropped.at_ns < _LATELY_NS
    return {"light": "amber" if lately else "green", "text": f"Not taken: {counted}."}


def _phone_light(run: StudyRun) -> dict[str, object]:
    if run.phone is None:
        return {"light": "red", "text": "No phone is connected. Scan the code with the phone."}
    if run.is_away or run.is_hidden:
        return {"light": "red", "text": "Connected, and its page is not in view or out of reach: wake the phone up."}
    if run.battery is not None and run.battery < _LOW_BATTERY:
        return {"light": "amber", "text": f"Connected. Its battery is at {run.battery:.0%}: plug it in."}
    if run.hello is not None and not run.hello.wake_lock and not run.setup.mouse:
        return {"light": "amber", "text": "Connected. Its screen may go dark: set its automatic lock to “never”."}
    if run.setup.motion_stream is not None and is_unaligned(run):
        return {"light": "amber", "text": f"Connected. {_UNKNOWN}"}
    return {"light": "green", "text": "Connected."}


def _clock_light(run: StudyRun) -> dict[str, object]:
    """How well the phone's clock is known; amber where that of any sender was set."""
    mapping = run.clock.mapping
    were_set = ", ".join(name for name, one in run.one_way.items() if one.steps)
    if were_set and not run.clock.steps:
        return {"light": "amber", "text": f"The clock of the sender of {were_set} was set; it is known anew."}
    if mapping is None:
        return {"light": "off" if run.phone is None else "amber", "text": "The phone's clock is not known yet."}
    text = f"Known to ± {mapping.uncertainty_ms:.1f} ms."
    if run.clock.steps:
        return {
            "light": "amber",
            "text": f"{text} It was set {'once' if run.clock.steps == 1 else f'{run.clock.steps} times'}.",
        }
    return {"light": "green" if mapping.uncertainty_ms < 10 else "amber", "text": text}


def _disk_light(run: StudyRun) -> dict[str, object]:
    if run.disk is None:
        return {"light": "off", "text": ""}
    if run.disk.fault is not None:
        return {"light": "red", "text": run.disk.fault}
    free = f"{run.disk.free_bytes / 1e9:.1f} GB free."
    return {"light": "green" if run.disk.free_bytes >= _LEAST_FREE_BYTES else "red", "text": free}


def _log_light(run: StudyRun) -> dict[str, object]:
    known = _log(run)
    if known is None or run.disk is None or run.disk.log_bytes is None:
        return {"light": "off", "text": "No log is open."}
    written = 0.0 if run.disk.written_ns is None else (run.disk.at_ns - run.disk.written_ns) / _NS_PER_MS
    text = f"{run.disk.log_bytes / 1e6:.1f} MB, written {written / 1e3:.1f} s ago."
    return {"light": "green" if written < _LATE_WRITE_MS else "red", "text": text}


def trace(run: StudyRun, at_ns: int) -> tuple[int, float | None, float | None]:
    """A point of the traces: time, and x in mm as the tracker has it and as it is shown."""
    attempt = run.attempt
    if attempt is None:
        return at_ns, None, None
    heard = attempt.heard.get(run.setup.tracker or "")
    raw = heard.last[0] * 1e3 if heard is not None and heard.last else None
    shown = attempt.sent[-1].mean_mm[list(attempt.attempt.axes).index("x")] if attempt.sent else None
    return at_ns, raw, shown


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
