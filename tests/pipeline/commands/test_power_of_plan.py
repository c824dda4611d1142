"""`power` for groups, several factors, mixed designs, equivalence, and the effect that a number of people find."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.statistics.planned_effects import effect_for, factorial, groups, paired, participants_for, power_of
from pipeline.statistics.power import paired_t_power
from pipeline.statistics.power_designs import FactorialEffect, fewest
from tests.pipeline.helpers import Ran, run

Power = Callable[..., Ran]
QUICK = ("--simulations", "400")


@pytest.fixture
def power(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Power:
    return lambda *words: run(capsys, monkeypatch, "power", *words)


def row(ran: Ran, effect: str) -> list[str]:
    """The cells of an effect's row in what was printed, without its name."""
    return next(line.split()[1:] for line in ran.out.splitlines() if line.split()[:1] == [effect])


# Against tables and other programs --------------------------------------------------------------------------------


@pytest.mark.parametrize(("d", "each"), [("0.2", 394), ("0.5", 64), ("0.8", 26)])
def test_two_groups_against_g_power(power: Power, d: str, each: int) -> None:
    """G*Power 3.1, t tests, two independent means, α = .05, power .80; Cohen (1992), table 2, has 393, 64 and 26."""
    ran = power("--test", "t_welch", "--effect", d, *QUICK)
    assert ran.code == 0
    assert row(ran, "group")[:2] == [str(each), str(2 * each)]


@pytest.mark.parametrize(("k", "f", "each"), [(3, 0.25, 52), (3, 0.4, 21), (4, 0.25, 45), (4, 0.4, 18), (5, 0.4, 16)])
def test_several_groups_against_cohen(k: int, f: float, each: int) -> None:
    """Cohen (1992), A power primer, table 2, α = .05, power .80, which is interpolated: G*Power has up to one more.

    Welch's test takes about as many.
    """
    classic = fewest(FactorialEffect((), (), groups=k, with_group=True), f, 0.8, 200)
    assert classic in (each, each + 1)
    welch = participants_for(groups("anova_welch", (1.0,) * k, (1.0,) * k, 0.05, 100, 1), f, 0.8, 200).closed_form
    assert welch is not None
    assert each <= welch <= each + 2


def test_a_mixed_design_against_g_power(power: Power) -> None:
    """G*Power 3.1, its own example of repeated measures: f = .25, power .95, 2 groups, 4 measurements, r = .5, ε = 1.

    Total sample size 132 for the factor between, 36 for the one within and for the interaction.
    """
    ran = power("--test", "mixed_anova", "--conditions", "4", "--effect", "0.25", "--power", "0.95")
    assert row(ran, "group")[:2] == ["66", "132"]
    assert row(ran, "condition")[:2] == row(ran, "group:condition")[:2] == ["18", "36"]
    assert "(assumed; --correlation states it)" in ran.out


def test_equivalence_against_lakens(power: Power) -> None:
    """Lakens (2017), Equivalence tests: by the normal distribution, (z.95 + z.90)² / .3² = 95.2 pairs, and twice that
    in each of two groups; the exact power takes little more."""
    assert 96 <= int(row(power("--test", "tost", "--bound", "0.3"), "equivalence")[0]) <= 98
    ran = power("--test", "tost", "--bound", "0.3", "--groups", "2")
    assert 191 <= int(row(ran, "equivalence")[0]) <= 192
    assert "Power is the chance that both tests have p < 0.05" in ran.out


def test_sphericity_that_is_lacking_takes_more_people(power: Power) -> None:
    """Within epsilon: the power of R (tests/data/statistics_r/power.R, within_epsilon) at n = 15."""
    options = ("--test", "rm_anova", "--conditions", "4", "--effect", "0.25", "--correlation", "0.6")
    ran = power(*options, "--epsilon", "0.7", "--n", "15")
    content = json.loads(
        (Path(__file__).parents[2] / "data" / "statistics_r" / "power" / "expected.json").read_text(encoding="utf-8")
    )
    assert row(ran, "condition") == [f"{content['power']['within_epsilon']:.3f}".removeprefix("0")]
    spherical = power("--test", "rm_anova", "--levels", "4", *options[4:])
    assert int(row(spherical, "condition")[0]) < int(row(power(*options, "--epsilon", "0.7"), "condition")[0])


