"""The reference against the tracker: two streams of positions that must be of one movement, frame, unit and clock.

Whatever is wrong with the reference is in every figure of accuracy, for every estimator alike, so that no comparison of
them shows it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.agreement import (
    AXES,
    LAG,
    LAG_AMBER_S,
    LAG_RED_S,
    SIZE,
    in_ms,
    lag_text,
    see_one_movement,
    unit_of_positions,
)
from pipeline.sessions.checks.finding import Finding, graded, of
from pipeline.sessions.checks.motion import Compared
from pipeline.sessions.checks.one_movement import ONE_MOVEMENT, plainly_moves
from pipeline.sessions.checks.recorded import Positions, Recorded
from pipeline.statistics.arrays import FloatArray

DISTANCE = "distance"

_NEAR_S = 0.02  # by how much the nearer end of the lag's interval must be off
_SIZE = (1.25, 2.0)  # two trackers of one hand: recordings and simulations without a fault 0.97 to 1.03
_TURN_DEG = (10.0, 40.0)  # without a fault below 2; movements along one line are not judged
_TURN_CERTAIN_DEG = 5.0
_SURE = 0.99
_NOT_ONE = 0.3  # of the movement; without a fault, where the tracker plainly moves: 0.85 and more
_APART_MM = (50.0, 150.0)  # the middle of all distances; a marker and a tracker on one hand are nearer
_STRAY_MM, _STRAY_SDS = 100.0, 6.0
_STRAY_S, _STRAY_SHARE = 0.5, 0.02  # shorter strays are the tracker's, and *jumps* has them


def reference(recorded: Recorded) -> Iterator[Finding]:
    """Lag, size, frame and distance of the reference beside the tracker; nothing where one of them is not there."""
    tracker, stream, motion = recorded.tracker, recorded.of_kind("reference"), recorded.reference_motion
    if tracker is None or stream is None:
        return
    if motion is not None and (motion.explained < _NOT_ONE or motion.lag_beyond or not see_one_movement(motion)):
        if (motion.explained < _NOT_ONE or motion.lag_beyond) and plainly_moves(tracker, motion):
            message = (
                f'"{stream.name}" and "{tracker.name}" do not see one movement: one of them is of another session or '
                "person, of another object, or their clocks are more than 0.6 s apart; no figure of accuracy means "
                "anything before that is put right"
            )
            yield Finding(of(ONE_MOVEMENT, stream.name), "red", f"{motion.explained:.0%} in common", "most", message)
        return
    if motion is not None:
        alike = [_size(tracker, stream, motion), _frame(tracker, stream, motion)]
        yield _lag(tracker, stream, motion)
        yield from alike
        if any(one.status != "green" for one in alike):
            return  # and the distance follows from that
    yield from _distance(recorded, tracker, stream)


def _lag(tracker: Positions, stream: Positions, motion: Compared) -> Finding:
    stated_s = tracker.times.late_s - stream.times.late_s
    off_s = motion.lag_s.value - stated_s
    nearer_s = max(motion.lag_s.low - stated_s, stated_s - motion.lag_s.high)
    status = graded(abs(off_s), LAG_AMBER_S, LAG_RED_S)
    check, found, expected = of(LAG, stream.name), lag_text(motion.lag_s), f"{in_ms(stated_s)} by study.yaml"
    if status == "green" or nearer_s < _NEAR_S:
        return Finding(check, "green", found, expected)
    message = (
        f'the stamps of "{tracker.name}" are {in_ms(motion.lag_s.value)} later than those of "{stream.name}", where '
        f"{in_ms(stated_s)} is stated: lags and errors against the reference are off by {in_ms(abs(off_s))}; correct "
        "the clock of one of the two, or latency_s"
    )
    return Finding(check, status, found, expected, message)


def _size(tracker: Positions, stream: Positions, motion: Compared) -> Finding:
    scale = motion.scale.value
    apart = max(motion.scale.low, 1 / max(motion.scale_most, 1e-12))
    status = graded(apart, *_SIZE)
    message = ""
    if status != "green":
        smaller = scale < 1
        which, factor = (stream.name, 1 / scale) if smaller else (tracker.name, scale)
        message = (
            f'"{tracker.name}" moves {scale:.3g} times as far as "{stream.name}": "{which}" is probably in '
            f"{unit_of_positions(factor) or 'another unit'}; log metres"
        )
    return Finding(of(SIZE, stream.name), status, f"tracker moves {scale:.3g} times as far", "0.8 to 1.25", message)


def _frame(tracker: Positions, stream: Positions, motion: Compared) -> Finding:
    check, expected = of(AXES, stream.name), f"within {_TURN_DEG[0]:g}°, not mirrored"
    turn = motion.turn_deg
    mirrored = motion.mirrored >= _SURE
    status = "red" if mirrored else graded(turn.value, *_TURN_DEG)
    found = f"mirrored ({motion.axes})" if mirrored else f"turned by {turn.value:.0f}°"
    if status == "green" or (not mirrored and (turn.low < _TURN_CERTAIN_DEG or motion.flat)):
        return Finding(check, "green", found, expected)
    how = "is mirrored" if mirrored else f"is turned by {turn.value:.0f}°"
    message = (
        f'the movement of "{tracker.name}" {how} against that of "{stream.name}" (its x y z are the reference\'s '
        f"{motion.axes}): axes are exchanged, or of another frame; log both in one frame, or set rotation_xyzw of "
        f'"{stream.name}"'
    )
    return Finding(check, status, found, expected, message)


def _distance(recorded: Recorded, tracker: Positions, stream: Positions) -> Iterator[Finding]:
    """How far the tracker is from the reference at the time of its measurement, along the analysed axes."""
    time_s, first = np.unique(tracker.times.stamp_s - tracker.times.late_s, return_index=True)
    there_s, at = np.unique(stream.times.stamp_s - stream.times.late_s, return_index=True)
    if recorded.reference_motion is not None:  # a lag has a check of its own
        lag_s = recorded.reference_motion.lag_s.value
        there_s = there_s + lag_s - (tracker.times.late_s - stream.times.late_s)
    common = (time_s >= there_s[0]) & (time_s <= there_s[-1]) if len(there_s) else np.zeros(len(time_s), bool)
    if common.sum() < 20:
        return
    axes = list(recorded.axes)
    place = np.column_stack([np.interp(time_s[common], there_s, stream.value_mm[at][:, axis]) for axis in axes])
    apart = tracker.value_mm[first][common][:, axes] - place
    middle = np.median(apart, axis=0)
    offset = float(np.linalg.norm(middle))
    noise_mm = max(tracker.noise_sd_mm or 0.0, float(np.median(np.abs(apart - middle))) * 1.4826)
    strays_s = _strays_s(time_s[common], np.linalg.norm(apart - middle, axis=1), noise_mm)
    lasted_s = float(time_s[common][-1] - time_s[common][0])
    check, found = of(DISTANCE, stream.name), f"{offset:.3g} mm, {strays_s:.2g} s astray"
    expected = f"below {_APART_MM[0]:g} mm, {_STRAY_SHARE:.0%} astray"
    if offset > _APART_MM[0]:
        named = ", ".join(f"{value:.0f}" for value in middle)
        message = (
            f'"{tracker.name}" is {offset:.0f} mm from "{stream.name}" throughout ({named}), and all errors with it: '
            f'they have other origins, or are fixed to other places; set translation_mm of "{stream.name}"'
        )
        yield Finding(check, graded(offset, *_APART_MM), found, expected, message)
    elif strays_s > max(_STRAY_S, _STRAY_SHARE * lasted_s):
        message = (
            f'for {strays_s:.2g} s "{tracker.name}" and "{stream.name}" are far apart and agree otherwise: one of them '
            "was lost and held its position, or jumped to another place; leave that time out of the log"
        )
        yield Finding(check, "red" if strays_s > 0.1 * lasted_s else "amber", found, expected, message)
    else:
        yield Finding(check, "green", found, expected)


def _strays_s(time_s: FloatArray, far_mm: FloatArray, noise_mm: float) -> float:
    """For how many seconds, in pieces of half a second, most readings are farther than noise takes them."""
    piece = np.floor((time_s - time_s[0]) / _STRAY_S).astype(np.int64)
    count = np.bincount(piece)
    far = np.bincount(piece, far_mm > max(_STRAY_MM, _STRAY_SDS * noise_mm))
    return float(np.sum(far > 0.7 * np.maximum(count, 1)) * _STRAY_S)
