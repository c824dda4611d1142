"""What `power` prints and writes for groups, several factors, mixed designs, equivalence, and a stated n."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.commands.power_output import FILES, Record, draw_curves, record, simulated, write_files
from pipeline.statistics.planned_effects import PlannedEffect, effect_for, participants_for, power_of
from pipeline.statistics.sample_size import Needed, spread
from pipeline.words.numbers import fraction, number
from pipeline.words.phrases import counted

if TYPE_CHECKING:
    from pipeline.commands.power_of_plan import Plan
    from pipeline.commands.power_options import Search

__all__ = ["FILES", "Answer", "answer", "heading", "write"]

_NAMES = {
    "t_paired": "Paired t test, two-sided",
    "wilcoxon": "Exact Wilcoxon signed-rank test, two-sided",
    "rm_anova": "Repeated-measures ANOVA",
    "t_welch": "Welch's t test of two groups, two-sided",
    "mann_whitney": "Exact Mann-Whitney test of two groups, two-sided",
    "anova_welch": "Welch's analysis of variance",
    "kruskal": "Kruskal-Wallis test",
    "mixed_anova": "Mixed ANOVA",
    "tost": "Equivalence (TOST)",
}


@dataclass(frozen=True)
class Answer:
    """A table to print, and the lines below it."""

    header: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


def heading(plan: Plan, search: Search) -> Iterator[str]:
    """The test, the stated effect, and what is assumed."""
    solves_for_power = plan.expected.n is None or plan.size is None
    tail = f", for a power of {search.power:g}" if solves_for_power else ""
    yield f"{_titled(plan)}, alpha = {plan.expected.alpha:g}{tail}"
    if plan.size is not None:
        yield f"{plan.size_name} = {number(plan.size)}"
    yield from (f"  {line}" for line in plan.assumed)


def _titled(plan: Plan) -> str:
    name = _NAMES[plan.expected.test]
    parts = []
    if plan.groups > 2 or plan.expected.test in ("mixed_anova", "tost"):
        parts += [counted(plan.groups, "group")] if plan.groups > 1 else ["paired differences"]
    if plan.expected.test in ("rm_anova", "mixed_anova"):
        parts.append(f"{' × '.join(map(str, plan.levels))} conditions")
    return f"{name} of {' and '.join(parts)}" if parts else name


def answer(plan: Plan, search: Search) -> Answer:
    """Whichever of effect, participants and power the options leave open."""
    if plan.expected.n is None:
        return _participants(plan, search)
    return _smallest(plan, search) if plan.size is None else _power(plan, search)


def _participants(plan: Plan, search: Search) -> Answer:
    rows, lines = [], []
    for effect in plan.effects:
        needed = participants_for(effect, plan.size or 0.0, search.power, search.most)
        sizes = effect.group_sizes(needed.judged_by or search.most)
        closed, _ = power_of(effect, plan.size or 0.0, sizes[0]) if effect.closed_form else (None, None)
        rows.append([effect.name, *_sizes(plan, sizes), fraction(closed)])
        if needed.simulated is not None:
            lines.append(
                f"Simulation ({search.simulations} studies per row, seed {search.seed}): {_bounds(needed.simulated)}"
            )
    header = ["Effect", *_size_titles(plan), "power"]
    if plan.effects[0].closed_form is None:
        header, rows = header[:-1], [row[:-1] for row in rows]
    return Answer(header, rows, [*lines, *_methods(plan), *_means(plan)])


def _bounds(needed: Needed) -> str:
    if needed.n is None:
        return "more participants than --max-n."
    high = "no bound found" if needed.high is None else str(needed.high)
    return f"{needed.n} in the first group or in all, {needed.low} to {high} within the simulation's error."


def _sizes(plan: Plan, sizes: tuple[int, ...]) -> list[str]:
    if plan.groups == 1:
        return [str(sizes[0])]
    each = str(sizes[0]) if len(set(sizes)) == 1 else " and ".join(map(str, sizes))
    return [each, str(sum(sizes))]


def _size_titles(plan: Plan) -> list[str]:
    return ["participants"] if plan.groups == 1 else ["in each group", "participants in all"]


def _smallest(plan: Plan, search: Search) -> Answer:
    n = plan.expected.n or 0
    rows, lines = [], []
    for effect in plan.effects:
        smallest = effect_for(effect, n, search.power)
        size = smallest.size
        if size is None:
            rows.append([effect.name, "none, however large"])
            continue
        rows.append([effect.name, number(size, 3)])
        if smallest.simulated is not None:
            _, low, high = smallest.simulated
            lines.append(
                f"By simulation ({search.simulations} studies at each effect, seed {search.seed}):"
                f" {number(low, 3)} to {number(high, 3)} within its error."
            )
    what = "narrowest bound ±" if plan.size_name == "bound" else f"smallest {plan.size_name}"
    return Answer(["Effect", what], rows, [_participants_text(plan, n), *lines, *_methods(plan), *_means(plan)])


def _power(plan: Plan, search: Search) -> Answer:
    n, size = plan.expected.n or 0, plan.size or 0.0
    rows = []
    for effect in plan.effects:
        closed, shares = power_of(effect, size, n)
        row = [effect.name, *([fraction(closed)] if effect.closed_form else [])]
        if shares is not None:
            low, high = shares.interval()
            row.append(f"{fraction(shares.power)} [{fraction(low)}, {fraction(high)}]")
        rows.append(row)
    header = ["Effect", *(["power"] if plan.effects[0].closed_form else [])]
    header += [f"simulated [95 % interval], {search.simulations} studies"] if plan.effects[0].shares else []
    return Answer(header, rows, [_participants_text(plan, n), *_methods(plan), *_means(plan)])


def _participants_text(plan: Plan, n: int) -> str:
    sizes = plan.effects[0].group_sizes(n)
    if plan.groups == 1:
        return f"With {counted(n, 'complete participant')}."
    return f"With {' and '.join(map(str, sizes))} complete participants in the groups, {sum(sizes)} in all."


def _methods(plan: Plan) -> Iterator[str]:
    """How power was computed, each method once."""
    for method in dict.fromkeys(effect.closed_form.method for effect in plan.effects if effect.closed_form is not None):
        yield f"Computed in {method}." if method.startswith("closed") else f"Computed: {method}."


def _means(plan: Plan) -> Iterator[str]:
    alpha = plan.expected.alpha
    if plan.size_name == "bound":
        yield f"Power is the chance that both tests have p < {alpha:g}. Add those you expect to drop out."
    else:
        yield f"Power is the chance that p < {alpha:g} if the effect is as stated. Add those you expect to drop out."
    yield f"Assumed: {_assumed(plan)}."


def _assumed(plan: Plan) -> str:
    test = plan.expected.test
    if test in ("rm_anova", "mixed_anova"):
        groups = ", in groups of one size" if plan.groups > 1 else ""
        spherical = "" if plan.expected.epsilon < 1 or max(plan.levels) == 2 else ", so that sphericity holds"
        return f"normal values, equally spread in every cell, equally correlated between any two{spherical}{groups}"
    if test in ("wilcoxon", "mann_whitney", "kruskal"):
        return "normal values without ties; ratings on a coarse scale tie, and take more participants"
    return "normal differences" if plan.groups == 1 else "normal values"


# Files ------------------------------------------------------------------------------------------------------------


def write(folder: Path, plan: Plan, search: Search, settings: Mapping[str, Any]) -> None:
    """Power by the number of participants, for the stated or the smallest effect, as CSV, JSON and SVG."""
    needed: dict[str, Any] = {}
    sizes: dict[str, float] = {}
    numbers: set[int] = {plan.expected.n} if plan.expected.n else set()
    for effect in plan.effects:
        size = plan.size
        if size is None:
            smallest = effect_for(effect, plan.expected.n or 0, search.power)
            size = smallest.size
            needed[effect.name] = {"smallest_effect": size, "simulated": smallest.simulated}
        else:
            fewest = participants_for(effect, size, search.power, search.most)
            simulated = fewest.simulated and vars(fewest.simulated)
            needed[effect.name] = {"closed_form": fewest.closed_form, "simulated": simulated}
            numbers |= {fewest.judged_by} if fewest.judged_by else set()
        if size is not None:
            sizes[effect.name] = size
    numbers |= set(spread(max(numbers, default=30), search.most))
    rows = [
        _record(effect, sizes[effect.name], n)
        for effect in plan.effects
        if effect.name in sizes
        for n in sorted(numbers)
    ]
    stated = {"name": plan.size_name, "size": plan.size, "groups": plan.groups, "levels": list(plan.levels)}
    write_files(folder, settings, stated, needed, rows)
    title = f"{_titled(plan)}: " + (f"{plan.size_name} = {number(plan.size)}" if plan.size else "the smallest effects")
    draw_curves(folder / "power.svg", title, plan.expected.alpha, rows, search.power)


def _record(effect: PlannedEffect, size: float, n: int) -> Record:
    closed, shares = power_of(effect, size, n)
    powers = {"power_closed_form": closed, **simulated("power_simulated", shares)}
    return record(effect.name, size, sum(effect.group_sizes(n)), n, **powers)
