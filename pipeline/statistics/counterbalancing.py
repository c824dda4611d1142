"""Counterbalancing: orders of conditions that are balanced for position and for the preceding condition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations

import numpy as np

Order = tuple[int, ...]


def williams_design(conditions: int) -> list[Order]:
    """The sequences of a balanced Latin square, conditions counted from 0 (Williams 1949).

    In an even number of conditions every one follows every other once in a single square of as many sequences. In an
    odd number that takes two squares; the second is the first read backwards. ValueError for fewer than two.
    """
    if conditions < 2:
        raise ValueError(f"an order needs two conditions or more, found {conditions}")
    first = [(place + 1) // 2 if place % 2 else -(place // 2) for place in range(conditions)]
    square = [tuple((at + shift) % conditions for at in first) for shift in range(conditions)]
    return square if conditions % 2 == 0 else square + [order[::-1] for order in square]


Seed = int | tuple[int, ...] | None


def assigned(conditions: int, participants: int, seed: Seed = None) -> list[Order]:
    """One order per participant: complete squares one after the other, of the last one as much as is needed.

    With a seed, chance decides within each square who gets which sequence.
    """
    design = williams_design(conditions)
    squares = [design[start : start + conditions] for start in range(0, len(design), conditions)]
    random = None if seed is None else np.random.default_rng(seed)
    orders: list[Order] = []
    while len(orders) < participants:
        square = squares[len(orders) // conditions % len(squares)]
        places = range(conditions) if random is None else random.permutation(conditions)
        orders += [square[place] for place in places]
    return orders[:participants]


def allocated(groups: int, participants: int, seed: Seed = None) -> list[int]:
    """The group of each participant, counted from 0: in turn, one of each group in every block of participants.

    With a seed, chance decides the order of the groups each time (permuted blocks), so that group sizes never differ by
    more than one, whenever recruiting stops.
    """
    random = None if seed is None else np.random.default_rng(seed)
    group_of: list[int] = []
    while len(group_of) < participants:
        group_of += range(groups) if random is None else random.permutation(groups).tolist()
    return group_of[:participants]


def nested(conditions: int, levels: int, participants: int, seed: Seed = None) -> list[tuple[Order, ...]]:
    """For each participant the order of a second factor's levels in each condition, the conditions from 0 on.

    Participants who share a round of all sequences of conditions (`assigned`) share their orders of levels, the next
    round has the next ones, so that which level comes first is tied neither to a condition nor to its period; from one
    condition to the next the orders move on by one. With a seed, chance decides in which succession they come.
    """
    design, sequences = williams_design(levels), len(williams_design(conditions))
    random = None if seed is None else np.random.default_rng(seed)
    orders: list[tuple[Order, ...]] = []
    succession = [0] * len(design)
    for participant in range(participants):
        turn, within_round = divmod(participant, sequences)
        if within_round == 0 and turn % len(design) == 0:
            places = range(len(design)) if random is None else random.permutation(len(design))
            succession = [int(place) for place in places]
        orders.append(tuple(design[succession[(turn + condition) % len(design)]] for condition in range(conditions)))
    return orders


@dataclass(frozen=True)
class Balance:
    """How many times each condition comes in each period, and how many times one comes directly before another."""

    in_periods: Mapping[Hashable, tuple[int, ...]]
    in_pairs: Mapping[tuple[Hashable, Hashable], int]

    @property
    def period(self) -> tuple[int, int]:
        """The fewest and the most times that a condition stands in a period."""
        return _range(times for counts in self.in_periods.values() for times in counts)

    @property
    def neighbours(self) -> tuple[int, int]:
        """The fewest and the most times that one condition follows another."""
        return _range(self.in_pairs.values())

    @property
    def complete(self) -> bool:
        """Whether each condition is in each period, and follows each other one, equally often."""
        return len(set(self.period)) == len(set(self.neighbours)) == 1


def balance(orders: Sequence[Sequence[Hashable]]) -> Balance:
    """How evenly the orders, each of all the conditions, spread them."""
    conditions = orders[0]
    periods = Counter((condition, place) for order in orders for place, condition in enumerate(order))
    follows = Counter(pair for order in orders for pair in pairwise(order))
    return Balance(
        {condition: tuple(periods[condition, place] for place in range(len(conditions))) for condition in conditions},
        {pair: follows[pair] for pair in permutations(conditions, 2)},
    )


def _range(counts: Iterable[int]) -> tuple[int, int]:
    listed = list(counts)
    return min(listed), max(listed)
