"""Where a reference's frame and clock lie against the tracker's, by the movement that both recorded.

The rotation and translation that bring matched positions closest are those of Kabsch (1976, Acta Cryst. A 32, 922): of
the centred cross-products the orthogonal matrix nearest to them, without a reflection. Positions are matched by the lag
of one movement behind the other, which no turn of a frame changes (`checks.motion`). All sessions have one frame, for
cameras stand still; each session has a clock of its own.

Both sensors' errors last, so that intervals come of resampled blocks of 2 s; a movement along a line leaves the turn
about it open, and shows in an interval as wide as that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusion_core.accuracy import interpolate
from fusion_core.samples import Samples
from pipeline.sessions.checks.motion import Interval, compare_positions
from pipeline.sessions.piecewise import arrived
from pipeline.statistics.arrays import FloatArray

_BLOCK_S = 2.0
_RESAMPLES = 400
_STRAY = 4.0  # times the median distance, beyond which a pair is a stray
_PASSES = 3
_FITS = 0.5  # of the movement that the two have in common, below which they do not show one
_MOST_TURN_DEG = 5.0  # half an interval, beyond which the movement does not tell the frame
_BLOCKS_MIN = 8


@dataclass(frozen=True)
class Frame:
    """How to bring a reference's positions into the tracker's frame: rotation (3, 3), then translation (3,) in mm.

    `turn_half_deg` and `shift_half_mm` are half the 95 % intervals: of the angle, and of the place at the middle of the
    movement. `lags_s` says by session how much later the tracker's stamps are; `left_mm` is the pairs' RMS distance.
    """

    rotation: FloatArray
    translation_mm: FloatArray
    turn_half_deg: float
    shift_half_mm: float
    middle_mm: FloatArray
    lags_s: Mapping[str, Interval]
    left_mm: float

    @property
    def told(self) -> bool:
        """Whether the movement determines the turn."""
        return self.turn_half_deg <= _MOST_TURN_DEG

    @property
    def turn_deg(self) -> float:
        """The angle of the rotation."""
        return _angle_deg(self.rotation)

    @property
    def shift_mm(self) -> float:
        """How far the middle of the movement is moved."""
        return float(np.linalg.norm(self.rotation @ self.middle_mm + self.translation_mm - self.middle_mm))

    def applied(self, position_mm: FloatArray) -> FloatArray:
        """Positions (n, 3) of the reference in the tracker's frame."""
        moved: FloatArray = position_mm @ self.rotation.T + self.translation_mm
        return moved


def frame_of(sessions: Mapping[str, tuple[Samples, Samples]]) -> Frame | None:
    """By all sessions' tracker and reference, of three axes each; None where they do not show one movement."""
    seen: list[FloatArray] = []
    known: list[FloatArray] = []
    block: list[FloatArray] = []
    lags = {}
    for session, (tracker, reference) in sessions.items():
        found = compare_positions(tracker.time, tracker.value, reference.time, reference.value)
        if found is None or found.explained < _FITS or found.lag_beyond:
            continue
        lags[session] = found.lag_s
        p, q, time = matched(tracker, reference, found.lag_s.value)
        seen.append(p)
        known.append(q)
        block.append(np.floor(time / _BLOCK_S) + (1.0 + block[-1].max() if block else 0.0))
    if not lags:
        return None
    p, q = np.vstack(seen), np.vstack(known)
    _, of = np.unique(np.concatenate(block), return_inverse=True)
    if of.max(initial=0) + 1 < _BLOCKS_MIN:
        return None
    return _rigid(p, q, of, lags)


def until(sessions: Mapping[str, tuple[Samples, Samples]], first_s: float) -> dict[str, tuple[Samples, Samples]]:
    """The same with the first seconds of each session's tracker alone."""
    return {
        session: (arrived(tracker, -np.inf, tracker.arrival.min(initial=np.inf) + first_s), reference)
        for session, (tracker, reference) in sessions.items()
    }


def on_the_rest(
    sessions: Mapping[str, tuple[Samples, Samples]], frame: Frame, first_s: float
) -> tuple[float, float] | None:
    """The median distance in mm of tracker and reference after the first seconds, as stated and as found."""
    before, after = [], []
    for session, lag_s in frame.lags_s.items():
        p, q, time = matched(*sessions[session], lag_s.value)
        rest = time > first_s
        before.append(np.linalg.norm(p - q, axis=1)[rest])
        after.append(np.linalg.norm(p - frame.applied(q), axis=1)[rest])
    as_stated, as_found = np.concatenate(before), np.concatenate(after)
    return (float(np.median(as_stated)), float(np.median(as_found))) if len(as_stated) else None


def matched(tracker: Samples, reference: Samples, lag_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The tracker's positions, the reference's at their times (n, 3), and the times, wherever both are known."""
    there = interpolate(reference, tracker.time - lag_s)
    both = np.isfinite(there).all(axis=1) & np.isfinite(tracker.value).all(axis=1)
    return tracker.value[both], there[both], tracker.time[both] - tracker.time[0]


def _rigid(p: FloatArray, q: FloatArray, block: npt.NDArray[np.int64], lags: Mapping[str, Interval]) -> Frame:
    """The best frame without stray pairs, and how far it goes in resamples of the blocks."""
    kept = np.ones(len(p), dtype=bool)
    for _ in range(_PASSES):
        rotation, shift = _kabsch(*_sums(p[kept], q[kept], np.zeros(int(kept.sum()), np.int64), 1))
        off = np.linalg.norm(p - q @ rotation[0].T - shift[0], axis=1)
        kept = off <= _STRAY * np.median(off)
    sums = _sums(p[kept], q[kept], block[kept], int(block.max()) + 1)
    count = len(sums[0])
    draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), _RESAMPLES).astype(float)
    weights = np.vstack([np.ones(count), draws])
    rotations, shifts = _kabsch(*(np.tensordot(weights, one, 1) for one in sums))
    middle = q[kept].mean(axis=0)
    places = rotations @ middle + shifts
    turns = [_angle_deg(one @ rotations[0].T) for one in rotations[1:]]
    moves = np.linalg.norm(places[1:] - places[0], axis=1)
    off = p[kept] - q[kept] @ rotations[0].T - shifts[0]
    return Frame(
        rotations[0],
        shifts[0],
        float(np.percentile(turns, 95)),
        float(np.percentile(moves, 95)),
        middle,
        lags,
        float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
    )


def _sums(
    p: FloatArray, q: FloatArray, block: npt.NDArray[np.int64], count: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """By block the number of pairs, the sums of p and q (blocks, 3), and of p qᵀ (blocks, 3, 3)."""
    pairs, of_p, of_q, products = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3, 3))
    np.add.at(pairs, block, 1.0)
    np.add.at(of_p, block, p)
    np.add.at(of_q, block, q)
    np.add.at(products, block, p[:, :, None] * q[:, None, :])
    return pairs, of_p, of_q, products


def _kabsch(
    pairs: FloatArray, of_p: FloatArray, of_q: FloatArray, products: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rotations (n, 3, 3) and translations (n, 3) from sums."""
    p, q = of_p / pairs[:, None], of_q / pairs[:, None]
    left, _, right = np.linalg.svd(products - pairs[:, None, None] * p[:, :, None] * q[:, None, :])
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    rotation = left @ right
    return rotation, p - np.einsum("nij,nj->ni", rotation, q)


def _angle_deg(rotation: FloatArray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0))))
