"""The effects of a planned study, each with what computes its power: a closed form, a simulation, or both.

A question about a plan has three parts, of which two are stated: the effect, the participants, the power.
`participants_for` leaves out the second, `effect_for` the first, and `power_of` the third.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from pipeline.statistics.power import Design, difference_of_dz
from pipeline.statistics.power_designs import (
    FactorialEffect,
    PairedT,
    Planned,
    SeveralGroups,
    TwoGroups,
    detectable,
    fewest,
)
from pipeline.statistics.power_groups import Groups, effect_of, simulate_groups
from pipeline.statistics.power_simulation import Share, crossings, simulate
from pipeline.statistics.sample_size import FEWEST, Needed, needed

SharesOf = Callable[[float, int], Share]
"""The share of simulated studies that find an effect, with n participants in each group."""
_LARGEST_SIMULATED = 10.0


@dataclass(frozen=True)
class PlannedEffect:
    """One effect of a planned study. At least one of `closed_form` and `shares` is there.

    `sizes` are the groups' sizes in multiples of the first; a design without groups has one of them. `epsilon` is
    the lack of sphericity that its closed form takes for granted, 1 for none.
    """

    name: str
    closed_form: Planned | None = None
    shares: SharesOf | None = None
    sizes: tuple[float, ...] = (1.0,)
    epsilon: float = 1.0

    def group_sizes(self, n: int) -> tuple[int, ...]:
        """How many participants each group has where the first has n; no group has fewer than two."""
        return (n, *(max(FEWEST, round(ratio * n)) for ratio in self.sizes[1:]))


@dataclass(frozen=True)
class SmallestEffect:
    """The smallest effect that is detected: in closed form, or else by simulation with its error, low and high.

    Both are None where even the largest effect is not detected.
    """

    closed_form: float | None
    simulated: tuple[float, float, float] | None

    @property
    def size(self) -> float | None:
        """Its size, by whichever way computed it."""
        if self.closed_form is not None or self.simulated is None:
            return self.closed_form
        return self.simulated[0]


@dataclass(frozen=True)
class Participants:
    """The fewest participants in the first group, by each way; None where `most` are not enough."""

    closed_form: int | None
    simulated: Needed | None

    @property
    def judged_by(self) -> int | None:
        """The closed form's answer where there is one, for it has no error of simulation."""
        if self.closed_form is not None or self.simulated is None:
            return self.closed_form
        return self.simulated.n


def effect_for(planned: PlannedEffect, n: int, power: float) -> SmallestEffect:
    """The smallest effect that n participants in the first group find with this power."""
    if planned.closed_form is not None:
        return SmallestEffect(detectable(planned.closed_form, n, power), None)
    shares = planned.shares
    return SmallestEffect(None, shares and crossings(lambda effect: shares(effect, n), power, _LARGEST_SIMULATED))


def participants_for(planned: PlannedEffect, effect: float, power: float, most: int) -> Participants:
    """The fewest participants that find this effect with this power, looked for up to `most` in the first group."""
    shares, closed, simulated = planned.shares, None, None
    if planned.closed_form is not None:
        closed = fewest(planned.closed_form, effect, power, most)
    if shares is not None:
        simulated = needed(lambda n: shares(effect, n), power, closed or min(most, 30), most)
    return Participants(closed, simulated)


def power_of(planned: PlannedEffect, effect: float, n: int) -> tuple[float | None, Share | None]:
    """The power of n participants in the first group, in closed form and by simulation."""
    closed = None if planned.closed_form is None else planned.closed_form.power(effect, n)
    return closed, None if planned.shares is None else planned.shares(effect, n)


def paired(test: str, alpha: float, studies: int, seed: int) -> PlannedEffect:
    """`t_paired` or `wilcoxon`; the effect is d_z."""

    def shares(dz: float, n: int) -> Share:
        # Half-correlated conditions, for which d and d_z are equal: only d_z matters here.
        return simulate(Design(test, difference_of_dz(dz, 0.5), 0.5, 2, alpha), n, studies, seed).own

    return PlannedEffect("condition", PairedT(alpha) if test == "t_paired" else None, cache(shares))


def groups(
    test: str, sds: tuple[float, ...], size_ratios: tuple[float, ...], alpha: float, studies: int, seed: int
) -> PlannedEffect:
    """A test of groups alone: of two the effect is d, of more it is f, both over the root of the mean variance.

    `size_ratios` other than 1 have a closed form for two groups only; more groups are of one size.
    """
    simulated = Groups(test, sds, size_ratios, alpha)
    closed: Planned | None = None
    if test == "t_welch":
        closed = TwoGroups(alpha, sds[1] / sds[0], size_ratios[1] / size_ratios[0])
    elif test == "anova_welch":
        closed = SeveralGroups(len(sds), alpha, sds)
    to_f = effect_of if test in ("t_welch", "mann_whitney") else float
    return PlannedEffect(
        "group",
        closed,
        cache(lambda effect, n: simulate_groups(simulated, to_f(effect), n, studies, seed)),
        tuple(ratio / size_ratios[0] for ratio in size_ratios),
    )


def factorial(
    levels: Sequence[int], group_count: int, correlation: float, epsilon: float, alpha: float
) -> list[PlannedEffect]:
    """Every effect of a repeated-measures (one group) or mixed ANOVA; the effect is Cohen's f.

    Of an effect with one degree of freedom ε is 1 whatever is stated, and of no effect below 1 over its degrees.
    """
    names = factor_names(len(levels))
    return [
        PlannedEffect(
            ":".join((["group"] if with_group else []) + [names[place] for place in places]),
            FactorialEffect(tuple(levels), places, group_count, with_group, correlation, own, alpha),
            sizes=(1.0,) * group_count,
            epsilon=own,
        )
        for with_group, places in _effects(len(levels), group_count)
        for own in [max(epsilon, 1 / contrasts(levels, places))]
    ]


def factor_names(count: int) -> list[str]:
    """`condition`, `factor_2`, `factor_3`: the within-factors of a plan, which has no names for them yet."""
    return ["condition", *(f"factor_{place}" for place in range(2, count + 1))]


def contrasts(levels: Sequence[int], places: Sequence[int]) -> int:
    """The degrees of freedom of an effect within people: the product of the levels, each less one."""
    return int(np.prod([levels[place] - 1 for place in places], dtype=np.int64))


def _effects(factors: int, group_count: int) -> Iterator[tuple[bool, tuple[int, ...]]]:
    """Each effect as whether the group is in it, and the places of the within-factors in it."""
    if group_count > 1:
        yield True, ()
    within = [places for size in range(1, factors + 1) for places in combinations(range(factors), size)]
    yield from ((False, places) for places in within)
    if group_count > 1:
        yield from ((True, places) for places in within)
