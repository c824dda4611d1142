"""Whether tracker and phone see one movement at all, and if not, at which distant lag they would."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks import force, orientation, repeats
from pipeline.sessions.checks.band import BAND_HZ
from pipeline.sessions.checks.finding import Finding
from pipeline.sessions.checks.motion import LAG_RANGE_S, Compared
from pipeline.sessions.checks.noise import noise_sd
from pipeline.sessions.checks.recorded import Positions, Recorded

ONE_MOVEMENT = "one movement"

_NOT_ONE, _IN_DOUBT = 0.2, 0.5  # of the movement; recordings without a fault that move plainly: 0.85 and more
_PLAINLY = 8.0  # times the power that the tracker's noise has in the band
_LONG_S, _FAR_MM = 16.0, 10.0  # a phone's noise hides what is smaller
_STILL = 0.2  # of the tracker's movement


def plainly_moves(tracker: Positions, motion: Compared) -> bool:
    """Does the tracker see far more movement than its noise would feign, for long enough?"""
    steps = tracker.times.steps_s[tracker.times.steps_s > 0]
    sd_mm = noise_sd(tracker.times, tracker.value_mm) or tracker.noise_sd_mm
    if sd_mm is None or not len(steps):
        return False
    share = min(1.0, 2 * (BAND_HZ[1] - BAND_HZ[0]) * float(np.median(steps)))
    return (
        min(motion.seconds / _LONG_S, motion.position_mm / _FAR_MM) >= 1
        and motion.position_mm**2 > _PLAINLY * 3 * sd_mm**2 * share
    )


def _contradicts_itself(recorded: Recorded) -> bool:
    """Is the phone's orientation or force wrong by itself?"""
    own = (force.specific_force, force.mean_acceleration, orientation.gyroscope, repeats.frozen)
    return any(one.status == "red" for check in own for one in check(recorded))


def one_movement(recorded: Recorded) -> Iterator[Finding]:
    """A tracker that moves plainly, and a phone whose accelerations explain nothing of it.

    An orientation that is wrong turns the accelerations this way and that, so that they explain as little: other checks
    have that, and where one of them is red nothing is said.
    """
    tracker, imu, motion = recorded.tracker, recorded.imu, recorded.motion
    if tracker is None or imu is None or motion is None:
        return
    found, expected = f"{motion.explained:.0%} in common", "most, where the hand plainly moves"
    doubt = motion.explained < _IN_DOUBT or motion.lag_beyond
    unlike = doubt and plainly_moves(tracker, motion) and not _contradicts_itself(recorded)
    shift_s = recorded.distant_lag_s if unlike else None
    distant = shift_s is not None and abs(shift_s) > LAG_RANGE_S
    if not distant and not (unlike and motion.explained < _NOT_ONE):
        yield Finding(ONE_MOVEMENT, "green", found, expected)
        return
    if shift_s is not None and distant:
        late, early = (tracker.name, imu.name) if shift_s > 0 else (imu.name, tracker.name)
        message = (
            f'the movement of "{tracker.name}" is that of "{imu.name}" only if the stamps of "{late}" are '
            f'{abs(shift_s):.1f} s later than those of "{early}": their clocks differ; log both with one clock, or put '
            "the clocks right before recording"
        )
        found = f"{shift_s:+.1f} s apart"
    elif motion.acceleration_mm < _STILL * motion.position_mm:
        message = (
            f'"{tracker.name}" moves by {motion.position_mm:.0f} mm and "{imu.name}" by {motion.acceleration_mm:.0f}: '
            "the phone rests while the tracker follows something else; fix the tracked marker to the phone"
        )
    else:
        message = (
            f'"{tracker.name}" and "{imu.name}" do not see one movement: one of them is of another session, person or '
            "device, or the tracker follows something else; put logs together that belong together"
        )
    yield Finding(ONE_MOVEMENT, "red", found, expected, message)
