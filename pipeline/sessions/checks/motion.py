"""One movement seen by two sensors: a tracker's positions compared with a phone's accelerations.

Theory of operation. In one frame the accelerations are the second derivative of the positions. Neither can be used
directly: differentiating twice amplifies the tracker's noise beyond the movement, and integrating twice makes an
accelerometer's offset grow without bound. So both are brought into one frequency band by the same zero-phase filter H,
on one grid:

    positions      p(f) · H(f)                 H: 0.3 to 4 Hz, where hands move and neither sensor is at its worst
    accelerations  a(f) · H(f) / −(2πf)²       a position again, finite because H falls as f⁴ towards 0

and p(t) ≈ A q(t − lag) with a 3 × 3 matrix A, the identity where all is well:

- the lag is where *any* A explains |p|² best, so that a turned or mirrored frame does not change it;
- A's size is the ratio of the units, the sign of its determinant a reflection, its rotation a turn of the frame
  (the orthogonal Procrustes problem, by the singular values of the cross-products C = Σ p qᵀ).

A direction in which nothing moves says nothing about the frame. So two to four times the size that C's diagonal has by
chance (from p less A q, paired with unrelated blocks of q) is added to it first: that decides where the data do not,
and is negligible beside a movement that both sensors saw.

The errors of both sensors are correlated over time. Intervals come from resampling blocks of 2 s (a moving-block
bootstrap), of which only cross-products are needed: everything after the filters is sums over blocks. What must stay
true: the same H for both, without phase, and no block with a gap in it. A periodic movement fits at several lags, which
makes its interval wide; while a hand rests nothing is known, and the interval is as wide as the search.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipeline.sessions.checks.band import STEP_S, averaged, even_length, filtered, rising
from pipeline.statistics.arrays import FloatArray

LAG_RANGE_S = 0.6
_BLOCK = 50  # grid steps: 2 s
_MARGIN = 25  # grid steps over which the filter rings
_BLOCKS_MIN = 4
_GAP_S = 0.25
_RESAMPLES, _FEW_RESAMPLES = 200, 60  # positions tell a lag far better than accelerations
_RIDGE = 1e-3  # of the accelerations' power: an axis without movement takes no part in the fit
_SHORTEST = 10  # readings
_LONGEST = 180_000  # grid steps: of longer sessions the first two hours
_AT_ONCE = 256  # blocks
_DEALT = 16  # ways of dealing blocks
_FLAT, _FLAT_UPRIGHT = 0.05, 0.15  # of the strongest direction's movement, the weakest's
_FITS = 0.5  # of the movement, before a distant lag is believed
_LEFT_MIN = 0.02  # of an axis's variance, that is never taken for explained


@dataclass(frozen=True)
class Interval:
    """A value and its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def width(self) -> float:
        """From the lower to the upper end."""
        return self.high - self.low


@dataclass(frozen=True)
class Compared:
    """How two sensors' records of one movement compare. `lag_s`: how much later the positions' stamps are.

    `explained` is the share of the positions' variance in the band that the accelerations account for, `position_mm`
    and `acceleration_mm` its SD in either. `scale` is the positions' size over the accelerations', too
    small where those are mostly noise, and `scale_most` what it would be if the positions were; `turn_deg` the angle
    between the frames, about any axis, NaN where the heading is not known; `mirrored` the share of resamples in which a
    reflection fits better than any turn. `axes` names what the phone calls the tracker's x, y, z, such as "+y -x +z";
    it is "" where the heading is not known. `drift_s` is how much the lag grows from the first half to the second;
    `flat` says that the movement has fewer than three dimensions.
    """

    explained: float
    position_mm: float
    acceleration_mm: float
    seconds: float
    lag_s: Interval
    scale: Interval
    scale_most: float
    turn_deg: Interval
    mirrored: float
    axes: str
    drift_s: float
    flat: bool

    @property
    def lag_beyond(self) -> bool:
        """Whether the lag is at the end of what was searched, so that it may be any that is larger."""
        return abs(self.lag_s.value) > LAG_RANGE_S - STEP_S


