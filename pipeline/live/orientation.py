"""A phone's raw readings as they are logged: specific force, angular velocity, orientation in the tracker's frame.

Those of the phone's page, and those of another sender that brings no orientation. Everything is found from the data,
nothing from the browser's name:

- Sign. Browsers disagree on whether acceleration at rest points up or down. With the browser's own orientation, its
  mean along "up" over a second at rest says which; without one, W3C's rule is taken (up).
- Tilt. The browser's orientation if it comes, carried to the reading by the gyroscope, else VQF
  (`pipeline.sessions.tilt`).
- Heading. Neither knows where the tracker's axes point; how both move tells (`fusion_core.phone.heading`). Until it is
  known to ±17°, the orientation is unknown.

Pure: a frozen state is passed in and returned. Times are s since the phone's first reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from fusion_core import Sensor
from fusion_core.phone.heading import HeadingFilter
from fusion_core.phone.orientation import level_rotation, rotation
from fusion_core.phone.quaternion import product, turn
from pipeline.live.changes import changed
from pipeline.live.events import Values
from pipeline.live.messages import Four, Motion, Orientation
from pipeline.sessions import tilt
from pipeline.sessions.phone import HEADING_SD_RAD
from pipeline.sessions.tilt import Tilt
from pipeline.statistics.arrays import FloatArray
from pipeline.study.units import RAD_PER_DEG
from pipeline.tables.columns import S_PER_NS

_GRAVITY_M_S2 = 9.81
_STILL_RAD_S, _STILL_M_S2 = 0.2, 0.5
_STILL_S = 1.0
_FRESH_S = 0.2  # an orientation of the browser's that is older is not used
_MM_PER_M = 1000.0

Source = Literal["none", "browser", "gyroscope"]


@dataclass(frozen=True)
class Aligner:
    """What does not change: the tracker's and the phone's sensor with all three axes, and gravity (3,) in its frame."""

    tracker: Sensor
    phone: Sensor
    gravity_mm_s2: tuple[float, float, float]

    @cached_property
    def filter(self) -> HeadingFilter:
        """The filter that finds the heading."""
        return HeadingFilter(self.tracker, self.phone)

    @cached_property
    def level_xyzw(self) -> Values:
        """From a frame whose z points up to the tracker's."""
        return tuple(level_rotation(np.array(self.gravity_mm_s2)).tolist())

    @cached_property
    def to_level(self) -> FloatArray:
        """The matrix (3, 3) from the tracker's frame to one whose z points up."""
        matrix: FloatArray = rotation(np.array(self.level_xyzw)).T
        return matrix

    @cached_property
    def gravity_m_s2(self) -> float:
        """Its length."""
        return float(np.linalg.norm(self.gravity_mm_s2)) / _MM_PER_M


@dataclass(frozen=True)
class PhoneMotion:
    """What is known of a phone. `sign` is None until it has been held still with an orientation of its own."""

    origin_ns: int | None = None
    source: Source = "none"
    browser: tuple[float, Four] | None = None
    tilt: Tilt = field(default_factory=Tilt)
    heading: Any = None
    angle: float = math.nan
    sd: float = math.inf
    sign: float | None = None
    still: tuple[float, float, float] = (0.0, 0.0, 0.0)  # since when, sum along "up", count
    moved_s: float = -math.inf
    upright: Values | None = None  # the browser's own orientation at the newest reading, whatever its heading

    @property
    def is_known(self) -> bool:
        """Whether orientations are."""
        return self.sd < HEADING_SD_RAD


def seen(aligner: Aligner, state: PhoneMotion, stamp_ns: int, arrival_ns: int, position_m: Values) -> PhoneMotion:
    """After a position of the tracker's, measured at `stamp_ns`."""
    if state.origin_ns is None or state.heading is None:
        return state
    place = aligner.to_level @ (np.array(position_m) * _MM_PER_M)
    time, arrival = (at * S_PER_NS for at in (stamp_ns - state.origin_ns, arrival_ns - state.origin_ns))
    return changed(state, heading=aligner.filter.position(state.heading, time, arrival, place))


def oriented(state: PhoneMotion, message: Orientation, stamp_ns: int) -> PhoneMotion:
    """After an orientation of the browser's."""
    if state.origin_ns is None:
        state = changed(state, origin_ns=stamp_ns)
    assert state.origin_ns is not None  # noqa: S101
    return changed(state, browser=((stamp_ns - state.origin_ns) * S_PER_NS, message.q))


