"""Values that no sensor gives: exact zeros, held positions, frozen and clipped readings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from pipeline.sessions.checks.finding import Finding, graded, of
from pipeline.sessions.checks.recorded import Positions, Recorded
from pipeline.statistics.arrays import FloatArray

ZEROS, HELD, FROZEN, CLIPPED = "exact zeros", "held positions", "frozen readings", "clipped readings"

_HELD_S, _FROZEN_S = 0.3, 0.3
_REPUBLISHED = 0.2  # share of positions that repeat the one before
_STEPS_APART = 1e6  # of the least step in a usual one
_COARSE = 0.25  # of the stated noise: a position that is so coarsely rounded repeats by itself
_CLIPPED_RUN, _CLIPPED_SHARE = 4, 0.001
_STEPS_MIN = 200  # of the resolution within the range: with fewer the largest reading comes often by itself
_JUMP_MM = 20.0


def zeros(recorded: Recorded) -> Iterator[Finding]:
    """Positions that are exactly (0, 0, 0): many trackers send them while they see nothing."""
    for positions in recorded.positions:
        value = positions.value_mm
        if not len(value):
            continue
        count = int(np.sum(np.all(value == 0.0, axis=1)))
        found, expected = f"{count}", "0"
        if count == 0 or not jumps_to_zero(value):
            yield Finding(of(ZEROS, positions.name), "green", found, expected)
            continue
        yield Finding(
            of(ZEROS, positions.name),
            graded(count / len(value), 0.0, 0.005),
            f"{found} of {len(value)}",
            expected,
            f'"{positions.name}" is exactly (0, 0, 0) in {count} of {len(value)} messages: the tracker sends zeros '
            "while it sees nothing; send nothing then, or leave those messages out of the log",
        )


def jumps_to_zero(value: FloatArray) -> bool:
    """Is the origin jumped to, as no movement does that begins there or passes through it?"""
    zero = np.all(value == 0.0, axis=1)
    edges = np.flatnonzero(np.diff(zero.astype(np.int8)))
    jumps = np.linalg.norm(value[edges + 1] - value[edges], axis=1)
    steps = np.linalg.norm(np.diff(value[~zero], axis=0), axis=1)
    return len(jumps) > 0 and float(np.median(jumps)) > max(
        _JUMP_MM, 3.0 * float(np.median(steps)) if len(steps) else 0
    )


def held(recorded: Recorded) -> Iterator[Finding]:
    """Positions that repeat to the last digit under new stamps: a lost tracker, or one that is sent on twice.

    A tracker that rounds coarsely repeats itself while the hand is still, and is not judged.
    """
    for positions in recorded.positions:
        if positions.kind != "position" or len(positions.value_mm) < 10 or _coarse(positions):
            continue
        order = np.argsort(positions.times.stamp_ns, kind="stable")
        time, value = positions.times.stamp_s[order], positions.value_mm[order]
        same = np.all(np.diff(value, axis=0) == 0.0, axis=1) & (np.diff(time) > 0)
        same &= ~np.all(value[1:] == 0.0, axis=1)  # zeros have a check of their own
        share, longest_s = float(same.mean()), _longest(time, same)
        found = f"{share:.1%}, at most {longest_s:.2g} s"
        expected = "no repeats"
        if longest_s > _HELD_S:
            message = (
                f'"{positions.name}" holds one position for up to {longest_s:.2g} s: the tracker sends its last '
                "position on while it sees nothing; send nothing then, or leave the repeats out of the log"
            )
            yield Finding(of(HELD, positions.name), "red" if longest_s > 1.0 else "amber", found, expected, message)
        elif share > _REPUBLISHED:
            message = (
                f'{share:.0%} of the positions of "{positions.name}" repeat the one before: they are sent on faster '
                "than the tracker measures; log the tracker's own topic, each measurement once with its own stamp"
            )
            yield Finding(of(HELD, positions.name), "amber", found, expected, message)
        else:
            yield Finding(of(HELD, positions.name), "green", found, expected)


def _coarse(positions: Positions) -> bool:
    """Is the smallest step between different readings of an axis of the order of the noise?"""
    noise = positions.noise_sd_mm
    for column in positions.value_mm.T:
        steps = np.diff(np.unique(column))
        if len(steps) and noise is not None and float(np.median(steps)) > _COARSE * noise and len(steps) < 1000:
            least = float(steps.min())
            if least * _STEPS_APART < float(np.median(steps)):
                return False  # no grid has such a step; and what is divided by it may be too large for any number
            return len(np.unique(np.round(steps / least, 3) % 1.0)) < 3
    return False


def _longest(time: FloatArray, same: npt.NDArray[np.bool_]) -> float:
    """The longest stretch in s in which each value is that before."""
    if not same.any():
        return 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    return float(np.max(time[edges[1::2]] - time[edges[::2]]))


def frozen(recorded: Recorded) -> Iterator[Finding]:
    """An accelerometer whose three values stay the same to the last digit; its noise alone would not let it."""
    for imu in recorded.imus:
        if len(imu.force_m_s2) < 20 or not np.any(imu.force_m_s2):
            continue
        time, force = imu.times.stamp_s, imu.force_m_s2
        if (time[1:] < time[:-1]).any():
            order = np.argsort(imu.times.stamp_ns, kind="stable")
            time, force = time[order], force[order]
        same = np.all(force[1:] == force[:-1], axis=1) & (time[1:] > time[:-1])
        longest_s, share = _longest(time, same), float(same.mean())
        found, expected = f"{share:.1%}, at most {longest_s:.2g} s", f"at most {_FROZEN_S:g} s"
        if longest_s <= _FROZEN_S and share < 0.5:
            yield Finding(of(FROZEN, imu.name), "green", found, expected)
            continue
        message = (
            f'"{imu.name}" repeats one reading for up to {longest_s:.2g} s ({share:.0%} of the messages): the sensor '
            "or its driver has stopped, or is sent on faster than it measures; leave the repeats out, or record anew"
        )
        yield Finding(of(FROZEN, imu.name), "red" if longest_s > 2.0 else "amber", found, expected, message)


def clipped(recorded: Recorded) -> Iterator[Finding]:
    """Readings that rest at the largest or smallest value of an axis: the sensor's range was too small."""
    for imu in recorded.imus:
        for what, values, unit in (
            ("specific force", imu.force_m_s2, "m/s²"),
            ("angular velocity", imu.gyroscope_rad_s, "rad/s"),
        ):
            if len(values) < 100:
                continue
            count, limit = max((_at_limit(column) for column in values.T), key=lambda one: one[0])
            found, expected = f"{count} at the limit of the {what}", "0"
            if count <= _CLIPPED_SHARE * len(values):
                yield Finding(of(CLIPPED, f"{imu.name} {what}"), "green", found, expected)
                continue
            yield Finding(
                of(CLIPPED, f"{imu.name} {what}"),
                "red" if count > 0.05 * len(values) else "amber",
                found,
                expected,
                f'{count} readings of "{imu.name}" rest at {limit:.3g} {unit}: the {what} was clipped at the end of '
                "the sensor's range; set a larger range",
            )


def _at_limit(column: FloatArray) -> tuple[int, float]:
    """How many readings stay at the largest or the smallest value for several in a row, and that value."""
    worst = (0, 0.0)
    for limit in (float(column.max()), float(column.min())):
        at = column == limit
        edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(np.int8)))
        runs = edges[1::2] - edges[::2]
        count = int(runs[runs >= _CLIPPED_RUN].sum())
        if count > worst[0] and len(np.unique(column)) > _STEPS_MIN:
            worst = count, limit
    return worst
