"""How many participants: closed forms against G*Power and R, the simulation against the tests a study takes."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics.anova import rm_anova
from pipeline.statistics.paired import t_paired
from pipeline.statistics.power import (
    Design,
    closed_form,
    difference_of_dz,
    difference_of_f,
    paired_t_power,
    rm_anova_power,
)
from pipeline.statistics.power_simulation import (
    Share,
    critical_w,
    rm_anova_p,
    simulate,
    t_paired_p,
    wilcoxon_significant,
)
from pipeline.statistics.sample_size import sample_size
from pipeline.statistics.wilcoxon import wilcoxon
from tests.pipeline.helpers import Ran, run

Power = Callable[..., Ran]


@pytest.fixture
def power(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Power:
    return lambda *words: run(capsys, monkeypatch, "power", *words)


def of_f(f: float, conditions: int, correlation: float = 0.5) -> Design:
    return Design("rm_anova", difference_of_f(f, conditions), correlation, conditions)


# Closed forms ---------------------------------------------------------------------------------------------------


def test_paired_t_power_against_r() -> None:
    """pwr.t.test(d = 0.5, n = 20, type = "paired"), as pingouin's tests print it."""
    assert paired_t_power(0.5, 20) == pytest.approx(0.5645044, abs=1e-7)


@pytest.mark.parametrize(
    ("dz", "target", "n"),
    [
        (0.5, 0.8, 33.36713),  # pwr.t.test(d = 0.5, power = 0.8, type = "paired")
        (10 / (10 * 2**0.5), 0.85, 19.96892),  # power.t.test; Dalgaard, Introductory Statistics with R, section 8.3
    ],
)
def test_participants_against_r(dz: float, target: float, n: float) -> None:
    """R's n is where the power is reached exactly; people come whole."""
    assert paired_t_power(dz, int(n)) < target < paired_t_power(dz, int(n) + 1)


@pytest.mark.parametrize(
    ("f", "n", "conditions", "correlation", "wanted"),
    [
        # G*Power 3, as pingouin's tests print it
        (0.5, 20, 4, 0.5, 0.9998070),
        (0.25, 10, 3, 0.7, 0.5271828),
        (0.25, 18, 2, 0.6, 0.6089353),
    ],
)
def test_rm_anova_against_g_power(f: float, n: int, conditions: int, correlation: float, wanted: float) -> None:
    assert rm_anova_power(f, n, conditions, correlation) == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize(
    ("f", "conditions", "correlation", "target", "wanted"),
    [  # G*Power 3, as pingouin's tests print it; the last from a worked example with uncorrelated conditions
        (0.5, 3, 0.5, 0.8, 9),
        (0.25, 4, 0.5, 0.8, 24),
        (0.25, 3, 0.8, 0.9, 16),
        (0.25, 3, 0.0, 0.95, 84),
    ],
)
def test_participants_against_g_power(
    f: float, conditions: int, correlation: float, target: float, wanted: int
) -> None:
    found = sample_size(of_f(f, conditions, correlation), target, 100, 1, 200)
    assert found is not None
    assert found.closed_form == wanted


@given(dz=st.floats(0.01, 3), n=st.integers(2, 60), correlation=st.floats(-0.9, 0.95))
def test_two_conditions_are_a_paired_t_test(dz: float, n: int, correlation: float) -> None:
    difference = difference_of_dz(dz, correlation)
    designs = [Design(test, difference, correlation) for test in ("t_paired", "rm_anova")]
    one, other = (closed_form(design, n) for design in designs)
    assert one == pytest.approx(other, abs=1e-7)
    assert designs[0].dz == pytest.approx(dz)


@given(dz=st.floats(0.05, 2), n=st.integers(3, 80))
def test_paired_t_against_scipys_noncentral_t(dz: float, n: int) -> None:
    assume(dz * np.sqrt(n) < 5)  # beyond, SciPy's lower tail is NaN
    critical = stats.t.isf(0.025, n - 1)
    above = stats.nct.sf(critical, n - 1, dz * np.sqrt(n))
    assert paired_t_power(dz, n) == pytest.approx(above + stats.nct.cdf(-critical, n - 1, dz * np.sqrt(n)), abs=1e-7)


@given(f=st.floats(0.05, 2), conditions=st.integers(2, 8))
def test_f_is_the_spread_of_the_means(f: float, conditions: int) -> None:
    """Cohen's f: the SD of the means, in SDs of a condition; the pattern is the one with the largest range for an f."""
    design = of_f(f, conditions)
    assert np.std(design.means) == pytest.approx(f)
    assert design.f == pytest.approx(f)
    assert np.ptp(design.means) == pytest.approx(design.difference)


