"""The checks before a task, as a running study goes through them: readings are kept, checked now and then, shown.

What they find is `checks`; that is too slow for the loop, so the core asks for it (`Examine`) and is told (`Examined`).
"""

from __future__ import annotations

import math

from pipeline.live import checks, session_state, watch
from pipeline.live.changes import changed
from pipeline.live.events import NOTHING, Action, Actions, Examine, Examined, Reading, Values
from pipeline.live.run_state import Stepped, StudyRun, phone_phase, to_attempt, wants_checks
from pipeline.live.watch import KEPT_NS, Request, Row, Watched

_EXAMINE_NS, _EXAMINE_RUNNING_NS = 2_000_000_000, 10_000_000_000


def kept(run: StudyRun, reading: Reading) -> Watched:
    """What is watched, with a reading kept for the checks, as it is logged.

    Of an orientation that was found from the motion only what the browser said is kept as the sender's own.
    """
    setup, name, values = run.setup, reading.stream, reading.values
    arrival, stamp = reading.arrival_ns, reading.stamp_ns
    if stamp is None or setup.streams[name].stamps_arrival:
        stamp = arrival
    was_found = run.finds_orientation and name == setup.turned_stream
    turned = run.motion.upright if was_found else _orientation_of(values)
    watched = watch.kept(run.watched, name, Row(min(stamp, arrival), arrival, values, turned))
    if name == setup.tracker and len(watched.reached) < len(setup.corners_mm):
        watched = watch.reached(watched, setup.corners_mm, values)
    return watched


def _orientation_of(values: Values) -> Values | None:
    return values[6:10] if len(values) == 10 and math.isfinite(values[9]) else None


def examine(run: StudyRun, at_ns: int) -> Stepped:
    """Now and then: have the last readings checked, seldom while a task runs."""
    runs = run.attempt is not None and run.attempt.phase != "ended"
    watched = run.watched
    due = watched.examined_ns + (_EXAMINE_RUNNING_NS if runs else _EXAMINE_NS)
    if watched.under_way or at_ns < due or not watched.streams:
        return run, NOTHING
    since = at_ns - KEPT_NS
    rows = {name: kept.since(since) for name, kept in watched.streams.items()}
    request = Request({name: some for name, some in rows.items() if some}, _heading_sd(run))
    return changed(run, watched=changed(watched, under_way=True, examined_ns=at_ns)), (Examine(request),)


def _heading_sd(run: StudyRun) -> float | None:
    return run.motion.sd if run.finds_orientation else None


def examined(run: StudyRun, examined: Examined) -> Stepped:
    """New lights; while a task runs, the log notes what has turned red."""
    before, guided = run, run.setup.guided
    found = {**run.watched.found, **{one.id: one for one in examined.seen if one.id in guided}}
    watched = changed(run.watched, under_way=False, found=found, claims=examined.claims)
    run = changed(run, watched=watched)
    actions: list[Action] = []
    red = {one.id for one in before.checks if one.light == "red"}
    for one in run.checks:
        if one.light == "red" and one.id not in red:
            run, noted = to_attempt(run, session_state.Noted(f"{one.id}: {one.text}", examined.at_ns, "light"))
            actions += noted
    return run, (*actions, *_phone_after_checks(before, run))


def _phone_after_checks(before: StudyRun, run: StudyRun) -> Actions:
    return phone_phase(run) if wants_checks(before) != wants_checks(run) else NOTHING


def tapped(run: StudyRun, late_ms: float) -> Stepped:
    """A press while no task is under way is one of the checks."""
    mapping = run.clock.mapping
    if mapping is None or checks.TAP not in run.setup.guided:
        return run, NOTHING
    light = checks.tap(late_ms, 2 * mapping.uncertainty_ms)
    after = changed(run, watched=changed(run.watched, found={**run.watched.found, checks.TAP: light}))
    return after, _phone_after_checks(run, after)
