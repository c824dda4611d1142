"""`power` for groups, several factors, mixed designs and equivalence, and for a stated number of participants."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path

from pipeline.commands import console, power_of_plan_output
from pipeline.commands.power_options import ASSUMED_CORRELATION, Expected, Search, require_between, require_size
from pipeline.commands.publish import refuse_study
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics import planned_effects
from pipeline.statistics.planned_effects import PlannedEffect, contrasts, participants_for
from pipeline.statistics.power_designs import Equivalence
from pipeline.words.numbers import fraction, number

_PAIRS = ("t_paired", "wilcoxon")
_FACTORS = ("rm_anova", "mixed_anova")
_TWO_GROUPS = ("t_welch", "mann_whitney")
_SEVERAL_GROUPS = ("anova_welch", "kruskal")
TESTS = (*_PAIRS, "rm_anova", *_TWO_GROUPS, *_SEVERAL_GROUPS, "mixed_anova", "tost")
_MOST_FACTORS = 3

_TAKEN_BY: dict[str, tuple[str, ...]] = {
    "levels": _FACTORS,
    "epsilon": _FACTORS,
    "groups": (*_TWO_GROUPS, *_SEVERAL_GROUPS, "mixed_anova", "tost"),
    "sds": (*_TWO_GROUPS, *_SEVERAL_GROUPS),
    "size_ratio": _TWO_GROUPS,
    "bound": ("tost",),
    "correlation": (*_PAIRS, *_FACTORS, "tost"),
}
"""Which tests take which option. For any other test it would be ignored, so it is an error there."""


@dataclass(frozen=True)
class Plan:
    """The planned design: its effects, and their size where one is stated.

    `size_name` says what the size is: d, d_z, f, or the bound of an equivalence. `assumed` are lines that explain it.
    """

    expected: Expected
    effects: tuple[PlannedEffect, ...]
    size_name: str
    size: float | None
    levels: tuple[int, ...]
    groups: int
    assumed: tuple[str, ...]


def power(expected: Expected, search: Search, out: Path | None) -> None:
    """Print whichever of effect, participants and power the options leave open; write the files into `out`."""
    plan = planned(expected, search)
    require_between("--power", search.power, expected.alpha, 1)
    if out is not None:
        refuse_study(out)
    if expected.n is None:
        _require_enough(plan, search)
    for line in power_of_plan_output.heading(plan, search):
        console.say(line)
    answer = power_of_plan_output.answer(plan, search)
    if answer.rows:
        console.table(answer.header, answer.rows, left=1)
    for line in answer.lines:
        console.say(line)
    if out is not None:
        power_of_plan_output.write(out, plan, search, {**asdict(expected), **asdict(search)})
        console.say(f"Written: {', '.join(str(out / name) for name in power_of_plan_output.FILES)}")


def planned(expected: Expected, search: Search) -> Plan:
    """The plan that the options describe. Raises PipelineError for options that describe none."""
    if expected.test not in TESTS:
        raise PipelineError(f'--test: "{expected.test}" is not known{did_you_mean(expected.test, TESTS)}')
    _require_options(expected)
    require_between("--alpha", expected.alpha, 0, 1)
    if expected.sd is not None:
        require_between("--sd", expected.sd, 0, math.inf)
    if expected.test in _PAIRS:
        return _plan_of_pairs(expected, search)
    if expected.test in _FACTORS:
        return _plan_of_factors(expected)
    return _plan_of_equivalence(expected) if expected.test == "tost" else _plan_of_groups(expected, search)


def _require_options(expected: Expected) -> None:
    """Refuse options that the test does not take, and a size that is stated twice or incompletely."""
    for option, tests in _TAKEN_BY.items():
        stated = getattr(expected, option) not in (None, 1.0)
        if stated and expected.test not in tests:
            name = option.replace("_", "-")
            raise PipelineError(f"--{name} is not for {expected.test}, but for {', '.join(tests)}; leave it out")
    if expected.conditions != 2 and (expected.test not in _FACTORS or expected.levels is not None):
        raise PipelineError(
            f"--conditions {expected.conditions}: is for rm_anova and mixed_anova, and not together with --levels; for"
            " groups take --groups"
        )
    if expected.effect is not None and (
        expected.difference is not None or (expected.sd is not None and not _tost(expected))
    ):
        raise PipelineError("--effect says the same as --difference with --sd; give only one of them")
    if expected.difference is not None and (expected.sd is None) == (expected.sds is None):
        raise PipelineError(
            "--difference needs --sd, the SD of a condition or group in the same unit, or --sds of each"
        )
    if expected.sd is not None and expected.difference is None and not _tost(expected):
        raise PipelineError("--sd needs --difference, the mean difference in the same unit")
    if expected.effect is None and expected.difference is None and expected.n is None and not _tost(expected):
        raise PipelineError(
            "the effect is missing; give --effect 0.5, for example, or --difference and --sd in the measure's unit;"
            " or --n 12, for the smallest effect that 12 participants find"
        )


def _tost(expected: Expected) -> bool:
    return expected.test == "tost"


def _correlation(expected: Expected, groups_of_values: int) -> tuple[float, str]:
    """The correlation of two conditions, stated or assumed, and the line that says so."""
    r = ASSUMED_CORRELATION if expected.correlation is None else expected.correlation
    require_between("--correlation", r, -1 / (groups_of_values - 1), 1)
    assumed = "" if expected.correlation is not None else " (assumed; --correlation states it)"
    return r, f"r = {fraction(r, 2)}: correlation of a participant's values in two conditions{assumed}"


def _standardised(expected: Expected) -> float | None:
    """The stated effect, or the stated difference over its SD; None where neither is stated."""
    if expected.difference is not None:
        sds = _numbers("--sds", expected.sds) if expected.sds else (expected.sd or 0.0,)
        return require_size("--difference over --sd", expected.difference / math.hypot(*sds) * math.sqrt(len(sds)))
    return None if expected.effect is None else require_size("--effect", expected.effect)


def _plan_of_pairs(expected: Expected, search: Search) -> Plan:
    size, lines = _standardised(expected), []
    if size is not None and (expected.difference is not None or expected.correlation is not None):
        r, line = _correlation(expected, 2)
        lines = [f"d = {number(size)}: the mean difference over the SD within a condition", line]
        size = size / math.sqrt(2 * (1 - r))
    lines.append("d_z: the mean difference over the SD of the differences")
    effect = planned_effects.paired(expected.test, expected.alpha, search.simulations, search.seed)
    return Plan(expected, (effect,), "d_z", size, (2,), 1, tuple(lines))


def _plan_of_factors(expected: Expected) -> Plan:
    levels = _whole_numbers("--levels", expected.levels) if expected.levels else (expected.conditions,)
    if len(levels) > _MOST_FACTORS:
        raise PipelineError(f"--levels {expected.levels}: three factors are the most that a test takes")
    groups = 1 if expected.test == "rm_anova" else expected.groups or 2
    cells = math.prod(levels)
    r, line = _correlation(expected, cells)
    lowest = 1 / max(contrasts(levels, [place]) for place in range(len(levels)))
    lowest = min(lowest, 1 / contrasts(levels, range(len(levels))))
    if not lowest <= expected.epsilon <= 1:
        raise PipelineError(
            f"--epsilon {expected.epsilon:g}: should lie between {lowest:.3g}, the lowest that {cells} cells can have,"
            " and 1"
        )
    size = _standardised(expected)
    if expected.difference is not None and size is not None:
        if len(levels) > 1 or groups > 1:
            raise PipelineError(
                "--difference: with several factors or groups it does not say which effect is meant; give --effect,"
                " Cohen's f"
            )
        size = size / math.sqrt(2 * levels[0])
        line += "; the largest difference is stated, the other conditions in the middle: the smallest f it can be"
    lines = ["f: the SD of what an effect adds to the cells' means, over the SD within a cell", line]
    if expected.epsilon < 1:
        lines.append(f"ε = {expected.epsilon:g}: power is that of the test corrected for sphericity by it")
    if len(levels) > 1:
        named = zip(planned_effects.factor_names(len(levels)), levels, strict=True)
        lines.append(f"Factors within participants: {', '.join(f'{name} ({count} levels)' for name, count in named)}")
    effects = planned_effects.factorial(levels, groups, r, expected.epsilon, expected.alpha)
    return Plan(expected, tuple(effects), "f", size, levels, groups, tuple(lines))


def _plan_of_groups(expected: Expected, search: Search) -> Plan:
    two = expected.test in _TWO_GROUPS
    sds = _numbers("--sds", expected.sds) if expected.sds else (1.0,) * (expected.groups or (2 if two else 3))
    if expected.groups is not None and len(sds) != expected.groups:
        raise PipelineError(f"--sds {expected.sds}: are of {len(sds)} groups, and --groups says {expected.groups}")
    if two and len(sds) != 2:
        raise PipelineError(
            f"--groups {len(sds)}: {expected.test} compares two groups; take anova_welch or kruskal, or plan for one"
            f" pair with --alpha divided by the {len(sds) * (len(sds) - 1) // 2} pairs"
        )
    for sd in sds:
        require_between("--sds", sd, 0, math.inf)  # before they are divided by
    require_between("--size-ratio", expected.size_ratio, 0.01, 100)
    size = _standardised(expected)
    if two:
        lines = ["d: the mean difference over the SD of a group"]
    else:
        lines = ["f: the SD of the groups' means over the SD within a group; first and last apart, others between"]
        if expected.difference is not None and size is not None:
            size = size / math.sqrt(2 * len(sds))
    if len(set(sds)) > 1:
        lines.append("SD: the root of the mean of the groups' variances")
    ratios = (1.0, expected.size_ratio) if two else (1.0,) * len(sds)
    effect = planned_effects.groups(expected.test, sds, ratios, expected.alpha, search.simulations, search.seed)
    return Plan(expected, (effect,), "d" if two else "f", size, (), len(sds), tuple(lines))


def _plan_of_equivalence(expected: Expected) -> Plan:
    """An equivalence test. The size is the bound; the true difference is assumed to be 0 where it is not stated."""
    between = expected.groups is not None
    if expected.groups not in (None, 2):
        raise PipelineError(f"--groups {expected.groups}: tost compares two conditions, or with --groups 2 two groups")
    if between and expected.correlation is not None:
        raise PipelineError("--correlation is of two conditions of one participant; leave it out with --groups 2")
    if expected.bound is None and expected.n is None:
        raise PipelineError("--bound is missing: differences within ± this count as none, such as --bound 0.5")
    unit, scale, lines = "SDs of a group" if between else "SDs of the differences", 1.0, []
    if expected.sd is not None:
        scale = 1 / expected.sd
        if not between:
            r, line = _correlation(expected, 2)
            scale /= math.sqrt(2 * (1 - r))
            lines.append(line)
    elif expected.correlation is not None:
        raise PipelineError("--correlation: tost takes it together with --sd only; the bound is in SDs of differences")
    bound = None if expected.bound is None else require_size("--bound", expected.bound * scale)
    stated = expected.difference if expected.difference is not None else expected.effect or 0.0
    truth = abs(stated) * scale if expected.sd is not None else abs(stated)
    if bound is not None and truth >= bound:
        raise PipelineError(
            f"the true difference, {truth:.3g} SDs, lies outside the bounds of ±{bound:.3g}: no number of participants"
            " shows equivalence; widen --bound"
        )
    lines.append(f"Bounds are in {unit}; the true difference is {number(truth)}")
    effect = PlannedEffect(
        "equivalence", _Bounds(truth, expected.alpha, between), sizes=(1.0, 1.0) if between else (1.0,)
    )
    return Plan(expected, (effect,), "bound", bound, (2,), 2 if between else 1, tuple(lines))


@dataclass(frozen=True)
class _Bounds:
    """Equivalence as a design whose effect is the bound: the wider it is, the more power there is."""

    truth: float
    alpha: float
    groups: bool
    method: str = Equivalence.method

    def power(self, effect: float, n: int) -> float:
        """With bounds of ±`effect`."""
        return Equivalence(effect, self.alpha, self.groups).power(self.truth, n) if effect > 0 else 0.0


def _whole_numbers(option: str, text: str) -> tuple[int, ...]:
    numbers = _numbers(option, text)
    if any(value != int(value) or not 2 <= value <= 100 for value in numbers):
        raise PipelineError(f"{option} {text}: a factor has 2 to 100 levels; write them as in {option} 2,3")
    return tuple(int(value) for value in numbers)


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise PipelineError(f"{option} {text}: is not a list of numbers; write it as in {option} 2,3") from None
    return numbers


def _require_enough(plan: Plan, search: Search) -> None:
    """Refuse a plan with an effect that takes more than --max-n participants; the error names the power of so many."""
    size = plan.size or 0.0
    for effect in plan.effects:
        if participants_for(effect, size, search.power, search.most).judged_by is None:
            closed, shares = planned_effects.power_of(effect, size, search.most)
            reached = closed if closed is not None else shares.power if shares else 0.0
            raise PipelineError(
                f"power: {search.most} participants{' in each group' if plan.groups > 1 else ''} reach a power of"
                f" {fraction(reached)} only for {effect.name}, not {search.power:g}; raise --max-n, or plan for a"
                " larger effect or a less noisy measure"
            )
