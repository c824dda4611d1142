"""Orientation and gyroscope: whether both describe the same turning, and whether quaternions have unit length."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.by_parts import each_part, sums_before, taken
from pipeline.sessions.checks.finding import Finding, Status, graded, of
from pipeline.sessions.checks.recorded import Imu, Recorded
from pipeline.sessions.checks.turning_causes import turning_cause
from pipeline.sessions.checks.turns import rotation_vector
from pipeline.statistics.arrays import FloatArray

TURNING, LENGTH, DISCLAIMED = "gyroscope", "orientation", "covariances"

_SPAN_S = 0.1  # over which turns are compared: longer than a reading, shorter than a turn
_TURNS_RAD_S = 0.05  # the root mean square of a phone that turns at all
_AMBER, _RED = 1.15, 1.6  # recordings without a fault: 0.97 to 1.01; degrees per second: 57
_ALIKE = 0.5  # correlation below which two turnings are not one
_DEGREES = (25.0, 130.0)
_STANDS = 0.05  # of the time
_LATE_STEPS = 10  # of 0.1 s
_CLOSE = 0.8  # correlation from which a factor is the likelier mistake
_OPPOSITE = -0.4  # of the turning of gravity; recordings without a fault: above 0
_STILL = 0.005  # of the other: less than any unit would make of it
_UNIT = (0.98, 1.02)
_SMOOTH_S = 0.5
_STRAY_SHARE = 0.001


def gyroscope(recorded: Recorded) -> Iterator[Finding]:
    """The gyroscope compared with how the orientation turns, or with how gravity turns if the log has no orientation.

    A phone that does not turn is not judged. Without an orientation, only degrees instead of radians are noticed.
    """
    for imu in recorded.imus:
        if len(imu.force_m_s2) < 20:
            continue
        if imu.oriented.sum() > len(imu.oriented) / 2:
            yield from _against_orientation(imu)
        else:
            yield from _against_gravity(imu)


def _against_orientation(imu: Imu) -> Iterator[Finding]:
    turning = _turning(imu)
    if turning is None:
        return
    rate, measured, spans = turning
    turns, reads = _rms(rate), _rms(measured)
    expected = "0.87 to 1.15 times the turning of the orientation"
    if max(turns, reads) < _TURNS_RAD_S:
        return
    alike = _correlation(rate, measured)
    stands = np.all(rate == 0.0, axis=1) & (np.linalg.norm(measured, axis=1) > _TURNS_RAD_S)
    if stands.mean() > _STANDS and alike >= _ALIKE / 2:
        yield Finding(
            of(TURNING, imu.name),
            "red",
            f"the orientation stands still for {stands.mean():.0%} of the time",
            expected,
            f'the gyroscope of "{imu.name}" turns and its orientation stands still for {stands.mean():.0%} of the '
            "time: it froze; leave that time out, or say that it is unknown by orientation_covariance[0] = -1",
        )
        return
    late_s = _late_s(rate, measured)
    if late_s is not None:
        yield Finding(
            of(TURNING, imu.name),
            "amber",
            f"the orientation turns {late_s:+.1f} s after the gyroscope",
            expected,
            f'the orientation of "{imu.name}" turns {abs(late_s):.1f} s {"after" if late_s > 0 else "before"} its '
            "gyroscope: it is of another message or filtered with a delay; log both as of one instant",
        )
        return
    if turns < _STILL * reads and alike < _ALIKE:
        yield Finding(
            of(TURNING, imu.name),
            "red",
            f"turns by {reads:.2g} rad/s, the orientation does not",
            expected,
            f'the gyroscope of "{imu.name}" turns and its orientation does not: the orientation is frozen or a '
            "placeholder; log the real one, or say that it is unknown by orientation_covariance[0] = -1",
        )
        return
    if reads < _STILL * turns:
        yield Finding(
            of(TURNING, imu.name),
            "amber",
            f"{reads:.2g} rad/s while the orientation turns by {turns:.2g}",
            expected,
            f'the orientation of "{imu.name}" turns and its gyroscope reads nothing: it is not logged; log it, '
            "for it carries an orientation over gaps",
        )
        return
    ratio = float(np.sum(rate * measured) / np.sum(rate**2))
    found = f"{ratio:.3g} times, correlation {alike:.2f}"
    status: Status = "red" if alike < _ALIKE else graded(max(ratio, 1 / max(ratio, 1e-9)), _AMBER, _RED)
    message = "" if status == "green" else _turning_message(imu, ratio, alike, turning_cause(*spans, measured))
    yield Finding(of(TURNING, imu.name), status, found, expected, message)


def turning(imu: Imu) -> tuple[float, float] | None:
    """How fast the orientation turns (root mean square, rad/s), and its correlation with the gyroscope.

    None where less than 2 s have an orientation.
    """
    found = _turning(imu)
    if found is None:
        return None
    rate, measured, _ = found
    return _rms(rate), _correlation(rate, measured)


def _correlation(rate: FloatArray, measured: FloatArray) -> float:
    return float(np.sum(rate * measured) / max(np.sqrt(np.sum(rate**2) * np.sum(measured**2)), 1e-300))


def _turning_message(imu: Imu, ratio: float, alike: float, cause: str) -> str:
    if alike >= _ALIKE and _DEGREES[0] < ratio < _DEGREES[1]:
        return (
            f'the gyroscope of "{imu.name}" reads {ratio:.0f} times what the orientation turns: it is in degrees per '
            "second; multiply by π/180 when logging"
        )
    if cause and alike < _CLOSE:
        return f'gyroscope and orientation of "{imu.name}" do not describe one turning: {cause}'
    if alike < _ALIKE:
        return (
            f'gyroscope and orientation of "{imu.name}" do not describe one turning: the orientation is inverted (the '
            "conjugate) or in another order (w first), or the gyroscope's axes are exchanged; log x, y, z, w from body "
            "to tracker frame"
        )
    return (
        f'the gyroscope of "{imu.name}" reads {ratio:.2g} times what the orientation turns: its unit or range is '
        "wrong, or the orientation is smoothed; log rad/s"
    )


def _turning(imu: Imu) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray, FloatArray]] | None:
    """Angular velocities (k, 3) in rad/s by the orientation and by the gyroscope, each over 0.1 s.

    And the orientations (k, 4) at both ends of each span, with its length (k,) in s.
    """
    time, gyroscope, orientation = imu.times.stamp_s, imu.gyroscope, imu.orientation
    if not imu.oriented.all() or (time[1:] < time[:-1]).any():
        rows = np.flatnonzero(imu.oriented)
        order = rows[np.argsort(time[rows], kind="stable")]
        time, gyroscope, orientation = time[order], imu.gyroscope_rad_s[order], imu.orientation_xyzw[order]
    if time[-1] - time[0] < 2.0:
        return None
    starts = np.searchsorted(time, np.arange(time[0], time[-1], _SPAN_S))
    starts = np.unique(starts[starts < len(time)])
    first, last = starts[:-1], starts[1:]
    span = time[last] - time[first]
    whole = (span > _SPAN_S / 2) & (span < 2 * _SPAN_S)
    total = sums_before(each_part(gyroscope), starts)
    measured = (total[1:] - total[:-1])[whole] / (last - first)[whole, None]
    if whole.sum() < 10:
        return None
    before, after = (taken(orientation, at[whole]) for at in (first, last))
    spans = before, after, span[whole]
    return rotation_vector(before, after) / span[whole, None], measured, spans


def _late_s(rate: FloatArray, measured: FloatArray) -> float | None:
    """How much later the orientation turns than the gyroscope, in steps of 0.1 s; None below 0.2 s or if none fits."""
    count = len(rate) - 2 * _LATE_STEPS
    if count < 50:
        return None
    middle = measured[_LATE_STEPS : _LATE_STEPS + count]
    alike = []
    for shift in range(2 * _LATE_STEPS + 1):
        alike.append(_correlation(rate[shift : shift + count], middle))
    best = int(np.argmax(alike))
    if abs(best - _LATE_STEPS) < 2 or alike[best] < 0.9 or alike[best] < alike[_LATE_STEPS] + 0.01:
        return None
    return (best - _LATE_STEPS) * _SPAN_S


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))


def _against_gravity(imu: Imu) -> Iterator[Finding]:
    """In the phone's frame the vertical u turns by du/dt = u × ω; smoothed, the force points along u."""
    ratio = _gravity_ratio(imu)
    if ratio is None:
        return
    slope, alike = ratio
    found, expected = f"{slope:.2g} times the turning of gravity", "0.1 to 3 times"
    if alike < _OPPOSITE:
        degrees = ", and it is in degrees per second: multiply by -π/180" if slope > 10 else ""
        message = (
            f'the gyroscope of "{imu.name}" turns against what gravity turns (correlation {alike:.2f}): its sign is '
            f"flipped{degrees}; change the sign of all three axes when logging"
        )
        yield Finding(of(TURNING, imu.name), "red", found, expected, message)
        return
    if alike < 0.3 or slope < 10:
        yield Finding(of(TURNING, imu.name), "green", found, expected)
        return
    yield Finding(
        of(TURNING, imu.name),
        "red",
        found,
        expected,
        f'the gyroscope of "{imu.name}" reads {slope:.0f} times what gravity turns: it is in degrees per second; '
        "multiply by π/180 when logging",
    )


