"""How often a test finds an effect where there is none: its type I error on studies drawn without one."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from pipeline.statistics import with_pingouin
from pipeline.statistics.art import art_contrasts
from pipeline.statistics.kruskal import kruskal_wallis
from pipeline.statistics.mann_whitney import mann_whitney
from pipeline.statistics.mixed import Factor, cells_of, mixed_model
from pipeline.statistics.mixed_anova import mixed_anova
from pipeline.statistics.power_simulation import Share
from pipeline.statistics.welch import anova_welch, t_welch

Draw = Callable[[np.random.Generator], float | None]
"""The p of one study without an effect; None where it is undefined."""

ACCEPTED = 0.03, 0.07


def _groups(random: np.random.Generator, sizes: tuple[int, ...], spreads: tuple[float, ...]) -> list[np.ndarray]:
    return [random.normal(5, spread, size) for size, spread in zip(sizes, spreads, strict=True)]


def _nested(targets: int) -> Draw:
    """12 people, 2 conditions, 6 trials each: people differ in level and in what the condition does to them."""
    people, condition = np.repeat(np.arange(12), 12), np.tile(np.repeat([0, 1], 6), 12)
    target = np.tile(np.arange(6), 24)

    def draw(random: np.random.Generator) -> float | None:
        values = random.normal(0, 2, 12)[people] + random.normal(0, 1, 24)[2 * people + condition]
        values += random.normal(0, 0.8, 6)[target] * bool(targets) + random.normal(0, 1, len(people))
        kept = random.random(len(people)) > 0.1
        names, factor = [str(code) for code in people[kept]], Factor(("a", "b"), condition[kept])
        random_intercepts = {"participant:condition": cells_of(names, factor)}
        if targets:
            random_intercepts["target"] = target[kept]
        return mixed_model(values[kept], names, {"condition": factor}, ["condition"], random_intercepts)[0].p

    return draw


def _without_cells(random: np.random.Generator) -> float | None:
    """The same by (1 | participant) alone: what the further intercept is for."""
    people, condition = np.repeat(np.arange(12), 12), np.tile(np.repeat([0, 1], 6), 12)
    values = random.normal(0, 2, 12)[people] + random.normal(0, 1, 24)[2 * people + condition]
    values += random.normal(0, 1, len(people))
    columns = {"condition": Factor(("a", "b"), condition)}
    return mixed_model(values, [str(code) for code in people], columns, ["condition"])[0].p


def _mixed_anova(effect: int) -> Draw:
    def draw(random: np.random.Generator) -> float | None:
        values = random.normal(0, 2, (18, 1)) + random.normal(0, 1, (18, 3)) * np.array([1, 1.5, 2])
        found = mixed_anova(values, np.repeat([0, 1], [7, 11]), "group", ["condition"])[effect]
        return found.details["p_gg"] or found.p

    return draw


def _art_contrast(ratio: float) -> Draw:
    """Times of 12 people in 3 × 2 cells, of which the second factor makes some `ratio` times as long."""

    def draw(random: np.random.Generator) -> float | None:
        logs = random.normal(0, 0.3, (12, 1, 1)) + random.normal(0, 0.3, (12, 3, 2)) + np.array([0, np.log(ratio)])
        return art_contrasts(np.exp(3 + logs), ["condition", "task"], [list("abc"), list("xy")])[0].result.p

    return draw


TESTS: dict[str, Draw] = {
    "mixed_model, (1 | participant:condition)": _nested(0),
    "mixed_model, the same and (1 | target)": _nested(6),
    "t_welch, 8 and 16, SD 2 and 1": lambda random: t_welch(random.normal(5, 2, 8), random.normal(5, 1, 16)).p,
    "mann_whitney, 8 and 12": lambda random: mann_whitney(random.normal(size=8), random.normal(size=12)).p,
    "anova_welch, 8, 10, 14, SD 3, 2, 1": lambda random: anova_welch(_groups(random, (8, 10, 14), (3, 2, 1))).p,
    "games_howell, any of the three pairs": lambda random: min(
        p for *_, p in with_pingouin.games_howell(_groups(random, (8, 10, 14), (3, 2, 1)))
    ),
    "kruskal, 8, 10, 14": lambda random: kruskal_wallis(_groups(random, (8, 10, 14), (1, 1, 1))).p,
    "mixed_anova, group, 7 and 11": _mixed_anova(0),
    "mixed_anova, condition, Greenhouse-Geisser": _mixed_anova(1),
    "mixed_anova, group:condition, Greenhouse-Geisser": _mixed_anova(2),
    "art_contrasts, the other factor without effect": _art_contrast(1.0),
}

KNOWN_TO_FAIL: dict[str, Draw] = {
    "mixed_model, (1 | participant) alone": _without_cells,
    "art_contrasts, the other factor 5 times as long": _art_contrast(5.0),
}
"""Shown beside, as the reason for what is done instead."""


def rates(studies: int = 1000) -> Iterator[tuple[str, Share]]:
    """The share of studies with p below .05, test by test."""
    for number, (name, draw) in enumerate({**TESTS, **KNOWN_TO_FAIL}.items()):
        random = np.random.default_rng([7, number])
        found = [draw(random) for _ in range(studies)]
        yield name, Share(sum(p is not None and p < 0.05 for p in found), studies)


def error_rates() -> None:
    """Type I error at .05, with the simulation's own 95 % interval."""
    low, high = ACCEPTED
    print(f"Type I error at .05 of studies without an effect (to lie within {low} and {high})")
    for name, share in rates():
        bounds = share.interval()
        said = "" if low <= share.power <= high else "   outside"
        print(f"  {name:<52}{share.power:>7.3f}  [{bounds[0]:.3f}, {bounds[1]:.3f}]{said}")