def compare(
    tracker_s: FloatArray,
    position_mm: FloatArray,
    imu_s: FloatArray,
    acceleration_mm_s2: FloatArray,
    heading_known: bool = True,
) -> Compared | None:
    """Positions (n, 3) and accelerations (m, 3), each by its own stamps; None if less than 10 s are common to both.

    A constant in the accelerations, such as gravity, does not matter. Without `heading_known` the accelerations are
    upright but turned about the third axis by an unknown angle.
    """
    return _compared(tracker_s, position_mm, imu_s, acceleration_mm_s2, 2, heading_known)


def compare_positions(
    tracker_s: FloatArray, position_mm: FloatArray, other_s: FloatArray, other_mm: FloatArray
) -> Compared | None:
    """The same for two streams of positions, of which the second takes the place of the accelerations."""
    return _compared(tracker_s, position_mm, other_s, other_mm, 0, True)


def _compared(
    tracker_s: FloatArray,
    position_mm: FloatArray,
    other_s: FloatArray,
    other: FloatArray,
    integrations: int,
    heading_known: bool,
) -> Compared | None:
    tracker_s, position_mm = rising(tracker_s, position_mm)
    other_s, other = rising(other_s, other)
    grid = _grid(tracker_s, other_s)
    rows = _blocks(grid, tracker_s, other_s) if len(grid) else np.zeros((0, _BLOCK), np.int64)
    if len(rows) < _BLOCKS_MIN:
        return None
    seen = filtered(averaged(grid, tracker_s, position_mm), 0)
    felt = filtered(averaged(grid, other_s, other), integrations)
    return _Blocks.of(seen, felt, rows).compared(heading_known, _RESAMPLES if integrations else _FEW_RESAMPLES)


def _grid(tracker_s: FloatArray, other_s: FloatArray) -> FloatArray:
    """Steps of 40 ms over the time that both cover; empty where one has next to no readings."""
    if min(len(tracker_s), len(other_s)) < _SHORTEST:
        return np.zeros(0)
    begin, end = max(tracker_s[0], other_s[0]), min(tracker_s[-1], other_s[-1])
    grid: FloatArray = begin + STEP_S * np.arange(max(0, min(int((end - begin) / STEP_S), _LONGEST)))
    return grid