# The effect that n participants find ------------------------------------------------------------------------------


def test_the_smallest_effect_that_participants_find(power: Power) -> None:
    ran = power("--n", "12")
    assert ran.code == 0
    found = float(row(ran, "condition")[0])
    assert paired_t_power(found - 0.001, 12) < 0.8 < paired_t_power(found + 0.001, 12)
    assert "With 12 complete participants." in ran.out
    assert "Effect     smallest d_z" in ran.out
    narrow = power("--test", "tost", "--n", "97")
    assert 0.295 < float(row(narrow, "equivalence")[0]) <= 0.3
    assert "narrowest bound ±" in narrow.out


def test_every_effect_of_several_factors(power: Power) -> None:
    ran = power("--test", "mixed_anova", "--levels", "2,3", "--groups", "3", "--n", "12")
    names = ["group", "condition", "factor_2", "condition:factor_2"]
    names += ["group:condition", "group:factor_2", "group:condition:factor_2"]
    for effect in factorial((2, 3), 3, 0.5, 1.0, 0.05):
        smallest = effect_for(effect, 12, 0.8).closed_form
        assert row(ran, effect.name) == [f"{smallest:.3f}"]
        names.remove(effect.name)
    assert names == []
    assert "Factors within participants: condition (2 levels), factor_2 (3 levels)" in ran.out


def test_epsilon_is_one_where_there_is_one_degree_of_freedom() -> None:
    assert {one.name: one.epsilon for one in factorial((2, 3), 1, 0.5, 0.4, 0.05)} == {
        "condition": 1.0,
        "factor_2": 0.5,
        "condition:factor_2": 0.5,
    }


def test_ranks_find_a_little_less(power: Power) -> None:
    effect = effect_for(paired("wilcoxon", 0.05, 2000, 1), 20, 0.8)
    by_t = effect_for(paired("t_paired", 0.05, 100, 1), 20, 0.8).closed_form
    assert effect.simulated is not None
    assert by_t is not None
    assert by_t < effect.simulated[0] < 1.1 * by_t
    assert effect.simulated[1] <= effect.simulated[0] <= effect.simulated[2]
    ran = power("--test", "mann_whitney", "--n", "3", *QUICK)
    assert row(ran, "group") == ["none,", "however", "large"]  # three and three cannot have p < .05


def test_both_stated_gives_the_power(power: Power) -> None:
    """pwr.t.test(d = 0.5, n = 20, type = "paired"): 0.5645."""
    assert row(power("--effect", "0.5", "--n", "20", *QUICK), "condition")[0] == ".565"
    simulated = power("--test", "kruskal", "--groups", "3", "--effect", "0.4", "--n", "23", *QUICK)
    assert "simulated [95 % interval], 400 studies" in simulated.out


def test_groups_of_unlike_sizes_and_spreads(power: Power) -> None:
    ran = power("--test", "t_welch", "--difference", "10", "--sds", "10,20", "--size-ratio", "2", *QUICK)
    assert "d = 0.63" in ran.out  # over the root of (100 + 400) / 2
    assert "25 and 50" in ran.out
    closed, shares = power_of(groups("t_welch", (1, 2), (1, 2), 0.05, 4000, 2), 0.7, 12)
    assert shares is not None
    assert shares.interval(0.999)[0] <= (closed or 0) <= shares.interval(0.999)[1]


def test_the_difference_in_the_measures_unit(power: Power) -> None:
    assert "d = 0.50" in power("--test", "t_welch", "--difference", "6", "--sd", "12", *QUICK).out
    paired_ = power("--difference", "12", "--sd", "24", "--correlation", "0.5", "--n", "34", *QUICK)
    assert "d_z = 0.50" in paired_.out
    # ±12 at an SD of 24 and r = .5 are ±0.5 SDs of the differences
    assert "bound = 0.50" in power("--test", "tost", "--bound", "12", "--sd", "24", "--correlation", "0.5").out


