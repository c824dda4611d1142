"""Fitts' law: movement time as a line over the index of difficulty, and throughput."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.statistics import NO_VARIATION, OK, TOO_FEW_VALUES
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray, negligible

IN_A_NORMAL_SD = 4.133  # √(2πe): the width that holds 96 % of hits (Soukoreff and MacKenzie 2004)
_ROUND_OFF = 1e-9


@dataclass(frozen=True)
class Blocks:
    """Movements of the same amplitude and width taken together: means (m,), and how many movements there were.

    `amplitude`, `width` and `difficulty` (bits) are effective ones where they come from selections.
    """

    amplitude: FloatArray
    width: FloatArray
    difficulty: FloatArray
    time_s: FloatArray
    count: IntArray


@dataclass(frozen=True)
class Fitted:
    """MT = intercept + slope · ID over m blocks; figures are None where `status` says why.

    `throughput` (bit/s) is the mean of ID/MT over blocks, as ISO 9241-411 has it, and no inverse of the slope.
    """

    blocks: int
    intercept_s: float | None = None
    slope_s_bit: float | None = None
    ci_intercept: tuple[float, float] | None = None
    ci_slope: tuple[float, float] | None = None
    r_squared: float | None = None
    throughput_bits_s: float | None = None
    status: str = OK


def effective_width(deviations: FloatArray) -> float:
    """4.133 SD of where selections (n,) fell along the axis of the task."""
    return IN_A_NORMAL_SD * float(np.std(deviations, ddof=1))


def index_of_difficulty(amplitude: FloatArray, width: FloatArray) -> FloatArray:
    """log₂(A/W + 1), in bits (MacKenzie 1992)."""
    bits: FloatArray = np.log2(amplitude / width + 1)
    return bits


def nominal(amplitude: FloatArray, width: FloatArray, time_s: FloatArray) -> Blocks:
    """Movements (n,) in blocks of the same amplitude and width of the target."""
    pairs, codes = np.unique(np.column_stack([amplitude, width]), axis=0, return_inverse=True)
    count = np.bincount(codes.ravel(), minlength=len(pairs))
    times = np.bincount(codes.ravel(), time_s, len(pairs)) / np.maximum(count, 1)
    amplitudes, widths = pairs[:, 0], pairs[:, 1]
    return Blocks(amplitudes, widths, index_of_difficulty(amplitudes, widths), times, count)


def effective(moved: FloatArray, deviations: FloatArray, time_s: FloatArray, block: Sequence[str]) -> Blocks:
    """Movements (n,) in named blocks: distance covered along the axis, deviation along it from the target, time.

    A block's amplitude is the mean distance, its width 4.133 SD of the deviations (Soukoreff and MacKenzie 2004,
    equations 2 to 4). A block of one movement, or without spread, distance or time, has none and is left out.
    """
    rows = []
    for name in dict.fromkeys(block):
        own = np.array([label == name for label in block])
        if own.sum() < 2:
            continue
        amplitude, width, time = float(moved[own].mean()), effective_width(deviations[own]), float(time_s[own].mean())
        if width > _ROUND_OFF * amplitude > 0 and time > 0:
            rows.append((amplitude, width, np.log2(amplitude / width + 1), time, own.sum()))
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    amplitudes, widths, difficulties, times, counts = table.T
    return Blocks(amplitudes, widths, difficulties, times, counts.astype(np.int64))


def fitted(blocks: Blocks) -> Fitted:
    """The line by least squares over blocks, each counting once, with 95 % intervals by t; of three blocks or more."""
    m, x, y = len(blocks.difficulty), blocks.difficulty, blocks.time_s
    if m == 0:
        return Fitted(0, status=TOO_FEW_VALUES)
    throughput = float(np.mean(x / y)) if (y > 0).all() else None
    if m < 3:
        return Fitted(m, throughput_bits_s=throughput, status=TOO_FEW_VALUES)
    if negligible(float(np.sum((x - x.mean()) ** 2)), x):
        return Fitted(m, throughput_bits_s=throughput, status=NO_VARIATION)
    from scipy import stats  # a third of what a process imports that only reads and fuses logs, which has no lines

    line = stats.linregress(x, y)
    t = float(stats.t.ppf(0.975, m - 2))
    slope, intercept = float(line.slope), float(line.intercept)
    of_slope, of_intercept = t * float(line.stderr), t * float(line.intercept_stderr)
    flat = negligible(float(np.sum((y - y.mean()) ** 2)), y)
    return Fitted(
        m,
        intercept,
        slope,
        (intercept - of_intercept, intercept + of_intercept),
        (slope - of_slope, slope + of_slope),
        None if flat else float(line.rvalue**2),
        throughput,
    )