def distant_lag_s(
    tracker_s: FloatArray, position_mm: FloatArray, imu_s: FloatArray, acceleration_mm_s2: FloatArray
) -> float | None:
    """The lag, up to half of the session, at which one explains at least half of the other; None if there is none.

    For movements that do not fit at any lag near zero. The accelerations are whitened, so that the sum of the squared
    cross-correlations of all axes is what the best A accounts for.
    """
    tracker_s, position_mm = rising(tracker_s, position_mm)
    imu_s, acceleration_mm_s2 = rising(imu_s, acceleration_mm_s2)
    grid = _grid(tracker_s, imu_s)
    if len(grid) < _BLOCKS_MIN * _BLOCK:
        return None
    seen = filtered(averaged(grid, tracker_s, position_mm), 0)
    felt = filtered(averaged(grid, imu_s, acceleration_mm_s2), 2)
    own = felt.T @ felt
    ridge = _RIDGE * np.trace(own) * np.eye(3) + 1e-300 * np.eye(3)
    white = np.linalg.solve(np.linalg.cholesky(own + ridge), felt.T)
    length = even_length(2 * len(grid))
    moved = np.fft.rfft(seen.T, length)[:, None] * np.conj(np.fft.rfft(white, length))
    explained = np.sum(np.fft.irfft(moved, length) ** 2, axis=(0, 1)) / max(float(np.sum(seen**2)), 1e-300)
    shifts = np.arange(length)
    shifts = np.where(shifts > length // 2, shifts - length, shifts)
    explained[np.abs(shifts) > len(grid) // 2] = 0.0
    at = int(np.argmax(explained))
    return float(shifts[at] * STEP_S) if explained[at] > _FITS else None


def _blocks(grid: FloatArray, tracker_s: FloatArray, imu_s: FloatArray) -> npt.NDArray[np.int64]:
    """The grid rows (blocks, 50) of each block that neither an end nor a gap comes near."""
    reach = max(_MARGIN, round(LAG_RANGE_S / STEP_S) + 1)
    count = max(0, len(grid) - 2 * reach) // _BLOCK
    if count == 0:
        return np.zeros((0, _BLOCK), np.int64)
    broken = np.zeros(len(grid))
    for time in (tracker_s, imu_s):
        at = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
        broken += time[at] - time[at - 1] > _GAP_S
    near = np.convolve(broken, np.ones(2 * _MARGIN + 1), "same") > 0.5
    rows = reach + np.arange(count * _BLOCK).reshape(count, _BLOCK)
    kept: npt.NDArray[np.int64] = rows[~near[rows].any(axis=1)]
    return kept


@dataclass(frozen=True)
class _Blocks:
    """Cross-products of each block: `cross` (blocks, shifts, 3, 3) of p and q, `own` (blocks, 3, 3) of q.

    `power` (blocks, 3) is that of p by its axes, `dealt` (k, 3, 3) are Σ p qᵀ of blocks
    that have nothing to do with each other.
    """

    cross: FloatArray
    own: FloatArray
    power: FloatArray
    dealt: FloatArray

    @staticmethod
    def of(seen: FloatArray, felt: FloatArray, rows: npt.NDArray[np.int64]) -> _Blocks:
        """For every shift within the range."""
        reach = round(LAG_RANGE_S / STEP_S)
        positions = seen[rows]
        own = np.einsum("bti,btj->bij", felt[rows], felt[rows])
        starts = rows[:, 0, None] - reach + np.arange(2 * reach + 1)[::-1]  # shift s looks s rows back
        windows = np.lib.stride_tricks.sliding_window_view(felt, _BLOCK, axis=0)  # (rows, 3, block)
        cross = np.empty((len(rows), 2 * reach + 1, 3, 3))
        for begin in range(0, len(rows), _AT_ONCE):  # each row's windows overlap, and take 30 times its memory
            part = slice(begin, begin + _AT_ONCE)
            later = windows[starts[part]].reshape(len(starts[part]), -1, _BLOCK)
            cross[part] = (later @ positions[part]).reshape(len(later), -1, 3, 3)
        power = np.einsum("bti,bti->bi", positions, positions)
        return _Blocks(cross.transpose(0, 1, 3, 2), own, power, _dealt(positions, felt[rows]))

    @cached_property
    def shifts_s(self) -> FloatArray:
        """The lag at each shift."""
        reach = round(LAG_RANGE_S / STEP_S)
        return np.arange(-reach, reach + 1).astype(np.float64) * STEP_S

    def compared(self, heading_known: bool, resamples: int) -> Compared:
        """Everything, with intervals by resampled blocks, the same draws each time."""
        count = len(self.power)
        draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), resamples).astype(float)
        halves = (np.arange(count) < count // 2, np.arange(count) >= count // 2)
        weights = np.vstack([np.ones(count), draws, *halves])  # the first is the session as it is
        cross, own = np.tensordot(weights, self.cross, 1), np.tensordot(weights, self.own, 1)
        power = np.maximum(weights @ self.power, 1e-300)
        by_axis = _explained(cross, own)
        explained = by_axis.sum(axis=2) / power.sum(axis=1)[:, None]
        *_, early, late = lag = _peak(explained, self.shifts_s)
        cross, own, power, explained, lag = cross[:-2], own[:-2], power[:-2], explained[:-2], lag[:-2]
        at = int(np.argmin(np.abs(self.shifts_s - lag[0])))
        heading = np.eye(3) if heading_known else _about_vertical(cross[0, at])
        cross, own = cross[:, at] @ heading, heading.T @ own @ heading
        chance = np.sqrt(np.mean(np.einsum("kii->ki", self.dealt @ heading) ** 2, axis=0))
        turn, mirror, size = _procrustes(
            cross, own, chance * np.sqrt(np.clip(1 - by_axis[0, at] / power[0], _LEFT_MIN, 1.0))
        )
        samples, flat = count * _BLOCK, _flat(cross[0], heading_known)
        return Compared(
            float(explained[0].max()),
            float(np.sqrt(self.power.sum() / samples)),
            float(np.sqrt(np.trace(own[0]) / samples)),
            samples * STEP_S,
            _interval(lag),
            _interval(size),
            float(np.percentile(power.sum(axis=1) / np.maximum(size * np.trace(own, axis1=1, axis2=2), 1e-300), 97.5)),
            _interval(turn if heading_known else np.full_like(turn, np.nan)),
            float(np.mean(mirror[1:])) if mirror[0] and not flat else 0.0,
            _axes(cross[0]) if heading_known else "",
            float(late - early),
            flat,
        )


def _dealt(positions: FloatArray, moved: FloatArray) -> FloatArray:
    """Σ p qᵀ (k, 3, 3) with the blocks of one dealt to others of the other: what chance makes of it."""
    apart = range(1, min(len(positions), _DEALT + 1))
    turned = positions.transpose(0, 2, 1)
    return np.array([(turned @ np.roll(moved, shift, axis=0)).sum(axis=0) for shift in apart])


def _explained(cross: FloatArray, own: FloatArray) -> FloatArray:
    """The diagonal of C S⁻¹ Cᵀ (n, shifts, 3): what the best A of each shift accounts for, by the axis of p."""
    ridge = _RIDGE * np.trace(own, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 1e-300 * np.eye(3)
    inverse = np.linalg.inv(own + ridge)
    found: FloatArray = np.einsum("nsij,nsij->nsi", cross @ inverse[:, None], cross)
    return found


def _peak(explained: FloatArray, shifts_s: FloatArray) -> FloatArray:
    """The shift (n,) that explains most, between the grid's by a parabola."""
    at = np.argmax(explained, axis=1)
    row, inner = np.arange(len(at)), np.clip(at, 1, explained.shape[1] - 2)
    before, here, after = (explained[row, inner + step] for step in (-1, 0, 1))
    bend = before - 2 * here + after
    part = np.divide(before - after, 2 * bend, out=np.zeros_like(bend), where=bend < 0)
    found: FloatArray = shifts_s[at] + np.where(at == inner, np.clip(part, -0.5, 0.5), 0.0) * STEP_S
    return found


def _about_vertical(cross: FloatArray) -> FloatArray:
    """The turn about the third axis (3, 3) that brings q's heading to p's: cross @ turn is as if it were known."""
    angle = np.arctan2(cross[1, 0] - cross[0, 1], cross[0, 0] + cross[1, 1])
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]).T