# Simulation -----------------------------------------------------------------------------------------------------

DRAWN = settings(deadline=None, max_examples=40)


def drawn(seed: int, studies: int, n: int, conditions: int, shift: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    random = np.random.default_rng(seed)
    return random.normal(size=(studies, n, conditions)) + shift * np.arange(conditions)


@DRAWN
@given(seed=st.integers(0, 999), n=st.integers(2, 30), shift=st.floats(0, 2))
def test_the_fast_t_test_is_the_studys(seed: int, n: int, shift: float) -> None:
    values = drawn(seed, 5, n, 2, shift)
    slow = [t_paired(study[:, 0], study[:, 1]).p for study in values]
    assert t_paired_p(values[..., 0] - values[..., 1]) == pytest.approx(slow, rel=1e-8)


@DRAWN
@given(
    seed=st.integers(0, 999),
    n=st.integers(2, 30),
    shift=st.floats(0, 2),
    alpha=st.sampled_from([0.001, 0.01, 0.05, 0.0625, 0.1, 0.25, 0.5, 1 - 1e-9]),
)
def test_the_fast_wilcoxon_test_is_the_studys(seed: int, n: int, shift: float, alpha: float) -> None:
    values = drawn(seed, 10, n, 2, shift)
    slow = [(wilcoxon(study[:, 0], study[:, 1]).p or 0) < alpha for study in values]
    assert list(wilcoxon_significant(values[..., 0] - values[..., 1], alpha)) == slow


@DRAWN
@given(seed=st.integers(0, 999), n=st.integers(2, 30), conditions=st.integers(3, 6), shift=st.floats(0, 1))
def test_the_fast_anova_is_the_studys(seed: int, n: int, conditions: int, shift: float) -> None:
    values = drawn(seed, 5, n, conditions, shift)
    slow = [rm_anova(study, ["condition"])[0] for study in values]
    p, p_gg = rm_anova_p(values)
    assert p == pytest.approx([result.p for result in slow], rel=1e-8)
    assert p_gg == pytest.approx([result.details["p_gg"] for result in slow], rel=1e-8)


def test_the_critical_rank_sums_are_the_tables() -> None:
    """McCornack (1965), J. Am. Stat. Assoc. 60, 864: two-sided at .05."""
    table = {5: -1, 6: 0, 7: 2, 8: 3, 9: 5, 10: 8, 12: 13, 15: 25, 18: 40, 20: 52, 25: 89, 30: 137, 40: 264, 50: 434}
    assert {n: critical_w(n, 0.05) for n in table} == table


DESIGNS = [
    (Design("t_paired", 0.6, 0.3), 25),
    (Design("t_paired", 0.4, -0.4), 60),
    (of_f(0.25, 4), 24),
    (of_f(0.4, 3, -0.2), 12),
    (of_f(0.1, 6, 0.9), 15),
    (of_f(0.3, 2), 20),
]


@pytest.mark.parametrize(("design", "n"), DESIGNS)
def test_simulation_and_closed_form_agree(design: Design, n: int) -> None:
    found = simulate(design, n, 20_000, 5)
    low, high = found.own.interval(0.999)
    assert low <= (closed_form(design, n) or 0) <= high
    assert (found.corrected is not None) == (design.conditions > 2)
    if found.corrected is not None:  # the correction only ever takes power away
        assert found.corrected.significant <= found.own.significant


@pytest.mark.parametrize("dz", [0.4, 1.0, 1.8])
def test_six_pairs_are_significant_when_all_signs_agree(dz: float) -> None:
    """Of the signed-rank test the power at n = 6 is known: Φ(d_z)⁶ + Φ(−d_z)⁶."""
    low, high = simulate(Design("wilcoxon", dz), 6, 20_000, 2).own.interval(0.999)
    assert low <= stats.norm.cdf(dz) ** 6 + stats.norm.cdf(-dz) ** 6 <= high
    assert simulate(Design("wilcoxon", dz), 5, 1000, 2).own.significant == 0


def test_a_draw_depends_on_its_seed_and_n_alone() -> None:
    design = of_f(0.3, 3)
    whole = simulate(design, 10, 2000, 3)
    assert simulate(design, 10, 2000, 3, values_at_once=700) == whole
    assert simulate(design, 10, 2000, 4) != whole


def test_the_interval_of_a_simulated_power_is_exact() -> None:
    """Clopper and Pearson: none or all of n have bounds in closed form."""
    assert Share(0, 500).interval() == pytest.approx((0, 1 - 0.025 ** (1 / 500)))
    assert Share(500, 500).interval() == pytest.approx((0.025 ** (1 / 500), 1))


@given(significant=st.integers(0, 300), level=st.floats(0.5, 0.999))
def test_the_interval_of_a_simulated_power_is_scipys(significant: int, level: float) -> None:
    wanted = stats.binomtest(significant, 300).proportion_ci(level, method="exact")
    assert Share(significant, 300).interval(level) == pytest.approx((wanted.low, wanted.high), rel=1e-9, abs=1e-12)


# The number of participants -------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=30)
@given(dz=st.floats(0.25, 3), target=st.floats(0.3, 0.97))
def test_one_participant_fewer_is_too_few(dz: float, target: float) -> None:
    found = sample_size(Design("t_paired", dz), target, 200, 1, 400)
    assert found is not None
    assert found.closed_form is not None
    assert paired_t_power(dz, found.closed_form) >= target
    assert found.closed_form == 2 or paired_t_power(dz, found.closed_form - 1) < target
    rows = {row.n: row for row in found.rows}
    assert found.closed_form in rows
    needed = found.simulated
    assert needed.n is not None
    assert needed.low is not None
    assert needed.low <= needed.n <= (needed.high or 400)
    assert rows[needed.n].simulated.own.power >= target


@pytest.mark.parametrize(("dz", "wanted"), [(0.5, 35), (0.8, 15), (1.0, 11)])
def test_participants_of_the_wilcoxon_test(dz: float, wanted: int) -> None:
    """As brute force has it: every n in turn, until from there on the power is reached."""
    found = sample_size(Design("wilcoxon", dz), 0.8, 5000, 1, 100)
    assert found is not None
    assert found.closed_form is None
    reached = [simulate(Design("wilcoxon", dz), n, 5000, 1).own.power >= 0.8 for n in range(2, 50)]
    last_below = max(n for n, enough in enumerate(reached, start=2) if not enough)
    needed = found.simulated
    assert needed.low is not None
    assert needed.high is not None
    assert needed.low <= last_below + 1 <= needed.high
    assert needed.low <= wanted <= needed.high


# The command ----------------------------------------------------------------------------------------------------

QUICK = ("--simulations", "400")


def test_the_answer_and_what_it_means(power: Power) -> None:
    ran = power("--effect", "0.5", *QUICK)
    assert ran.code == 0
    assert "Paired t test, two-sided, alpha = 0.05, for a power of 0.8" in ran.out
    assert "d_z = 0.50: the mean difference over the SD of the differences" in ran.out
    assert "Closed form (noncentral t): 34 participants." in ran.out
    assert "chance that p < 0.05 if the effect is as stated" in ran.out
    row = next(line.split() for line in ran.out.splitlines() if line.split()[:1] == ["34"])
    assert row[1] == ".808"
    assert power("--effect", "-0.5", *QUICK).out == ran.out


def test_the_ways_to_state_an_effect(power: Power) -> None:
    stated = power("--difference", "12", "--sd", "24", "--correlation", "0.5", *QUICK)
    assert "A difference of 12 at an SD of 24 within each condition: d = 0.50" in stated.out
    assert "r = .50: correlation of a participant's values in two conditions\n" in stated.out
    assert "Closed form (noncentral t): 34 participants." in stated.out
    assumed = power("--difference", "12", "--sd", "24", *QUICK)
    assert "in two conditions (assumed; --correlation states it)" in assumed.out
    closer = power("--effect", "0.5", "--correlation", "0.755", *QUICK)  # d_z = 0.5 / 0.7
    assert "d = 0.50: the mean difference over the SD within a condition" in closer.out
    assert "d_z = 0.71: " in closer.out
    assert "Closed form (noncentral t): 18 participants." in closer.out
    several = power("--test", "rm_anova", "--conditions", "4", "--effect", "0.25", *QUICK)
    assert "f = 0.25: the SD of the conditions' means over the SD within a condition" in several.out
    assert "Closed form (noncentral F): 24 participants." in several.out
    assert "corrected by Greenhouse-Geisser, as a report judges: " in several.out
    least = power("--test", "rm_anova", "--conditions", "4", "--difference", "1", "--sd", "1", *QUICK)
    assert "f = 0.35: " in least.out
    assert "the others in the middle: the smallest f it can be" in least.out


def test_the_orders_the_participants_share(power: Power) -> None:
    ran = power("--test", "rm_anova", "--conditions", "3", "--effect", "0.5", *QUICK)
    assert "Counterbalancing (steadyhand plan) takes 6 sequences, which 12 participants share evenly." in ran.out


def test_the_files(power: Power, tmp_path: Path) -> None:
    out = tmp_path / "plan"
    words = ("--test", "rm_anova", "--conditions", "3", "--effect", "0.4", *QUICK, "--out", out)
    ran = power(*words)
    assert ran.code == 0
    content = json.loads((out / "power.json").read_text(encoding="utf-8"))
    rows = list(csv.DictReader((out / "power.csv").read_text(encoding="utf-8").splitlines()))
    assert {row.pop("effect") for row in rows} == {"condition"}
    numbers = [{key: float(cell) for key, cell in row.items()} for row in rows]
    assert [{"effect": "condition", **row} for row in numbers] == content["rows"]
    rows = list(csv.DictReader((out / "power.csv").read_text(encoding="utf-8").splitlines()))
    assert set(content["meaning"]) <= set(rows[0])
    assert content["settings"]["power"] == 0.8
    assert f"{content['needed']['closed_form']} participants" in ran.out
    assert str(content["needed"]["corrected"]["n"]) in ran.out
    svg = (out / "power.svg").read_bytes()
    assert ElementTree.fromstring(svg).tag.endswith("svg")  # noqa: S314 - our own
    power(*words)
    assert (out / "power.svg").read_bytes() == svg
    assert json.loads((out / "power.json").read_text(encoding="utf-8")) == content


def test_columns_of_the_files_do_not_vary(power: Power, tmp_path: Path) -> None:
    headers = set()
    for test in ("t_paired", "wilcoxon", "rm_anova", "t_welch", "kruskal", "mixed_anova"):
        assert power("--test", test, "--effect", "1", *QUICK, "--out", tmp_path / test).code == 0
        headers.add((tmp_path / test / "power.csv").read_text().splitlines()[0])
    assert len(headers) == 1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "the effect is missing; give --effect 0.5, for example, or --difference and --sd"),
        (("--difference", "3"), "the effect is missing"),
        (("--effect", "0.5", "--sd", "2"), "--effect says the same as --difference with --sd; give only one of them"),
        (("--effect", "0"), "--effect: should not be 0, and its size at most 100, found 0"),
        (("--effect", "nan"), "--effect: should not be 0"),
        (("--difference", "0", "--sd", "2"), "--difference over --sd: should not be 0"),
        (("--difference", "1", "--sd", "0"), "--sd: should lie between 0 and inf, found 0"),
        (("--effect", "0.5", "--correlation", "1"), "--correlation: should lie between -1 and 1, found 1"),
        (
            ("--test", "rm_anova", "--conditions", "4", "--effect", "0.5", "--correlation", "-0.5"),
            "--correlation: should lie between -0.333 and 1, found -0.5",
        ),
        (("--effect", "0.5", "--power", "1"), "--power: should lie between 0.05 and 1, found 1"),
        (("--effect", "0.5", "--power", "0.04"), "--power: should lie between 0.05 and 1, found 0.04"),
        (("--effect", "0.5", "--alpha", "0"), "--alpha: should lie between 0 and 1, found 0"),
        (("--effect", "0.5", "--test", "t_pared"), '--test: "t_pared" is not known; did you mean "t_paired"?'),
        (("--effect", "0.5", "--conditions", "3"), "t_paired compares two conditions; take --test rm_anova"),
        (("--effect", "0.1", "--max-n", "100"), "power: 100 participants reach a power of .168 only, not 0.8"),
        (
            ("--effect", "0.1", "--max-n", "50", "--test", "wilcoxon", *QUICK),
            "power: 50 participants reach a power of .1",
        ),
    ],
)
def test_what_cannot_be_planned(power: Power, words: tuple[str, ...], told: str) -> None:
    ran = power(*words)
    assert ran.code == 2
    assert told in ran.err
    assert ran.out == ""


def test_nothing_is_written_into_a_study(power: Power, folder: Callable[..., Path]) -> None:
    root = folder("conditions: [a, b]\n")
    ran = power("--effect", "0.5", *QUICK, "--out", root)
    assert ran.code == 2
    assert "is the folder of a study; choose another folder for the report" in ran.err
    assert [path.name for path in root.iterdir()] == ["study.yaml"]
