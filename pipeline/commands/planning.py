"""The options of `power` and `plan`, the two commands for before a study.

It imports nothing heavy, so that --help stays fast.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def power(
    *,
    test: Annotated[
        str,
        typer.Option(
            help="Within participants: t_paired, wilcoxon, rm_anova. Between groups: t_welch, mann_whitney,"
            " anova_welch, kruskal. Both: mixed_anova. Equivalence: tost."
        ),
    ] = "t_paired",
    effect: Annotated[
        float | None,
        typer.Option(
            help="The effect to be found. t_paired, wilcoxon: d_z, the mean difference over the SD of the differences;"
            " with --correlation instead d, the mean difference over the SD of a condition. t_welch, mann_whitney: d,"
            " the mean difference over the SD of a group. Every other test: Cohen's f. tost: the true difference, 0 if"
            " not given."
        ),
    ] = None,
    difference: Annotated[
        float | None,
        typer.Option(help="Or the mean difference to be found, in the measure's unit; of several means the largest."),
    ] = None,
    sd: Annotated[
        float | None,
        typer.Option(help="With --difference or --bound: the SD of a condition or group, in the same unit."),
    ] = None,
    n: Annotated[
        int | None,
        typer.Option(
            "--n",
            min=2,
            max=3000,
            help="Participants, in each group if there are groups. Without an effect: the smallest that they find."
            " With one: their power.",
        ),
    ] = None,
    conditions: Annotated[
        int, typer.Option(min=2, max=100, help="How many conditions, for rm_anova and mixed_anova.")
    ] = 2,
    levels: Annotated[
        str | None,
        typer.Option(
            metavar="K,...",
            help="In place of --conditions, with several factors: how many levels each has, such as 2,3.",
        ),
    ] = None,
    groups: Annotated[
        int | None,
        typer.Option(min=2, max=100, help="How many groups of participants. tost: 2 compares groups, not conditions."),
    ] = None,
    correlation: Annotated[
        float | None,
        typer.Option(help="Of a participant's values in two conditions; 0.5 is assumed where it is not given."),
    ] = None,
    epsilon: Annotated[
        float,
        typer.Option(
            help="Lack of sphericity (Greenhouse-Geisser's ε) to be expected, for rm_anova and mixed_anova; 1 is none."
        ),
    ] = 1.0,
    bound: Annotated[
        float | None,
        typer.Option(
            help="For tost: differences within ± this count as none, in SDs of the differences (of a group, with"
            " --groups 2), or with --sd in the measure's unit."
        ),
    ] = None,
    sds: Annotated[
        str | None,
        typer.Option(metavar="SD,...", help="The SD of each group where they differ, in any unit. Default: all alike."),
    ] = None,
    size_ratio: Annotated[
        float,
        typer.Option(help="For two groups: the second group's size as a multiple of the first's."),
    ] = 1.0,
    target: Annotated[float, typer.Option("--power", help="Power: the chance wanted that the effect is found.")] = 0.8,
    alpha: Annotated[
        float, typer.Option(help="The level of significance, two-sided; of tost that of each of its two tests.")
    ] = 0.05,
    simulations: Annotated[
        int, typer.Option(min=100, max=1_000_000, help="Studies to simulate for each number of participants.")
    ] = 10_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulation.")] = 1,
    most: Annotated[
        int, typer.Option("--max-n", min=2, max=3000, help="The most participants to consider, in each group.")
    ] = 1000,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write power.svg, power.csv and power.json there.")
    ] = None,
) -> None:
    """How many participants? Or which effect, for a number of them? In closed form and by simulation."""
    from pipeline.commands import power as command
    from pipeline.commands import power_options

    expected = power_options.Expected(
        test, effect, difference, sd, correlation, conditions, alpha, n, levels, groups, epsilon, bound, sds, size_ratio
    )
    command.power(expected, power_options.Search(target, simulations, seed, most), out)


def plan(
    *,
    conditions: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="CONDITION...",
            help="The conditions, as study.yaml names them; with --preregister a study folder.",
        ),
    ] = None,
    participants: Annotated[
        int | None, typer.Option("--participants", "-n", min=1, max=10_000, help="How many participants.")
    ] = None,
    study: Annotated[
        Path | None, typer.Option(metavar="STUDY", help="Take the conditions of this study instead.")
    ] = None,
    cross: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=LEVEL,...",
            help="A second factor, done in full in every condition, such as task=easy,hard. The order of its levels is"
            " balanced too, over conditions and periods.",
        ),
    ] = None,
    between: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=GROUP,...",
            help="Groups of participants, such as training=none,short. Sizes differ by one at most, and orders are"
            " balanced within each group. condition=A,B: each participant meets one condition only.",
        ),
    ] = None,
    blocks: Annotated[
        int, typer.Option(min=1, max=1000, help="Blocks in each condition (and level); needs --schedule.")
    ] = 1,
    targets: Annotated[
        str | None,
        typer.Option(
            metavar="K",
            help="Targets in each block, a number or names joined by commas, each block in another order, so that each"
            " target comes equally often in each place; needs --schedule.",
        ),
    ] = None,
    prefix: Annotated[str, typer.Option(help="What the participants' ids begin with.")] = "P",
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Let chance decide who gets which group and which sequence, as balanced as without. Default: in turn.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the table there. Default: print it.")] = None,
    preregister: Annotated[
        bool,
        typer.Option(
            "--preregister",
            help="Freeze what a study's study.yaml will test: preregistered.yaml, and preregistration.md to paste into"
            " AsPredicted or OSF, in the study's folder. A later report lists every deviation.",
        ),
    ] = False,
    schedule: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a second table there, with a row for every block.")
    ] = None,
) -> None:
    """Give each participant a group and an order of the conditions: balanced Latin squares, as a participants.csv."""
    if preregister:
        from pipeline.commands import preregister as preregister_command

        preregister_command.preregister(conditions or [])
        return
    from pipeline.commands import plan as command

    options = command.Options(conditions or [], study, participants, prefix, seed, cross, between, blocks, targets)
    command.plan(options, out, schedule)
