"""Which p values a Wilcoxon signed-rank test of n pairs can have, whatever its zeros and ties.

Exact p values are multiples of 2⁻ⁿ, and which of them occur depends on the ties. All patterns of zeros and ties are
tried: zeros dropped (Wilcoxon) or ranked and then dropped (Pratt 1959), midranks for ties. For the normal
approximation every number of zeros, sum of tie corrections and rank sum is allowed, with and without the corrections
for ties and continuity. So what is called impossible here cannot occur.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from math import ceil, floor
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipeline.study.rounded import Interval

MOST_FOR_ALL_PATTERNS = 14
MOST_FOR_NORMAL = 40
MOST_FOR_UNTIED = 200
_ROUND_OFF = 1e-9

Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Pattern:
    """The distribution of 2·W₊ over all signs of `ranked` differences: how many of the 2^ranked give each value."""

    ranked: int
    counts: Counts

    @property
    def tails(self) -> Counts:
        """P(W₊ ≤ w)·2^ranked for each value of 2w; by symmetry the upper tails too."""
        return np.cumsum(self.counts)


def patterns(n: int) -> Iterator[Pattern]:
    """Every pattern of zeros and ties among n differences, at least one of them not zero."""
    yield from _tied(0, n, shorter_too=True)
    for zeros in range(1, n):
        yield from _tied(zeros, n, shorter_too=False)


def _tied(zeros: int, n: int, shorter_too: bool) -> Iterator[Pattern]:
    """All ways to tie the ranks zeros + 1 to n; with `shorter_too` also only the first of them, for zeros dropped."""
    pending: list[tuple[int, Counts]] = [(zeros, np.ones(1, dtype=np.int64))]
    while pending:
        done, counts = pending.pop()
        for size in range(1, n - done + 1):
            grown = counts
            doubled_midrank = 2 * done + size + 1
            for _ in range(size):
                grown = _one_more(grown, doubled_midrank)
            if shorter_too or done + size == n:
                yield Pattern(done + size - zeros, grown)
            if done + size < n:
                pending.append((done + size, grown))


def _one_more(counts: Counts, doubled_rank: int) -> Counts:
    """The distribution with one further difference, positive or negative."""
    longer = np.zeros(len(counts) + doubled_rank, dtype=np.int64)
    longer[: len(counts)] = counts
    longer[doubled_rank:] += counts
    return longer


@cache
def exact_tails(n: int) -> Flags:
    """Which numbers of the 2ⁿ signs a tail can hold, over all patterns of n differences."""
    flags = np.zeros(2**n + 1, dtype=np.bool_)
    for pattern in patterns(n):
        flags[pattern.tails[pattern.counts > 0] << (n - pattern.ranked)] = True
    return flags


def exact_p_possible(n: int, p: Interval, sides: int) -> bool:
    """Can an exact p lie in the interval, for n up to MOST_FOR_ALL_PATTERNS?"""
    if sides == 2 and p.high >= 1:
        return True  # twice a tail of a half or more counts as 1
    first, last = ceil(p.low * 2**n / sides), floor(p.high * 2**n / sides)
    return bool(exact_tails(n)[max(first, 0) : last + 1].any())


def untied_p_possible(n: int, p: Interval, sides: int) -> bool:
    """The same without ties and with few zeros, for larger n: True is proof, False is not."""
    for ranked in range(n, max(n - 10, 0), -1):
        tails = _untied_tails(ranked)
        p_values = np.minimum(1.0, sides * tails)
        if ((float(p.low) <= p_values) & (p_values <= float(p.high))).any():
            return True
    return False


@cache
def _untied_tails(ranked: int) -> npt.NDArray[np.float64]:
    """P(W₊ ≤ w) for w from 0 up, no ties."""
    probability = np.ones(1)
    for rank in range(1, ranked + 1):
        longer = np.zeros(len(probability) + rank)
        longer[: len(probability)] = probability / 2
        longer[rank:] += probability / 2
        probability = longer
    tails: npt.NDArray[np.float64] = np.cumsum(probability)
    return tails


def exact_p_with_sum(n: int, rank_sum: Interval, p: Interval, sides: int) -> bool:
    """Is there a pattern with this rank sum and this exact p, for n up to MOST_FOR_ALL_PATTERNS?

    The sum may be W₊, W₋, the smaller of them, or their difference.
    """
    for pattern in patterns(n):
        lower = pattern.tails
        upper = np.cumsum(pattern.counts[::-1])[::-1]
        whole = 2**pattern.ranked
        tails = np.minimum(lower, upper) * 2 if sides == 2 else lower
        low, high = float(p.low * whole) - _ROUND_OFF, float(p.high * whole) + _ROUND_OFF
        in_p = (pattern.counts > 0) & (np.minimum(tails, whole) >= low) & (np.minimum(tails, whole) <= high)
        if in_p.any() and any(sum_fits(rank_sum, int(w), len(pattern.counts) - 1) for w in np.flatnonzero(in_p)):
            return True
    return False


def sum_fits(rank_sum: Interval, doubled: int, doubled_total: int) -> bool:
    """Is a printed W one of W₊, W₋ and their difference? `doubled` is 2·W₊, `doubled_total` that of all ranks."""
    doubled_negative = doubled_total - doubled
    return any(
        rank_sum.low * 2 <= value <= rank_sum.high * 2
        for value in (doubled, doubled_negative, abs(doubled - doubled_negative))
    )


@dataclass(frozen=True)
class Approximation:
    """The normal approximation at one number of zeros: all rank sums, and the variances that ties leave."""

    doubled_total: int  # of the ranks
    sd: npt.NDArray[np.float64]  # one for each sum of tie corrections; the first is that without ties


@cache
def approximations(n: int) -> tuple[Approximation, ...]:
    """The approximations for n differences, of which 0 to n − 1 are zero, with zeros dropped or ranked (Pratt)."""
    by_zeros = []
    for zeros in range(n):
        ranked = n - zeros
        for below in {0, zeros}:  # zeros that took ranks
            m = ranked + below
            total = m * (m + 1) // 2 - below * (below + 1) // 2
            squares = (m * (m + 1) * (2 * m + 1) - below * (below + 1) * (2 * below + 1)) / 6
            variances = squares / 4 - np.array(_tie_sums(ranked), dtype=np.float64) / 48
            by_zeros.append(Approximation(2 * total, np.sqrt(variances)))
    return tuple(by_zeros)


@cache
def _tie_sums(ranked: int) -> tuple[int, ...]:
    """Every value of Σ(t³ − t) over the ways to tie `ranked` differences in groups of t, ascending."""
    reachable = [1] + [0] * ranked  # bits: which sums, a sixth of them
    for size in range(1, ranked + 1):
        for filled in range(size, ranked + 1):
            reachable[filled] |= reachable[filled - size] << ((size**3 - size) // 6)
    bits = reachable[ranked]
    return tuple(6 * index for index in range(bits.bit_length()) if bits >> index & 1)


def normal_p_possible(n: int, p: Interval, sides: int, fits: Callable[[int, int], bool] | None = None) -> bool:
    """Can the normal approximation's p lie in the interval, for n up to MOST_FOR_NORMAL?

    `fits(doubled W, doubled total)` may restrict the rank sums.
    """
    from scipy import stats

    tails = [(float(p.low) / sides, float(p.high) / sides)]
    if sides == 1:
        tails.append((1 - float(p.high), 1 - float(p.low)))  # of the other side, where the correction adds
    elif p.high >= 1:
        tails.append((0.5, 0.5))
    for low, high in tails:
        if low > 0.5:
            continue
        nearest = float(stats.norm.isf(min(high, 0.5))) * (1 - _ROUND_OFF)
        furthest = float(stats.norm.isf(max(low, 0.0))) * (1 + _ROUND_OFF) + _ROUND_OFF
        for approximation in approximations(n):
            for correction in (0, 1) if sides == 2 else (0, 1, -1):
                if _reaches(approximation, correction, (nearest, furthest), fits):
                    return True
    return False


def _reaches(
    approximation: Approximation,
    correction: int,
    z_size: tuple[float, float],
    fits: Callable[[int, int], bool] | None,
) -> bool:
    """Is there a rank sum whose |z| lies between the two?

    With w = 2·W₊ and T the sum of all ranks, 2·|W₊ − T/2| = |w − T|; without ties w is even. The correction for
    continuity takes `correction` off |w − T|.
    """
    total = approximation.doubled_total // 2
    for untied, sd in ((True, approximation.sd[:1]), (False, approximation.sd)):
        low = np.maximum(np.ceil(2 * sd * z_size[0] + correction - _ROUND_OFF), 0).astype(np.int64)
        high = np.floor(np.minimum(2 * sd * z_size[1] + correction + _ROUND_OFF, total)).astype(np.int64)
        if untied:  # |w − T| has T's parity
            low = low + (low - total) % 2
        reached = low <= high
        if fits is None and reached.any():
            return True
        if fits is not None and reached.any():
            sizes = range(int(low[reached].min()), int(high[reached].max()) + 1, 2 if untied else 1)
            if any(fits(total + size, 2 * total) for size in sizes):
                return True
    return False


def smallest_p(n: int, sides: int, method: Literal["exact", "normal"] | None = None) -> float:
    """No p of n pairs by the method, or by either, is smaller: all differences of one sign, for the normal all tied."""
    from scipy import stats

    by_method = {"exact": sides / 2**n, "normal": sides * float(stats.norm.sf(np.sqrt(n)))}
    return float(min(by_method.values()) if method is None else by_method[method]) * (1 - _ROUND_OFF)
