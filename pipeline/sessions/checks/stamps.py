"""Time stamps: repeated, rounded, bunched, in another unit, or from a clock that was set during the recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.by_parts import parts_of
from pipeline.sessions.checks.finding import Finding, graded, of
from pipeline.sessions.checks.recorded import Recorded, Times
from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.sampling import BUNCHED
from pipeline.statistics.arrays import FloatArray

DOUBLED, ROUNDED, RATE, BURSTS, REGULAR, STEPS = (
    "identical stamps",
    "rounded stamps",
    "rate",
    "bursts",
    "regular stamps",
    "clock",
)

_DOUBLED_AMBER, _DOUBLED_RED = 0.01, 0.5
_FASTEST_HZ = 5_000.0  # no tracker or phone measures so often; stamps of ms or µs in a field of ns look like 1e6 Hz
_SLOWEST_HZ = 1.0
_PHONE_HZ = 20.0  # a hand's accelerations reach 10 Hz (see docs/checks.md)
_ROUNDINGS_S = (1.0, 0.1, 0.01)
_IRREGULAR = 0.5  # SD of the usual steps over their median; recordings without a fault: up to 0.1
_STEP_S = 0.05  # of a clock
_AROUND = 15  # messages to each side of a step


def _streams(recorded: Recorded) -> Iterator[tuple[str, Times]]:
    for one in recorded.streams:
        if len(one.times.stamp_ns) >= 10:
            yield one.name, one.times


def doubled(recorded: Recorded) -> Iterator[Finding]:
    """Messages that share a stamp: sent twice, or stamped more coarsely than they are measured."""
    for name, times in _streams(recorded):
        steps = times.steps_s
        count = int(np.sum(steps == 0))
        found, expected = f"{count}", "0"
        status = graded(count / len(steps), _DOUBLED_AMBER, _DOUBLED_RED)
        message = ""
        if status != "green":
            message = (
                f'{count} messages of "{name}" have the stamp of another ({count / len(steps):.0%}): they are sent '
                "twice, two nodes publish on the topic, or the stamps are coarser than the rate; log each measurement "
                "once, with its own stamp"
            )
        yield Finding(of(DOUBLED, name), status, found, expected, message)


def rounded(recorded: Recorded) -> Iterator[Finding]:
    """Stamps that are all multiples of a second, a tenth or a hundredth, with several messages to each."""
    for name, times in _streams(recorded):
        since = times.stamp_ns
        for unit_s in _ROUNDINGS_S:
            unit_ns = round(unit_s * 1e9)
            if np.all((since - since[0]) % unit_ns == 0) and float(np.mean(times.steps_s == 0)) > _DOUBLED_AMBER:
                message = (
                    f'every stamp of "{name}" is a multiple of {unit_s:g} s: its nanoseconds are lost; log sec and '
                    "nanosec, or set stamp: arrival"
                )
                yield Finding(of(ROUNDED, name), "red", f"to {unit_s:g} s", "nanoseconds", message)
                break


def rate(recorded: Recorded) -> Iterator[Finding]:
    """How often a stream measures by its own stamps; beyond 5 kHz and below 1 Hz they are of another unit.

    A phone below 20 Hz misses most of what a reach accelerates.
    """
    phones = {imu.name for imu in recorded.imus}
    for name, times in _streams(recorded):
        steps = times.steps_s[times.steps_s > 0]
        if not len(steps):
            yield Finding(
                of(RATE, name),
                "red",
                "one stamp for all messages",
                "1 to 5000 Hz",
                f'all messages of "{name}" have the same stamp: the sender does not stamp; stamp each measurement, or '
                "set stamp: arrival",
            )
            continue
        hz = 1.0 / float(np.median(steps))
        found, expected = f"{hz:.4g} Hz", "1 to 5000 Hz"
        if name in phones and _SLOWEST_HZ <= hz < _PHONE_HZ:
            message = (
                f'"{name}" measures {hz:.3g} times a second, too seldom for the accelerations of a hand: set its '
                "rate to 50 Hz and more, as apps do by an option of theirs"
            )
            yield Finding(of(RATE, name), "amber", found, f"{_PHONE_HZ:g} to 5000 Hz", message)
        elif _SLOWEST_HZ <= hz <= _FASTEST_HZ:
            yield Finding(of(RATE, name), "green", found, expected)
        elif hz > _FASTEST_HZ:
            unit = "microseconds" if hz < 1e6 else "milliseconds"
            message = (
                f'by its stamps "{name}" measures {hz:.3g} times a second, which no sensor does: {unit} or another '
                "unit stand where nanoseconds are expected; multiply the stamps when logging"
            )
            yield Finding(of(RATE, name), "red", found, expected, message)
        else:
            message = (
                f'by its stamps "{name}" measures every {1 / hz:.3g} s: its stamps are of another unit, or most '
                "messages are missing; check the recorder"
            )
            yield Finding(of(RATE, name), "amber", found, expected, message)


def bursts(recorded: Recorded) -> Iterator[Finding]:
    """Stamps that bunch: many in no time, then a pause; a packet's readings were stamped as it arrived."""
    for name, times in _streams(recorded):
        steps = times.steps_s
        mean = float(np.mean(steps[steps <= np.percentile(steps, 99.5)]))
        median = float(np.median(steps))
        if mean <= 0 or median >= BUNCHED * mean or float(np.mean(steps == 0)) > _DOUBLED_RED:
            yield Finding(of(BURSTS, name), "green", "none", "none")
            continue
        size = max(2, round(1.0 / float(np.mean(steps > mean))))
        message = (
            f'the stamps of "{name}" come in bursts of about {size}: the readings of a packet were stamped as it '
            "arrived; stamp each with its own time of measurement"
        )
        yield Finding(of(BURSTS, name), "amber", f"about {size} at a time", "none", message)


