"""The way from a phone's accelerometer to the point that the tracker sees, as the phone is turned. Pure.

An estimator works with where the accelerometer is: positions less the arm go in, the arm is added to what comes out. Of
the readings that have arrived the newest that was measured by then says how the phone was turned, live as in a replay
(`pipeline.sessions.lever_arm.Arm`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion_core import Sample
from fusion_core.phone.orientation import rotation
from pipeline.live.events import Values
from pipeline.live.session_state import Session
from pipeline.live.streams import LiveStream
from pipeline.statistics.arrays import FloatArray

_KEPT_NS = 10_000_000_000
Arms = tuple[tuple[int, FloatArray], ...]


def after(state: Session, stream: LiveStream, stamp_ns: int, values: Values) -> Arms:
    """The arms after a reading: one more if it is the phone's, and newer than all before it."""
    measured_ns = stamp_ns - stream.late_ns
    if stream.name != state.attempt.armed or (state.arms and measured_ns < state.arms[-1][0]):
        return state.arms
    kept = state.arms
    if kept and kept[0][0] < measured_ns - 2 * _KEPT_NS:  # seldom, and many at once
        kept = tuple(one for one in kept if one[0] >= measured_ns - _KEPT_NS)
    return (*kept, (measured_ns, rotation(np.array(values[6:10])) @ stream.mounting @ stream.arm_mm))


def less(state: Session, stream: LiveStream, position: Sample, stamp_ns: int) -> Sample | None:
    """A position of the tracker's less the arm; None where it is not known how the phone was turned then."""
    if state.attempt.armed is None:
        return position
    measured_ns = stamp_ns - stream.late_ns
    arm = next((arm for at_ns, arm in reversed(state.arms) if at_ns <= measured_ns), None)
    return None if arm is None else replace(position, value=position.value - arm[list(stream.axes)])


def now(state: Session) -> FloatArray | float:
    """The arm along the analysed axes, which is added to an estimate."""
    armed = state.attempt.armed
    if armed is None or not state.arms:
        return 0.0
    along: FloatArray = state.arms[-1][1][list(state.attempt.streams[armed].axes)]
    return along
