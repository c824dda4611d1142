"""The closed loop, compiled: the hand moves, the sensors measure, the estimator shows, the participant sees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fusion_core.live import Live, Readings, show
from pipeline.simulation.compilation import compiled
from pipeline.simulation.hand_steps import (
    DONE,
    PHASE,
    STEP,
    STEP_S,
    TARGET,
    Hand,
    IntArray,
    Layout,
    Person,
    Sway,
    advance,
)
from pipeline.statistics.arrays import FloatArray

STEP_NS = round(STEP_S * 1e9)
# Columns of Session.taps.
TAP_S, TAP_X, TAP_Y, TRUE_X, TRUE_Y = 0, 1, 2, 3, 4


class Sensing(NamedTuple):
    """When sensors measure, in ns since the session's begin, and how the hand's motion becomes their readings."""

    frame_ns: IntArray
    frame_noise_mm: FloatArray  # (n, d)
    force_ns: IntArray
    turn: FloatArray  # (m, d, 2): of the hand's acceleration, in the plane
    offset_mm_s2: FloatArray  # (m, d)
    instant_ns: IntArray  # (i,): when the display changes


class Session(NamedTuple):
    """The record of a session; all arrays are written in place."""

    trace: FloatArray  # (steps + 1, 4): x, y, ax, ay of the true hand
    shown: FloatArray  # (i, d)
    taps: FloatArray  # (targets, 5); NaN for a target that was not selected
    next: IntArray  # (3,): the next frame, force and instant


@compiled(forceinline=True)
def _sense(sensing: Sensing, readings: Readings, session: Session, step: int) -> None:
    """Writes the readings measured during the step before `step`, interpolating the hand's motion at its ends."""
    now, trace = step * STEP_NS, session.trace
    frame, force = session.next[0], session.next[1]
    while frame < len(sensing.frame_ns) and sensing.frame_ns[frame] <= now:
        share = 1.0 - (now - sensing.frame_ns[frame]) / STEP_NS
        for axis in range(readings.frame_mm.shape[1]):
            there = 0.0
            if axis < 2:
                there = trace[step - 1, axis] + share * (trace[step, axis] - trace[step - 1, axis])
            readings.frame_mm[frame, axis] = there + sensing.frame_noise_mm[frame, axis]
        frame += 1
    while force < len(sensing.force_ns) and sensing.force_ns[force] <= now:
        share = 1.0 - (now - sensing.force_ns[force]) / STEP_NS
        x = trace[step - 1, 2] + share * (trace[step, 2] - trace[step - 1, 2])
        y = trace[step - 1, 3] + share * (trace[step, 3] - trace[step - 1, 3])
        for axis in range(readings.force_mm_s2.shape[1]):
            turned = sensing.turn[force, axis, 0] * x + sensing.turn[force, axis, 1] * y
            readings.force_mm_s2[force, axis] = turned + sensing.offset_mm_s2[force, axis]
        force += 1
    session.next[0], session.next[1] = frame, force


@compiled
def walk(
    person: Person,
    layout: Layout,
    tremor: Sway,
    drift: Sway,
    hand: Hand,
    draws: np.random.Generator,
    sensing: Sensing,
    readings: Readings,
    session: Session,
    until: int,
) -> None:
    """Runs steps up to `until` or the end of the task, while the display does not change; writes what is measured."""
    newest = session.next[2] - 1
    x = session.shown[newest, 0] if newest >= 0 else np.nan
    y = session.shown[newest, 1] if newest >= 0 else np.nan
    while hand.progress[STEP] < until and hand.progress[PHASE] != DONE:
        step = hand.progress[STEP]
        if advance(person, layout, tremor, drift, hand, x, y, draws, session.trace):
            tap = session.taps[hand.progress[TARGET]]
            tap[TAP_S], tap[TAP_X], tap[TAP_Y] = step * STEP_S, x, y
            tap[TRUE_X], tap[TRUE_Y] = session.trace[step, 0], session.trace[step, 1]
        _sense(sensing, readings, session, step + 1)


@compiled
def run(
    person: Person,
    layout: Layout,
    tremor: Sway,
    drift: Sway,
    hand: Hand,
    draws: np.random.Generator,
    sensing: Sensing,
    readings: Readings,
    session: Session,
    live: Live,
    instants: FloatArray,
) -> None:
    """Runs a whole session: to the end of the task, or until the last of `instants` at which the display changes."""
    for index in range(len(instants)):
        until = max((sensing.instant_ns[index] + STEP_NS - 1) // STEP_NS, 1)
        walk(person, layout, tremor, drift, hand, draws, sensing, readings, session, until)
        if hand.progress[PHASE] == DONE:
            return
        show(live, readings, instants, index, session.shown)
        session.next[2] = index + 1