def regular(recorded: Recorded) -> Iterator[Finding]:
    """How regular the steps between stamps are, lost messages aside."""
    for name, times in _streams(recorded):
        spread = irregularity(times.steps_s)
        if spread is None:
            continue
        found, expected = f"{spread:.0%} of a step", f"at most {_IRREGULAR:.0%}"
        if spread <= _IRREGULAR:
            yield Finding(of(REGULAR, name), "green", found, expected)
            continue
        message = (
            f'the stamps of "{name}" are irregular, by {spread:.0%} of a step: they tell when a message was handled, '
            "not when it was measured; stamp in the sensor's driver"
        )
        yield Finding(of(REGULAR, name), "amber", found, expected, message)


def irregularity(steps_s: FloatArray) -> float | None:
    """SD of the steps that are no gaps, over their median; None where stamps repeat or there are too few."""
    steps = steps_s[steps_s > 0]
    if len(steps) < 50:
        return None
    usual = float(np.median(steps))
    kept = steps[steps < 1.9 * usual]
    return float(np.std(kept) / usual) if len(kept) > 20 else None


def clock(recorded: Recorded) -> Iterator[Finding]:
    """A clock that was set during the recording: stamps and arrivals drift apart for good, or both go back together."""
    for name, times in _streams(recorded):
        parted = _parted(times)
        back = _back(times.arrival_ns)
        expected = "no step"
        if parted is not None:
            at_s, by_s = parted
            message = (
                f'{at_s:.0f} s into the session the stamps of "{name}" {"fall behind" if by_s > 0 else "run ahead of"} '
                f"their arrivals by {abs(by_s):.2f} s and stay so: its clock was set; use a clock that is not set "
                "while recording, or cut the log there"
            )
            yield Finding(of(STEPS, name), "red", f"{by_s:+.2f} s at {at_s:.0f} s", expected, message)
        elif back is not None:
            at, by_s = back
            at_s = float(times.arrival_s[at] - times.arrival_s.min())
            message = (
                f'{at_s:.0f} s into the session the recorder\'s clock goes back by {by_s:.2f} s ("{name}"): it was set '
                "while recording, or parts of the file are in another order, as of joined logs; use a clock that "
                "is not set, or cut the log there"
            )
            yield Finding(of(STEPS, name), "red", f"-{by_s:.2f} s at {at_s:.0f} s", expected, message)
        else:
            yield Finding(of(STEPS, name), "green", "none", expected)


def _parted(times: Times) -> tuple[float, float] | None:
    """When and by how much (s) the delay of arrivals jumps from one steady level to another; None if it does not.

    A busy network delays some messages, but a clock that was set shifts all of them, so the delay's range is compared.
    """
    order = np.argsort(times.arrival_ns, kind="stable")
    delay = times.arrival_s
    delay -= times.stamp_s
    delay = delay[order]
    if len(delay) < 4 * _AROUND:
        return None
    at, gap_s = 0, -np.inf
    for part in parts_of(len(delay) - 2 * _AROUND + 1):
        gap = _gaps(delay[part.start : part.stop + 2 * _AROUND - 1])
        largest = int(np.argmax(gap))
        if gap[largest] > gap_s:
            at, gap_s = part.start + largest, gap[largest]
    if gap_s < _STEP_S:
        return None
    split = at + _AROUND
    before, after = np.median(delay[:split]), np.median(delay[split:])
    by_s = float(after - before)
    if abs(by_s) < _STEP_S:
        return None
    return float(times.arrival_s[order][split] - times.arrival_s.min()), by_s


def _gaps(delay: FloatArray) -> FloatArray:
    """By how much 15 values and the 15 that follow them are apart; below 0 where they overlap."""
    low, high = _extremes(delay)
    before_low, before_high, after_low, after_high = low[:-_AROUND], high[:-_AROUND], low[_AROUND:], high[_AROUND:]
    found: FloatArray = np.maximum(after_low - before_high, before_low - after_high)
    return found


def _extremes(delay: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The least and the largest of each 15 successive values; of 8 by doubling, and two of these overlap by one."""
    low = high = delay
    for step in (1, 2, 4, _AROUND - 8):
        low, high = np.minimum(low[:-step], low[step:]), np.maximum(high[:-step], high[step:])
    return low, high


def _back(arrival_ns: IntArray) -> tuple[int, float] | None:
    """The index at which the recorder's clock goes back and runs on from there, and by how many seconds."""
    step = np.diff(arrival_ns)
    for at in np.flatnonzero(step < -round(_STEP_S * 1e9)):
        following = arrival_ns[at + 1 : at + 6]
        if len(following) >= 4 and np.all(np.diff(following) >= 0) and following[-1] < arrival_ns[at] + 2e9:
            overlapping = int(np.sum(arrival_ns[: at + 1] > following[0]))
            if overlapping >= 2:
                return int(at), float(-step[at] * 1e-9)
    return None
