"""Tracker against phone: lag, units, axes and frame, from one movement that both saw."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.band import rising
from pipeline.sessions.checks.finding import Finding, Status, graded, of
from pipeline.sessions.checks.motion import Compared, Interval
from pipeline.sessions.checks.recorded import Imu, Positions, Recorded
from pipeline.study.units import G_M_S2

LAG, SIZE, AXES, SPEED = "lag", "size of the movement", "frame of the movement", "speed"
LAG_UNKNOWN = "cannot be told from this movement"

_EXPLAINED_MIN = 0.15  # of the movement; recordings without a fault reach 0.66 to 0.99
LAG_AMBER_S, LAG_RED_S = 0.03, 0.075  # recordings without a fault are within 0.01
_UPRIGHT_S = 0.015  # an orientation from gyroscope and accelerometer alone bends the lag by up to 0.026
_LAG_CERTAIN_S = 0.012  # by how much the nearer end of the interval must be off
_LAG_WIDE_S = 0.15
_SIZE_AMBER, _SIZE_RED = 2.0, 5.0  # recordings without a fault: 0.65 to 1.03
_TURN_AMBER_DEG, _TURN_RED_DEG = 20.0, 40.0  # 0.4 to 9
_TURN_CERTAIN_DEG = 15.0
_SURE = 0.99
SPEED_MM_S = 8_000.0  # a thrown ball is faster; a hand that points is not, over 0.2 s and in one reading of ten
_OVER_S = 0.2
_DRIFTS_S = 0.1  # from one half of the session to the other
_UNITS = (
    (1000.0, "millimetres"),
    (100.0, "centimetres"),
    (39.37, "inches"),
    (10.0, "decimetres"),
    (3.281, "feet"),
    (0.001, "kilometres"),
)
_FORCES = ((1e3, "mm/s²"), (1e2, "cm/s² or thousandths of g"), (3.281, "feet/s²"), (1 / G_M_S2, "g"))
_UNIT_NEAR = 1.4  # the figure of the size is bent by up to a third, and units are further apart


def see_one_movement(motion: Compared | None) -> bool:
    """Whether both sensors see one movement, and see it well enough to be compared."""
    return motion is not None and motion.explained >= _EXPLAINED_MIN and motion.lag_s.width < 2 * _LAG_WIDE_S


def expected_lag_s(tracker: Positions, imu: Imu) -> float:
    """How much later the tracker's stamps are than the phone's, by what study.yaml says."""
    return tracker.times.late_s - imu.times.late_s


def lag(recorded: Recorded) -> Iterator[Finding]:
    """The lag between tracker and phone, compared with `stamp` and `latency_s`.

    It stays unknown where the hand rests, or moves so regularly that several lags fit. A lag that both sensors share
    cannot be seen.
    """
    tracker, imu = recorded.tracker, recorded.imu
    if tracker is None or imu is None:
        return
    motion, stated_s = recorded.motion, expected_lag_s(tracker, imu)
    expected = f"{in_ms(stated_s)} by study.yaml"
    if motion is None or not see_one_movement(motion) or motion.lag_s.width > _LAG_WIDE_S or motion.lag_beyond:
        yield Finding(LAG, "green", LAG_UNKNOWN, expected)
        return
    found = lag_text(motion.lag_s)
    off_s = motion.lag_s.value - stated_s
    nearer_s = max(motion.lag_s.low - stated_s, stated_s - motion.lag_s.high)
    slack_s = 0.0 if np.isfinite(motion.turn_deg.value) else _UPRIGHT_S
    status = graded(abs(off_s) - slack_s, LAG_AMBER_S, LAG_RED_S)
    if status == "green" or nearer_s < _LAG_CERTAIN_S + slack_s:
        yield Finding(LAG, "green", found, expected)
        return
    if abs(motion.drift_s) > _DRIFTS_S:
        message = (
            f'how much later the stamps of "{tracker.name}" are than those of "{imu.name}" changes by '
            f"{in_ms(abs(motion.drift_s))} between the halves of the session: one clock runs faster, or was set; log "
            "both with one clock"
        )
        yield Finding(LAG, status, found, expected, message)
        return
    yield Finding(LAG, status, found, expected, lag_message(tracker, imu, motion.lag_s.value, off_s))


def lag_message(tracker: Positions, imu: Imu, lag_s: float, off_s: float) -> str:
    """What a lag that study.yaml does not state comes from, and what to set."""
    later = f'the stamps of "{tracker.name}" are {in_ms(lag_s)} later than those of "{imu.name}"'
    if off_s > 0 and tracker.times.late_s == 0:
        latency = f"{max(0.0, lag_s + imu.times.late_s):.2f}"
        return (
            f"{later}, so it probably stamps on arrival: set stamp: arrival and latency_s: {latency} on it, "
            "or correct the clocks"
        )
    if tracker.times.late_s > 0:
        return (
            f"{later} and study.yaml says {in_ms(tracker.times.late_s - imu.times.late_s)}: set latency_s: "
            f"{max(0.0, lag_s + imu.times.late_s):.2f} on it, or correct the clock of one of the two"
        )
    return (
        f'the stamps of "{imu.name}" are {in_ms(-lag_s)} later than those of "{tracker.name}": the phone probably '
        "stamps on arrival, or the clocks differ; set stamp: arrival and latency_s on it, or correct the clocks"
    )


def lag_text(lag_s: Interval) -> str:
    """A lag with its interval, in milliseconds."""
    return f"{in_ms(lag_s.value)} [{1e3 * lag_s.low:.0f}, {1e3 * lag_s.high:.0f}]"


def in_ms(seconds: float) -> str:
    """A time in whole milliseconds, as messages have it."""
    return f"{round(1e3 * seconds)} ms"


def size(recorded: Recorded) -> Iterator[Finding]:
    """How far the tracker moves over how far the phone moves; units that differ are off by 10 and more.

    A factor below two is not seen: a lever arm between the two and noise bend the figure by a third.
    """
    tracker, imu, motion = recorded.tracker, recorded.imu, recorded.motion
    if tracker is None or imu is None or motion is None or not see_one_movement(motion):
        return
    apart = max(motion.scale.low, 1 / max(motion.scale_most, 1e-12))
    status = graded(apart, _SIZE_AMBER, _SIZE_RED)
    found, expected = f"tracker moves {_times(motion.scale.value)} as far as the phone says", "0.5 to 2 times"
    if status == "green":
        yield Finding(SIZE, status, found, expected)
        return
    yield Finding(SIZE, status, found, expected, _size_message(tracker, imu, motion.scale.value))


def unit_of_positions(factor: float) -> str:
    """What positions that are so many times too large are in where metres are expected; "" if no unit is near."""
    near = [unit for size, unit in _UNITS if 1 / _UNIT_NEAR < factor / size < _UNIT_NEAR]
    return f"{near[0]} where metres are expected" if near else ""


def _size_message(tracker: Positions, imu: Imu, scale: float) -> str:
    start = f'"{tracker.name}" moves {_times(scale)} as far as "{imu.name}" says: '
    position = unit_of_positions(scale)
    force = [unit for size, unit in _FORCES if 1 / _UNIT_NEAR < 1 / scale / size < _UNIT_NEAR]
    if position and force:
        return f"{start}its positions are in {position}, or the accelerations in {force[0]}; log metres and m/s²"
    if position:
        return f"{start}its positions are probably in {position}; convert to metres when logging"
    if force:
        return f"{start}the accelerations are probably in {force[0]} where m/s² is expected; log m/s²"
    if scale > 1:
        return f"{start}its positions or the accelerations are in another unit (g is 9.8 m/s²); log metres and m/s²"
    return (
        f"{start}positions or accelerations are in another unit, or the tracker holds still while the phone moves; log "
        "metres and m/s²"
    )


def _times(scale: float) -> str:
    return f"{scale:.3g} times"


def frame(recorded: Recorded) -> Iterator[Finding]:
    """Whether the tracker's axes are the phone's: mirrored, exchanged, or turned.

    Below 20° nothing is said: recordings without a fault read up to 9°, and a heading that is 20° off reads 12°. An
    axis along which nothing moves is not judged, nor a turn about the vertical where the log has no orientation.
    """
    tracker, imu, motion = recorded.tracker, recorded.imu, recorded.motion
    if tracker is None or imu is None or motion is None or not see_one_movement(motion):
        return
    expected = "within 20°, not mirrored"
    if motion.mirrored >= _SURE:
        found = f"mirrored ({motion.axes})" if motion.axes else "mirrored"
        yield Finding(AXES, "red", found, expected, _mirror_message(tracker, imu, motion))
        return
    angle = motion.turn_deg
    if not np.isfinite(angle.value):
        yield Finding(AXES, "green", "not mirrored; the heading is not known", expected)
        return
    status: Status = graded(angle.value, _TURN_AMBER_DEG, _TURN_RED_DEG)
    if status == "green" or angle.low < _TURN_CERTAIN_DEG:
        yield Finding(AXES, "green", f"turned by {angle.value:.0f}°", expected)
        return
    yield Finding(
        AXES,
        status,
        f"turned by {angle.value:.0f}° ({motion.axes})",
        expected,
        f'the movement of "{imu.name}" is turned by {angle.value:.0f}° against that of "{tracker.name}" (its x y z are '
        f"the phone's {motion.axes}): the tracker's axes are in another order (y up instead of z up), or the "
        "orientation refers to another heading; turn the positions into the frame of the orientation when logging",
    )


def _mirror_message(tracker: Positions, imu: Imu, motion: Compared) -> str:
    if motion.axes == "-x -y -z":
        return (
            f'the accelerations of "{imu.name}" point against the movement of "{tracker.name}": their sign is flipped '
            "(iOS logs the acceleration of gravity, not the specific force); change the sign when logging"
        )
    named = f" (its x y z are the phone's {motion.axes})" if motion.axes else ""
    return (
        f'the movement of "{tracker.name}" is the mirror image of that of "{imu.name}"{named}: '
        "one of the frames is left-handed or two axes are exchanged; log right-handed axes in the "
        "order x, y, z"
    )


def speed(recorded: Recorded) -> Iterator[Finding]:
    """How fast each stream of positions moves over 0.2 s, in its fastest tenth."""
    for positions in recorded.positions:
        fastest = _fastest_tenth(positions)
        if not np.isfinite(fastest):
            continue
        found, expected = f"{fastest / 1e3:.2g} m/s", f"below {SPEED_MM_S / 1e3:g} m/s"
        if fastest <= SPEED_MM_S:
            yield Finding(of(SPEED, positions.name), "green", found, expected)
            continue
        yield Finding(
            of(SPEED, positions.name),
            "red",
            found,
            expected,
            f'"{positions.name}" moves at {fastest / 1e3:.3g} m/s, which no hand does: its positions are probably in '
            "millimetres where metres are expected, or its stamps in another unit; convert when logging",
        )


def _fastest_tenth(positions: Positions) -> float:
    """The speed in mm/s that a tenth of the steps of 0.2 s exceed; NaN where the stream is shorter than 1 s."""
    time_s, value = rising(positions.times.stamp_s, positions.value_mm)
    if len(time_s) < 5 or time_s[-1] - time_s[0] < 1.0:
        return float("nan")
    later = np.searchsorted(time_s, time_s + _OVER_S)
    there = later < len(time_s)
    moved = np.linalg.norm(value[later[there]] - value[there.nonzero()[0]], axis=1)
    return float(np.percentile(moved / (time_s[later[there]] - time_s[there]), 90))
