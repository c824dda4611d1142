"""The exact distribution of Friedman's statistic, ties included.

Theory of operation. If conditions make no difference, each participant's ranks are as likely in any order, whatever
ties they have. Friedman's χ² grows with Σ Rⱼ², the squares of the conditions' rank sums, and everything else in it is
the same in every order; so p is the share of orders whose Σ Rⱼ² is no less than the one found.

    participants taken in        states: sorted rank sums, how likely each is
    P1                           (1, 2, 3): 1
    P1, P2                       (2, 4, 6): 1/6   (2, 5, 5): 1/6   (3, 3, 6): 1/6   (3, 4, 5): 2/6   (4, 4, 4): 1/6

One participant after the other is convolved in: to every state each order of their ranks is added. The conditions are
exchangeable, so a state need not say which condition has which sum; sorted, there are k! times fewer of them. Ranks
are doubled, for midranks are halves: all comparisons are of whole numbers, and no tie is missed or made by round-off.
The last participant needs no new states, only their squares: Σ (s + r)² = Σ s² + 2 Σ s·r + Σ r², one matrix product.

What it costs is known beforehand only roughly, so the sums that are made are counted, and beyond `MOST_SUMS` (about a
second) there is no exact p. The count does not depend on the machine.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray

MOST_SUMS = 1_500_000
_LAST_IS_CHEAPER = 8  # times
_MOST_CONDITIONS = 7  # 5,040 orders


def friedman_p(ranks: FloatArray) -> float | None:
    """P(χ² ≥ the one found) of midranks (n, k); None where it would take longer than about a second."""
    k = ranks.shape[1]
    doubled = np.rint(2 * ranks).astype(np.int64)
    base = int(doubled.sum()) + 1  # no rank sum reaches it, so that sums are the digits of one whole number
    if k > _MOST_CONDITIONS or base**k > np.iinfo(np.int64).max:
        return None
    observed = int(np.sum(doubled.sum(axis=0) ** 2))
    states, chances, made = np.zeros((1, k), dtype=np.int64), np.ones(1), 0
    *others, last = (np.array(sorted(set(permutations(row.tolist()))), dtype=np.int64) for row in doubled)
    for orders in others:
        made += len(states) * len(orders)
        if made > MOST_SUMS:
            return None
        states, chances = _with_one_more(states, chances, orders, base)
    if made + len(states) * len(last) / _LAST_IS_CHEAPER > MOST_SUMS:
        return None
    squares = np.sum(states**2, axis=1)[:, None] + 2 * states @ last.T + np.sum(last**2, axis=1)
    return float(min(1.0, np.sum(chances @ (squares >= observed)) / len(last)))


def _with_one_more(states: IntArray, chances: FloatArray, orders: IntArray, base: int) -> tuple[IntArray, FloatArray]:
    """The states (s, k) and their chances (s,) after one more participant, whose ranks stand in any of the orders."""
    sums = np.sort((states[:, None, :] + orders).reshape(-1, states.shape[1]), axis=1)
    digits = base ** np.arange(states.shape[1])
    _, first, which = np.unique(sums @ digits, return_index=True, return_inverse=True)
    added: FloatArray = np.bincount(which, np.repeat(chances / len(orders), len(orders))).astype(np.float64)
    return sums[first].astype(np.int64), added