def _gravity_ratio(imu: Imu) -> tuple[float, float] | None:
    """How much faster the gyroscope turns than the vertical, and their correlation; None if neither turns."""
    time, first = np.unique(imu.times.stamp_s, return_index=True)
    if len(time) < 50 or time[-1] - time[0] < 5.0:
        return None
    step = float(np.median(np.diff(time)))
    width = max(1, round(_SMOOTH_S / step))
    force, rate = imu.force_m_s2[first], imu.gyroscope_rad_s[first]
    smooth = _running_mean(force, width)
    vertical = smooth / np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-9)
    middle = slice(width // 2, width // 2 + len(vertical))
    turn = np.cross(vertical, rate[middle])
    moved = (vertical[width:] - vertical[:-width]) / (time[middle][width:] - time[middle][:-width])[:, None]
    turned = _running_mean(turn, width)[: len(moved)]
    if len(moved) < 20 or _rms(moved) < _TURNS_RAD_S:
        return None
    product, own, other = np.sum(moved * turned), np.sum(moved**2), np.sum(turned**2)
    if other == 0:
        return None
    alike = float(product / np.sqrt(own * other))
    return float(np.sqrt(other / own)), alike


def _running_mean(values: FloatArray, width: int) -> FloatArray:
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    found: FloatArray = (total[width:] - total[:-width]) / width
    return found


def length(recorded: Recorded) -> Iterator[Finding]:
    """The length of the logged quaternions: 1 for a rotation, 0 if the driver did not set it."""
    for imu in recorded.imus:
        given = imu.orientation_length[np.isfinite(imu.orientation_length)]
        if not len(given):
            continue
        wrong = given[(given < _UNIT[0]) | (given > _UNIT[1])]
        expected = "1"
        if len(wrong) <= _STRAY_SHARE * len(given):
            yield Finding(of(LENGTH, imu.name), "green", f"{np.median(given):.3g}", expected)
            continue
        share = len(wrong) / len(given)
        zero = bool(np.median(wrong) == 0)
        cause = (
            "nobody filled it in; say that it is unknown by orientation_covariance[0] = -1, or log it"
            if zero
            else "it is no rotation; log a unit quaternion x, y, z, w"
        )
        yield Finding(
            of(LENGTH, imu.name),
            "amber" if zero else "red",
            f"{np.median(wrong):.3g} in {share:.0%} of the messages",
            expected,
            f'the orientation of "{imu.name}" is {"all zeros" if zero else f"{np.median(wrong):.3g} long"} in '
            f"{len(wrong)} messages: {cause}",
        )


def covariances(recorded: Recorded) -> Iterator[Finding]:
    """A covariance of −1 says that the values are to be ignored (sensor_msgs/Imu); here they are still used.

    Some drivers set it beside good values, so values that vary are amber, and only zeros are red.
    """
    for imu in recorded.imus:
        for what, disclaimed, values in (
            ("linear_acceleration", imu.force_disclaimed, imu.force_m_s2),
            ("angular_velocity", imu.gyroscope_disclaimed, imu.gyroscope_rad_s),
        ):
            if not disclaimed.any():
                continue
            empty = bool(np.all(values[disclaimed] == 0))
            message = (
                f'"{imu.name}" has no {what}: its values are all zero and to be disregarded, by '
                f"{what}_covariance[0] = -1 or because the log has none (gyroscope and accelerometer may be on two "
                "topics, or in files apart); log them together"
                if empty
                else f'"{imu.name}" says by {what}_covariance[0] = -1 that its {what} is to be disregarded; the values '
                "do vary, and they are used; correct the covariance in the driver if they are good"
            )
            yield Finding(
                of(DISCLAIMED, f"{imu.name} {what}"),
                "red" if empty else "amber",
                f"{'none' if empty else f'{what}_covariance[0] is -1'} in {int(disclaimed.sum())} messages",
                "values" if empty else "not -1",
                message,
            )