def moved(
    aligner: Aligner, state: PhoneMotion, message: Motion, stamp_ns: int, arrival_ns: int
) -> tuple[PhoneMotion, Values | None]:
    """After a reading: the values that are logged, orientation NaN where it is unknown.

    None for a reading that lacks something, or is not newer than those before it.
    """
    if message.a is None or message.r is None:
        return state, None
    return turned(aligner, state, message.a, tuple(rate * RAD_PER_DEG for rate in message.r), stamp_ns, arrival_ns)


def turned(
    aligner: Aligner, state: PhoneMotion, acceleration: Values, turning: Values, stamp_ns: int, arrival_ns: int
) -> tuple[PhoneMotion, Values | None]:
    """The same after an acceleration in m/s², gravity in it, and an angular velocity in rad/s."""
    origin = stamp_ns if state.origin_ns is None else state.origin_ns
    time = (stamp_ns - origin) * S_PER_NS
    if time <= state.moved_s:
        return state, None
    state = changed(state, origin_ns=origin, moved_s=time)
    state, upright = _upright(state, time, acceleration, turning)
    state = changed(state, upright=upright if state.source == "browser" else None)
    if state.sign is None or upright is None:
        sign = state.sign if state.sign is not None else 1.0
        return state, (*(sign * part for part in acceleration), *turning, *(math.nan,) * 4)
    force = tuple(state.sign * part for part in acceleration)
    state = _headed(aligner, state, time, (arrival_ns - origin) * S_PER_NS, force, upright)
    if not state.is_known:
        return state, (*force, *turning, *(math.nan,) * 4)
    about = (0.0, 0.0, math.sin(state.angle / 2), math.cos(state.angle / 2))
    found = product(aligner.level_xyzw, product(about, upright))
    length = math.sqrt(sum(part * part for part in found))
    return state, (*force, *turning, *(part / length for part in found))


def _upright(
    state: PhoneMotion, time: float, acceleration: Values, turning: Values
) -> tuple[PhoneMotion, Values | None]:
    """The orientation xyzw to a frame whose z points up, its heading unknown; and with it, in time, the sign."""
    browser = state.browser
    if browser is not None and abs(time - browser[0]) <= _FRESH_S:
        upright = product(browser[1], turn(turning, time - browser[0]))
        if state.source != "browser":
            state = changed(state, source="browser", heading=None, sd=math.inf)
        return (state if state.sign is not None else _signed(state, time, acceleration, turning, upright)), upright
    if state.source != "gyroscope":
        state = changed(state, source="gyroscope", heading=None, sd=math.inf, tilt=Tilt())
    if state.sign is None:
        state = changed(state, sign=1.0)
    assert state.sign is not None  # noqa: S101
    force = np.array(acceleration) * (state.sign * _MM_PER_M)
    known, found = tilt.step(state.tilt, tilt.Reading(time, np.array(turning), force))
    return changed(state, tilt=known), None if found is None else tuple(found.tolist())


def _signed(state: PhoneMotion, time: float, acceleration: Values, turning: Values, upright: Values) -> PhoneMotion:
    """With the sign once the phone has been still for a second."""
    length = math.sqrt(sum(part * part for part in acceleration))
    rate = math.sqrt(sum(part * part for part in turning))
    if rate > _STILL_RAD_S or abs(length - _GRAVITY_M_S2) > _STILL_M_S2:
        return changed(state, still=(time, 0.0, 0.0))
    since, total, count = state.still
    x, y, z, w = upright
    up = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))  # in the phone's frame
    total += sum(part * along for part, along in zip(acceleration, up, strict=True))
    still = (since if count else time, total, count + 1)
    if time - still[0] < _STILL_S or count < 10:
        return changed(state, still=still)
    return changed(state, still=still, sign=-1.0 if total < 0 else 1.0)


def _headed(
    aligner: Aligner, state: PhoneMotion, time: float, arrival: float, force: Values, upright: Values
) -> PhoneMotion:
    """With what the reading says of the heading."""
    before = aligner.filter.start() if state.heading is None else state.heading
    level = rotation(np.array(upright)) @ np.array(force) - np.array([0.0, 0.0, aligner.gravity_m_s2])
    after = aligner.filter.acceleration(before, time, arrival, level * _MM_PER_M)
    angle, sd = aligner.filter.angle(after)
    return changed(state, heading=after, angle=angle, sd=sd)
