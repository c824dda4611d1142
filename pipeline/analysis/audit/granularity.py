"""Which means and SDs n scores on a stepped scale can have: GRIM and GRIMMER, exactly.

GRIM: a mean of n such scores is a whole number of steps over n (Brown and Heathers 2017). GRIMMER: so is the sum of
squares, with the parity of the sum (Anaya 2016; Allard 2018). Beyond the published tests, a sample with both sums is
searched for, so that a scale's ends and a very small n matter too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, isqrt

from pipeline.study.rounded import Interval

_MOST_LOOKS = 20_000  # steps of a search, after which a sample counts as possible without proof
_MOST_SUMS = 200  # pairs of sums tried, before the figures count as possible
_MOST_TOTALS = 10_000  # sums tried, before the figures count as possible


@dataclass(frozen=True)
class Steps:
    """A scale: origin + k · grain for whole k, from `least` to `most` where the scale has ends.

    `grain` is the step over the number of items whose mean a score is.
    """

    grain: Fraction
    origin: Fraction = Fraction(0)
    least: int | None = None
    most: int | None = None

    def totals(self, mean: Interval, n: int) -> range:
        """The sums of k over n scores that a mean leaves open, none where there is no such sum (GRIM)."""
        low, high = ((bound - self.origin) / self.grain * n for bound in (mean.low, mean.high))
        first, last = ceil(low), floor(high)
        if self.least is not None:
            first = max(first, n * self.least)
        if self.most is not None:
            last = min(last, n * self.most)
        return range(first, last + 1)

    def mean(self, total: int, n: int) -> Fraction:
        """The mean that a sum of k stands for."""
        return self.origin + self.grain * Fraction(total, n)

    def nearest_means(self, mean: Fraction, n: int) -> tuple[Fraction, Fraction]:
        """The possible means around a value, whatever the scale's ends."""
        exact = (mean - self.origin) / self.grain * n
        return self.mean(floor(exact), n), self.mean(floor(exact) + 1, n)


def possible_sample(
    steps: Steps, mean: Interval, sd: Interval, n: int, divisor: int
) -> tuple[Fraction, Fraction] | None:
    """The mean and variance of n ≥ 2 scores that both figures leave open (GRIMMER); None where there is none.

    `divisor` is that of the variance, n − 1 for a sample's. Where a search would take too long the figures count as
    possible: None is proof.
    """
    tried = 0
    within = sd.at_least(0)
    spread = within.squared() * (Fraction(divisor) / steps.grain**2)
    for index, total in enumerate(steps.totals(mean, n)):
        centre = Fraction(total**2, n)
        if index > _MOST_TOTALS:
            return steps.mean(total, n), within.high**2
        first, last = ceil(spread.low + centre), floor(spread.high + centre)
        first += (first - total) % 2
        for squares in range(first, last + 1, 2):
            tried += 1
            if tried > _MOST_SUMS or has_sample(n, total, squares, steps.least, steps.most) is not False:
                return steps.mean(total, n), (squares - centre) / divisor * steps.grain**2
    return None


def has_sample(n: int, total: int, squares: int, least: int | None, most: int | None) -> bool | None:
    """Are there n whole numbers from `least` to `most` with this sum and this sum of squares? None: unknown."""
    spread = n * squares - total**2
    if spread < 0:
        return False
    # No number is further from the mean than √((n − 1)·spread)/n; with that every scale has ends.
    reach = isqrt((n - 1) * spread) + 1
    low, high = floor(Fraction(total - reach, n)), ceil(Fraction(total + reach, n))
    low = low if least is None else max(low, least)
    high = high if most is None else min(high, most)
    if high < low:
        return False
    return _search(n, total - n * low, squares - 2 * low * total + n * low**2, high - low)


def _search(n: int, total: int, squares: int, most: int) -> bool | None:
    """The same for numbers from 0 to `most`: take off the largest, then the next that is no larger, and so on.

    The remaining numbers, none larger than the last taken, must reach what is left of both sums. A state that led
    nowhere is not entered twice.
    """
    if not _may_have(n, total, squares, most):
        return False
    seen: set[tuple[int, int, int, int]] = set()
    pending = [(n, total, squares, most, _largest(n, total, squares, most))]
    looked = 0
    while pending:
        n, total, squares, most, candidates = pending[-1]
        if n == 1:
            return True  # total² = squares and 0 ≤ total ≤ most: _may_have has seen to it
        for value in candidates:
            looked += 1
            if looked > _MOST_LOOKS:
                return None
            state = (n - 1, total - value, squares - value**2, value)
            if state not in seen and _may_have(*state):
                seen.add(state)
                pending.append((*state, _largest(*state)))
                break
        else:
            pending.pop()
    return False


def _may_have(n: int, total: int, squares: int, most: int) -> bool:
    """Necessary: the sum is in reach, the parities are equal, the squares between those of even and extreme samples."""
    if not 0 <= total <= n * most or (squares - total) % 2:
        return False
    even, over = divmod(total, n)
    at_end, rest = divmod(total, most) if most else (0, 0)
    return (n - over) * even**2 + over * (even + 1) ** 2 <= squares <= at_end * most**2 + rest**2


def _largest(n: int, total: int, squares: int, most: int) -> Iterator[int]:
    """What the largest of n such numbers can be, from above: no more than √squares, no less than the mean."""
    return iter(range(min(most, isqrt(squares)), (total - 1) // n, -1))
