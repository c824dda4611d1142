"""The pairs to compare: of conditions, and those that follow up an analysis of variance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import Result


@dataclass(frozen=True)
class Pair:
    """Two values of each participant, or one of each in two groups, first minus second being the contrast."""

    effect: str
    contrast: str
    first: FloatArray
    second: FloatArray
    paired: bool = True


def of_conditions(values: FloatArray, conditions: Sequence[str]) -> list[Pair]:
    """Every two columns of values (n, k), in order."""
    return [
        Pair("condition", f"{conditions[i]} - {conditions[j]}", values[:, i], values[:, j])
        for i, j in combinations(range(len(conditions)), 2)
    ]


def names_in(contrast: str) -> tuple[str, str] | None:
    """The two names of a contrast `A - B`; None where names that hold " - " can be read in two ways."""
    first, _, second = contrast.partition(" - ")
    return (first, second) if contrast.count(" - ") == 1 else None


@dataclass(frozen=True)
class FollowUp:
    """A pair and its test."""

    pair: Pair
    result: Result


def of_groups(groups: Sequence[FloatArray], names: Sequence[str], effect: str = "group", at: str = "") -> list[Pair]:
    """Every two groups, in order; `at` says where they are compared."""
    return [
        Pair(effect, f"{names[i]} - {names[j]}" + (f" | {at}" if at else ""), groups[i], groups[j], paired=False)
        for i, j in combinations(range(len(groups)), 2)
    ]


def follow_ups(values: FloatArray, factors: Sequence[str], levels: Sequence[Sequence[str]]) -> list[Pair]:
    """The pairs that follow up an analysis of variance of values (n, k₁, k₂, …), effect by effect.

    Of a factor of three levels or more every two of its means. Of an interaction its simple effects: every two
    conditions (or levels of its first factor, where `condition` is not in it) at each level of the others; factors
    outside the effect are averaged over.
    """
    sizes = range(1, len(factors) + 1)
    effects = [effect for size in sizes for effect in combinations(range(len(factors)), size)]
    # Of a factor of two levels F is the comparison.
    left_open = [effect for effect in effects if len(effect) > 1 or len(levels[effect[0]]) > 2]
    return [pair for effect in left_open for pair in of_effect(values, factors, levels, effect)]


def of_effect(
    values: FloatArray, factors: Sequence[str], levels: Sequence[Sequence[str]], effect: tuple[int, ...]
) -> Iterator[Pair]:
    """The pairs of one effect, given as the places of its factors."""
    name = ":".join(factors[index] for index in effect)
    compared = next((index for index in effect if factors[index] == "condition"), effect[0])
    held = [index for index in effect if index != compared]
    outside = tuple(index + 1 for index in range(len(factors)) if index not in effect)
    means = np.moveaxis(values.mean(axis=outside, keepdims=True), compared + 1, 1)
    rest = [index for index in range(len(factors)) if index != compared]
    for at in product(*(range(len(levels[index])) for index in held)):
        place = tuple(at[held.index(index)] if index in held else 0 for index in rest)
        where = ", ".join(levels[index][level] for index, level in zip(held, at, strict=True))
        columns = means[(slice(None), slice(None), *place)]
        for i, j in combinations(range(len(levels[compared])), 2):
            contrast = f"{levels[compared][i]} - {levels[compared][j]}" + (f" | {where}" if where else "")
            yield Pair(name, contrast, columns[:, i], columns[:, j])
