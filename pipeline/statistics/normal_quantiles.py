"""Do values look normal? Each beside the normal quantile of its rank, and how far from it a normal one would lie.

The i-th smallest of n values of a uniform distribution has the beta distribution of i and n + 1 − i (David and Nagaraja
2003, section 2.3). Its quantiles at 2.5, 50 and 97.5 %, taken through the normal distribution, are the place m of the
i-th smallest of n normal values and a band about it, for a known mean and SD. Here values are standardised by their
own, which follow them: of the variance V of an ordered value they take (1 + m²/2) / n, their own variance there. So the
arms of the band are shortened by √(1 − (1 + m²/2) / (nV)). In simulations 95.1 to 97.7 % of 6 to 300 normal values lay
in the band, which else would hold 99.8 % and more; below six nearly all do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.result import negligible

LEVEL = 0.95
_FROM = 3  # values, as for Shapiro and Wilk's test


@dataclass(frozen=True)
class NormalQuantiles:
    """Of n values, each in its place (n,): standardised, its normal quantile, and the ends of the band there."""

    standardised: FloatArray
    quantiles: FloatArray
    low: FloatArray
    high: FloatArray


def normal_quantiles(values: FloatArray) -> NormalQuantiles | None:
    """Values (n,) less their mean over their SD, beside normal ones; None below three, or where they do not vary."""
    (scaled,), _ = at_unit_scale([values])
    n = len(scaled)
    apart = scaled - np.mean(scaled) if n else scaled
    if n < _FROM or negligible(float(np.sum(apart**2)), scaled):
        return None
    ranks = np.empty(n)
    ranks[np.argsort(apart, kind="stable")] = np.arange(1, n + 1)
    tail = (1 - LEVEL) / 2
    shares = (tail, 0.5, 1 - tail)
    # The quantiles of `scipy.stats`, whose checks of what it is given take thirty times as long as the numbers.
    places = (special.betaincinv(ranks, n + 1 - ranks, share) for share in shares)
    low, middle, high = (np.asarray(special.ndtri(place), np.float64) for place in places)
    variance = ((high - low) / 2 / special.ndtri(1 - tail)) ** 2
    shorter = np.sqrt(np.maximum(0.0, 1 - (1 + middle**2 / 2) / (n * variance)))
    ends: list[FloatArray] = [middle + shorter * (end - middle) for end in (low, high)]
    return NormalQuantiles(apart / np.std(apart, ddof=1), middle, *ends)
