"""Single steps that no hand makes: a tracker that jumps to another place and stays, or strays for a reading or two."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.agreement import SPEED_MM_S
from pipeline.sessions.checks.finding import Finding, of
from pipeline.sessions.checks.recorded import Recorded
from pipeline.sessions.checks.repeats import jumps_to_zero
from pipeline.sessions.logs.log import BoolArray
from pipeline.statistics.arrays import FloatArray

JUMPS = "jumps"

_FAR_MM, _FAR_SDS = 200.0, 8.0
_AROUND = 5
_MANY = 0.01
_SUDDEN = 4.0  # times as fast as the step before


def jumps(recorded: Recorded) -> Iterator[Finding]:
    """Steps of 20 cm and more, faster than 8 m/s and beyond the noise. A stream in another unit is one of *speed*'s.

    What was displayed is not judged: an estimator's output may leap after a pause of its tracker.
    """
    for one in recorded.positions:
        if one.kind == "display":
            continue
        time, first = np.unique(one.times.stamp_s, return_index=True)
        value = one.value_mm[first]
        if len(time) < 50 or jumps_to_zero(value):
            continue
        step = np.diff(value, axis=0)
        length = np.sqrt(np.einsum("ij,ij->i", step, step))
        at = np.flatnonzero(_sudden(time, value, length, one.noise_sd_mm or 0.0))
        found, expected = f"{len(at)}", "0"
        if not len(at) or float(np.median(length)) > _FAR_MM:
            yield Finding(of(JUMPS, one.name), "green", found, expected)
            continue
        stays = [place for place in at if _stays(value, int(place))]
        if stays:
            begin_s = float(time[stays[0] + 1] - time[0])
            message = (
                f'{begin_s:.0f} s into the session "{one.name}" jumps by {length[stays[0]]:.0f} mm and stays there: it '
                "found its place anew, or another frame or object; leave out what came before or after"
            )
        else:
            message = (
                f'"{one.name}" strays for a reading or two {len(at)} times, by up to {length[at].max():.0f} mm, faster '
                "than any hand: it takes something else for the hand now and then; leave such readings out of the log"
            )
        red = bool(stays) or len(at) > _MANY * len(time)
        yield Finding(of(JUMPS, one.name), "red" if red else "amber", found, expected, message)


def _sudden(time: FloatArray, value: FloatArray, length: FloatArray, noise_sd_mm: float) -> BoolArray:
    """Which steps (n - 1,) are too far and too fast, and begin at once: a brisk reach gathers speed over several."""
    lasted = np.maximum(np.diff(time), float(np.median(np.diff(time))))
    noise_mm = max(noise_sd_mm, float(np.median(length)))
    far = length > np.maximum(np.maximum(SPEED_MM_S * lasted, _FAR_MM), _FAR_SDS * noise_mm)
    speed = length / lasted
    after_rest = np.concatenate([[False], speed[1:] > _SUDDEN * speed[:-1]])
    before_rest = np.concatenate([speed[:-1] > _SUDDEN * speed[1:], [False]])
    there_and_back = np.zeros(len(length), bool)
    there_and_back[:-1] = np.linalg.norm(value[2:] - value[:-2], axis=1) < length[:-1] / 2
    found: BoolArray = far & after_rest & (before_rest | there_and_back)
    return found


def _stays(value: FloatArray, at: int) -> bool:
    """Is the middle of the readings after a jump as far from that before as the jump was long?"""
    around = value[max(0, at - _AROUND + 1) : at + 1], value[at + 1 :][:_AROUND]
    if min(len(part) for part in around) < _AROUND // 2 + 1:
        return False
    before, after = (np.median(part, axis=0) for part in around)
    return bool(np.linalg.norm(after - before) > 0.7 * np.linalg.norm(value[at + 1] - value[at]))