def test_the_files_hold_every_effect(power: Power, tmp_path: Path) -> None:
    words = ("--test", "mixed_anova", "--conditions", "3", "--effect", "0.25", "--out", tmp_path / "out")
    assert power(*words).code == 0
    rows = list(csv.DictReader((tmp_path / "out" / "power.csv").read_text(encoding="utf-8").splitlines()))
    assert {one["effect"] for one in rows} == {"group", "condition", "group:condition"}
    content = json.loads((tmp_path / "out" / "power.json").read_text(encoding="utf-8"))
    assert content["needed"]["condition"]["closed_form"] == 14
    assert all(int(one["participants"]) == 2 * int(one["in_first_group"]) for one in rows)
    svg = (tmp_path / "out" / "power.svg").read_text(encoding="utf-8")
    assert "group:condition" in svg
    assert power("--test", "wilcoxon", "--n", "12", *QUICK, "--out", tmp_path / "ranks").code == 0
    ranks = json.loads((tmp_path / "ranks" / "power.json").read_text(encoding="utf-8"))
    assert 0.8 < ranks["needed"]["condition"]["smallest_effect"] < 1.1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--test", "t_welsh", "--effect", "1"), '--test: "t_welsh" is not known; did you mean "t_welch"?'),
        (("--test", "t_welch"), "the effect is missing; give --effect 0.5, for example"),
        (("--test", "t_welch", "--effect", "1", "--groups", "3"), "compares two groups; take anova_welch or kruskal"),
        (("--test", "t_welch", "--effect", "1", "--levels", "2,3"), "--levels is not for t_welch, but for rm_anova"),
        (("--effect", "1", "--epsilon", "0.5"), "--epsilon is not for t_paired, but for rm_anova, mixed_anova"),
        (("--n", "12", "--conditions", "3"), "is for rm_anova and mixed_anova"),
        (
            ("--test", "rm_anova", "--levels", "2,x", "--n", "9"),
            "is not a list of numbers; write it as in --levels 2,3",
        ),
        (("--test", "rm_anova", "--levels", "1,3", "--n", "9"), "a factor has 2 to 100 levels"),
        (("--test", "rm_anova", "--levels", "2,2,2,2", "--n", "9"), "three factors are the most"),
        (
            ("--test", "rm_anova", "--conditions", "3", "--epsilon", "0.4", "--n", "9"),
            "--epsilon 0.4: should lie between 0.5, the lowest that 3 cells can have, and 1",
        ),
        (
            ("--test", "mixed_anova", "--difference", "3", "--sd", "2"),
            "it does not say which effect is meant; give --effect",
        ),
        (("--test", "kruskal", "--sds", "1,2,3", "--groups", "4", "--n", "9"), "are of 3 groups, and --groups says 4"),
        (("--test", "anova_welch", "--sds", "1,0,3", "--n", "9"), "--sds: should lie between 0 and inf, found 0"),
        (("--test", "tost"), "--bound is missing: differences within ± this count as none, such as --bound 0.5"),
        (("--test", "tost", "--bound", "0.3", "--effect", "0.4"), "lies outside the bounds of ±0.3"),
        (("--test", "tost", "--bound", "0.3", "--groups", "3"), "with --groups 2 two groups"),
        (("--test", "tost", "--bound", "0.3", "--correlation", "0.3"), "tost takes it together with --sd only"),
        (("--test", "t_welch", "--difference", "3"), "--difference needs --sd"),
        (("--test", "t_welch", "--effect", "3", "--sd", "2"), "give only one of them"),
        (("--test", "t_welch", "--sd", "2", "--n", "9"), "--sd needs --difference"),
        (
            ("--test", "mixed_anova", "--effect", "0.1", "--max-n", "50"),
            "power: 50 participants in each group reach a power of",
        ),
    ],
)
def test_what_cannot_be_planned(power: Power, words: tuple[str, ...], message: str) -> None:
    ran = power(*words)
    assert ran.code == 2
    assert message in ran.err
    assert ran.out == ""
