"""Simulated studies: does the rank-biserial's interval hold it, and how often do errors and counts differ by chance?

`python -m tests.benchmarks.coverage` alone, or as a part of `make bench`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.clustered import Family, Trials, gee
from pipeline.statistics.wilcoxon import wilcoxon

STUDIES, LARGE = 1000, 20_000
SHIFTS = (0.0, 0.3, 0.6, 1.0, 1.5)
Draw = Callable[[np.random.Generator, float, tuple[int, int]], FloatArray]


def _rated(random: np.random.Generator, shift: float, shape: tuple[int, int]) -> FloatArray:
    """Differences of ratings from 1 to 7."""
    first, second = (
        np.clip(np.rint(random.normal(4 + half, 1, shape)), 1, 7) for half in (0.65 * shift, -0.65 * shift)
    )
    difference: FloatArray = first - second
    return difference


KINDS: Mapping[str, Draw] = {
    "normal": lambda random, shift, shape: random.normal(shift, 1, shape),
    "heavy tails": lambda random, shift, shape: random.standard_t(3, shape) / np.sqrt(3) + shift,
    "skewed": lambda random, shift, shape: random.exponential(1, shape) - 1 + shift,
    "rated 1 to 7": _rated,
}


def _correlations(differences: FloatArray) -> FloatArray:
    """r of each row, zeros dropped."""
    nonzero = differences != 0
    ranks = stats.rankdata(np.abs(differences), axis=1) - np.sum(~nonzero, axis=1, keepdims=True)
    signed: FloatArray = np.sum(np.sign(differences) * ranks, axis=1) / np.sum(ranks * nonzero, axis=1)
    return signed


def rank_biserial(n: int = 12) -> None:
    """Coverage of the 95 % interval around what r is on average at this n, by distribution and shift."""
    print(f"Rank-biserial correlation, {n} participants, {STUDIES} studies each: share of 95 % intervals that hold it")
    print(f"  {'differences':<16}" + "".join(f"{f'shift {shift:g}':>12}" for shift in SHIFTS))
    contradicting, least = 0, 1.0
    for name, draw in KINDS.items():
        shares = []
        for shift in SHIFTS:
            random = np.random.default_rng([n, int(10 * shift)])
            zero = np.zeros(n)
            true = float(np.mean(_correlations(draw(random, shift, (LARGE, n)))))
            found = [wilcoxon(row, zero) for row in draw(random, shift, (STUDIES, n))]
            bounds = [(one.ci_low or -1.0, one.ci_high or 1.0, one.p or 1.0) for one in found if one.p is not None]
            shares.append(sum(low <= true <= high for low, high, _ in bounds) / len(bounds))
            contradicting += sum((low > 0 or high < 0) != (p < 0.05) for low, high, p in bounds)
        least = min(least, *shares)
        print(f"  {name:<16}" + "".join(f"{share:>12.3f}" for share in shares))
    print(f"  least {least:.3f}; intervals that contradict p: {contradicting}")


def _outcomes(
    random: np.random.Generator, person: FloatArray, shape: tuple[int, int, int], family: Family
) -> FloatArray:
    """Errors, or counts that vary more than Poisson's law has it."""
    if family == "logit":
        return (random.random(shape) < 1 / (1 + np.exp(1 - person))).astype(np.float64)
    return random.negative_binomial(2, 1 / (1 + np.exp(person / 2) / 2), shape).astype(np.float64)


def errors_and_counts() -> None:
    """p below .05 where conditions are alike and people are not, each in each condition a little otherwise too."""
    print(f"Errors and counts by GEE, {STUDIES} studies each without an effect: share with p below .05")
    families: tuple[Family, ...] = ("logit", "poisson")
    for family, people, conditions in product(families, (8, 12, 20), (2, 3)):
        random = np.random.default_rng([people, conditions])
        shape = (people, conditions, 10)
        owners = [str(person) for person in np.repeat(range(people), conditions * 10)]
        codes = np.tile(np.repeat(range(conditions), 10), people).astype(np.int64)
        p_values = []
        for _ in range(STUDIES):
            person = random.normal(0, 1, people)[:, None, None] + random.normal(0, 0.4, shape[:2])[:, :, None]
            trials = Trials(_outcomes(random, person, shape, family).ravel(), owners, codes)
            p_values.append(gee(trials, [str(level) for level in range(conditions)], family)[0].p)
        known = [p for p in p_values if p is not None]
        share = np.mean([p < 0.05 for p in known])
        print(f"  {family:<8} {people:>3} people, {conditions} conditions: {share:.3f} ({len(known)} studies)")


if __name__ == "__main__":
    rank_biserial()
    errors_and_counts()
