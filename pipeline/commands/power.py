"""`power`: how many participants a stated effect takes, as a table, and as files with the curve.

This module answers that for one factor within people, with simulated studies beside every row; `power_of_plan` has
the other designs, and the questions from the other side: which effect n participants find, and with which power.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path

from pipeline.commands import console, power_output
from pipeline.commands.power_options import ASSUMED_CORRELATION, Expected, Search, require_between, require_size
from pipeline.commands.publish import refuse_study
from pipeline.errors import PipelineError
from pipeline.statistics.power import Design, closed_form, difference_of_dz, difference_of_f
from pipeline.statistics.power_simulation import simulate
from pipeline.statistics.sample_size import sample_size
from pipeline.words.numbers import fraction, number


def power(expected: Expected, search: Search, out: Path | None) -> None:
    """Print the table and the answer; write the files into `out`."""
    if not expected.is_one_factor:
        from pipeline.commands import power_of_plan

        power_of_plan.power(expected, search, out)
        return
    design = _design(expected)
    require_between("--power", search.power, design.alpha, 1)
    if out is not None:
        refuse_study(out)
    planned = sample_size(design, search.power, search.simulations, search.seed, search.most)
    if planned is None:
        raise PipelineError(_not_enough(design, search))
    for line in (power_output.heading(design, search.power), *_effect(expected, design)):
        console.say(line)
    console.table(*power_output.table(power_output.records(design, planned)), left=0)
    for line in power_output.answer(design, search.simulations, search.seed, planned):
        console.say(line)
    if out is not None:
        power_output.write(out, design, {**asdict(expected), **asdict(search)}, planned)
        console.say(f"Written: {', '.join(str(out / name) for name in power_output.FILES)}")


def _design(expected: Expected) -> Design:
    """The study that the options describe. Raises PipelineError where there can be none."""
    test, k = expected.test, expected.conditions
    if test != "rm_anova" and k != 2:
        raise PipelineError(
            f"--conditions {k}: {test} compares two conditions; take --test rm_anova, or plan for one pair"
            f" (--conditions 2) with --alpha divided by the {k * (k - 1) // 2} pairs"
        )
    require_between("--alpha", expected.alpha, 0, 1)
    r = ASSUMED_CORRELATION if expected.correlation is None else expected.correlation
    require_between("--correlation", r, -1 / (k - 1), 1)
    return Design(test, _difference(expected, r), r, k, expected.alpha)


def _difference(expected: Expected, correlation: float) -> float:
    """The difference between two conditions, in SDs of a condition."""
    if expected.effect is not None:
        if expected.difference is not None or expected.sd is not None:
            raise PipelineError("--effect says the same as --difference with --sd; give only one of them")
        size = require_size("--effect", expected.effect)
        if expected.test == "rm_anova":
            return difference_of_f(size, expected.conditions)
        return difference_of_dz(size, correlation) if expected.correlation is None else size
    if expected.difference is None or expected.sd is None:
        raise PipelineError(
            "the effect is missing; give --effect 0.5, for example, or --difference and --sd in the measure's unit"
        )
    require_between("--sd", expected.sd, 0, math.inf)
    return require_size("--difference over --sd", expected.difference / expected.sd)


def _not_enough(design: Design, search: Search) -> str:
    reached = closed_form(design, search.most)
    if reached is None:
        reached = simulate(design, search.most, search.simulations, search.seed).own.power
    return (
        f"power: {search.most} participants reach a power of {fraction(reached)} only, not {search.power:g}; raise"
        " --max-n, or plan for a larger effect or a less noisy measure"
    )


def _effect(expected: Expected, design: Design) -> list[str]:
    """The effect as it was stated, and what follows from it."""
    assumed = "" if expected.correlation is not None else " (assumed; --correlation states it)"
    lines = []
    if expected.difference is not None and expected.sd is not None:
        lines.append(
            f"A difference of {abs(expected.difference):g} at an SD of {expected.sd:g} within each condition:"
            f" d = {number(design.difference)}"
        )
        if design.conditions > 2:
            lines.append(
                "  between the two conditions farthest apart, the others in the middle: the smallest f it can be"
            )
    elif design.test != "rm_anova" and expected.correlation is not None:
        lines.append(f"d = {number(design.difference)}: the mean difference over the SD within a condition")
    if design.test == "rm_anova" or lines:
        lines.append(
            f"r = {fraction(design.correlation, 2)}: correlation of a participant's values in two conditions{assumed}"
        )
    if design.test == "rm_anova":
        return [*lines, f"f = {number(design.f)}: the SD of the conditions' means over the SD within a condition"]
    return [*lines, f"d_z = {number(design.dz)}: the mean difference over the SD of the differences"]
