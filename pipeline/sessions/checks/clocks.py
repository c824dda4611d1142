"""Clocks that differ by seconds and hours: streams that never overlap, and stamps far from their arrivals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.finding import Finding, graded, of
from pipeline.sessions.checks.recorded import Recorded

TOGETHER, OFFSET = "span of the streams", "stamps and arrivals"

_TOGETHER = 0.5  # of the shorter of two streams
_OFFSET_S = (2.0, 10.0)
_HOUR_S, _NEAR_HOUR_S = 3600.0, 120.0
_QUARTERS = 4  # time zones are apart by quarters of an hour
_YEAR_S = 365.25 * 86_400.0


def offset_in_words(seconds: float) -> str:
    """Seconds, hours or years, with what they hint at."""
    if abs(seconds) > _YEAR_S:
        return f"{seconds / _YEAR_S:.3g} years, as where one counts since 1970 and the other from its start"
    quarter = _HOUR_S / _QUARTERS
    zone = abs(seconds) > quarter and abs(seconds - round(seconds / quarter) * quarter) < _NEAR_HOUR_S
    if abs(seconds) > _HOUR_S / 2:
        return f"{seconds / _HOUR_S:.2g} h" + (", as by a time zone or summer time" if zone else "")
    return f"{seconds:.2g} s"


def together(recorded: Recorded) -> Iterator[Finding]:
    """Tracker, phone and reference must have been recorded at one time; a display may be shown for a part of it."""
    first = recorded.tracker or recorded.imu
    others = [recorded.imu, recorded.of_kind("reference")]
    if first is None or not len(first.times.stamp_ns):
        return
    for other in others:
        if other is None or other is first or not len(other.times.stamp_ns):
            continue
        begin, end = float(first.times.stamp_s.min()), float(first.times.stamp_s.max())
        starts, stops = float(other.times.stamp_s.min()), float(other.times.stamp_s.max())
        shorter = max(min(end - begin, stops - starts), 1e-9)
        share = (min(end, stops) - max(begin, starts)) / shorter
        found = f"{max(0.0, min(1.0, share)):.0%} in common with {first.name}"
        expected = f"at least {_TOGETHER:.0%} of the shorter"
        if share >= _TOGETHER:
            yield Finding(of(TOGETHER, other.name), "green", found, expected)
            continue
        by_s = (starts + stops) / 2 - (begin + end) / 2
        message = (
            f'by their stamps "{other.name}" was recorded {"after" if by_s > 0 else "before"} "{first.name}", by '
            f"{offset_in_words(abs(by_s))}: one of their clocks is off; put the clocks right, or log both with one"
        )
        yield Finding(of(TOGETHER, other.name), "red" if share <= 0 else "amber", found, expected, message)


def offset(recorded: Recorded) -> Iterator[Finding]:
    """How far stamps are from arrivals: seconds are a clock that is off, hours a time zone."""
    for one in recorded.streams:
        if len(one.times.stamp_ns) < 10:
            continue
        late_s = float(np.median(one.times.arrival_s - one.times.stamp_s))
        status = graded(abs(late_s), *_OFFSET_S)
        found, expected = f"{late_s:.3g} s apart", f"at most {_OFFSET_S[0]:g} s"
        message = ""
        if status != "green":
            message = (
                f'the stamps of "{one.name}" are {"before" if late_s > 0 else "after"} their arrivals by '
                f"{offset_in_words(abs(late_s))}: the clock of its sender is not the recorder's; set one by the "
                "other, or stamp where it is recorded"
            )
        yield Finding(of(OFFSET, one.name), status, found, expected, message)