def _procrustes(
    cross: FloatArray, own: FloatArray, chance: FloatArray
) -> tuple[FloatArray, npt.NDArray[np.bool_], FloatArray]:
    """Angle in degrees, whether a reflection fits better, and size (n,) of the A nearest to each C (n, 3, 3)."""
    left, _, right = np.linalg.svd(cross + 4 * np.diag(chance))
    mirrored = np.linalg.det(left @ right) < 0
    left, _, right = np.linalg.svd(cross + 2 * np.diag(chance))
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    rotation = left @ right
    angle = np.degrees(np.arccos(np.clip((np.trace(rotation, axis1=1, axis2=2) - 1) / 2, -1.0, 1.0)))
    own_power = np.maximum(np.trace(own, axis1=1, axis2=2), 1e-300)
    size = np.sum(np.linalg.svd(cross, compute_uv=False), axis=1) / own_power
    return angle, mirrored, size


def _flat(cross: FloatArray, heading_known: bool) -> bool:
    """Whether the movement has fewer than three dimensions; an estimated vertical, which errs, needs a higher limit."""
    strength = np.linalg.svd(cross, compute_uv=False)
    return bool(strength[2] < (_FLAT if heading_known else _FLAT_UPRIGHT) * strength[0])


def _interval(values: FloatArray) -> Interval:
    """The first value, with the 2.5 and 97.5 percentile of the others, which are its resamples."""
    low, high = np.percentile(values[1:], [2.5, 97.5])
    return Interval(float(values[0]), float(low), float(high))


def _axes(cross: FloatArray) -> str:
    """Which of the phone's axes each of the tracker's is nearest to, with its sign."""
    strength = np.abs(cross) / max(float(np.abs(cross).max()), 1e-300)
    orders = np.array([(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)])
    order = orders[int(np.argmax([strength[np.arange(3), one].sum() for one in orders]))]
    names = []
    for row, column in enumerate(order):
        names.append(f"{'-' if cross[row, column] < 0 else '+'}{'xyz'[column]}")
    return " ".join(names)
