"""Which of a tracker's frames say how the phone moves, for whatever is learnt from the motion alone.

Frames that repeat the one before, or are zero, are what trackers send that have lost their target. One that is further
from the one before than any hand goes is another body's, and so are those that go on from there, until a second such
leap leads back. What lasts longer than another body does is the hand after all, at a new place: for a motion the place
does not matter, so positions go on from where the hand was. `fusion_adaptive` tells another body by the same leaps, and
by what it expected.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fusion_core.samples import FloatArray, Samples

FASTEST_MM_S = 7000.0
"""Of a hand, from frame to frame: arms of runners reach 6100 in public recordings. More is a leap of the tracker's."""
LEAST_FRAME_S = 0.04
"""Stamps that are those of arrival may be closer than the frames were."""
LEAP_SDS = 8.0
"""Of one frame's noise, for the difference of two in any of three axes."""
BELIEVED_AFTER_S = 1.3
"""What stays so long is where the hand is now."""


@dataclass(frozen=True)
class Sighting:
    """The newest frame that was news (3,) in mm, and the newest one of the hand.

    `strange_since_s` is when another body's frames began, None while they are the hand's. `moved_mm` (3,) is how far
    the hand has been set aside without moving.
    """

    time_s: float
    position_mm: FloatArray
    hand_mm: FloatArray
    moved_mm: FloatArray
    strange_since_s: float | None = None


def sighted(
    before: Sighting | None, time_s: float, position_mm: FloatArray, noise_sd_mm: float
) -> tuple[Sighting | None, FloatArray | None]:
    """What is known after a frame, and where it saw the hand (3,), None where it did not."""
    if not position_mm.any() or (before is not None and np.array_equal(position_mm, before.position_mm)):
        return before, None
    if before is None:
        return Sighting(time_s, position_mm, position_mm, np.zeros_like(position_mm)), position_mm
    dt = max(abs(time_s - before.time_s), LEAST_FRAME_S)
    leapt = np.linalg.norm(position_mm - before.position_mm) > FASTEST_MM_S * dt + LEAP_SDS * noise_sd_mm
    was_strange = before.strange_since_s is not None
    now = replace(before, time_s=time_s, position_mm=position_mm)
    if leapt == was_strange:
        return replace(now, hand_mm=position_mm, strange_since_s=None), position_mm - now.moved_mm
    since = time_s if before.strange_since_s is None else before.strange_since_s
    if time_s - since < BELIEVED_AFTER_S:
        return replace(now, strange_since_s=since), None
    moved = now.moved_mm + position_mm - now.hand_mm
    return replace(now, hand_mm=position_mm, moved_mm=moved, strange_since_s=None), position_mm - moved


def sightings(frames: Samples, noise_sd_mm: float) -> Samples:
    """The frames (n,) that saw the hand, by `sighted` in their order."""
    state, kept, value = None, [], frames.value.copy()
    for row, (time, position) in enumerate(zip(frames.time.tolist(), frames.value, strict=True)):
        state, seen = sighted(state, time, position, noise_sd_mm)
        if seen is not None:
            kept.append(row)
            value[row] = seen
    return Samples(frames.time[kept], frames.arrival[kept], value[kept])
