"""What tests assume is shown for every design: within people, between groups, and of three conditions or more."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from tests.pipeline.analysis.test_options import Values, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

GROUPS: Values = {
    "time_s": {
        "A": [11.0, 10.2, 12.5, 9.8, 13.1, 11.7, 10.9, 30.4],
        "B": [8.1, 9.4, 7.9, 8.8, 10.2, 9.1, 8.6, 9.0],
    }
}
THREE: Values = {
    "time_s": {
        "A": [9.1, 11.2, 10.4, 9.8, 12.0, 10.9, 10.0, 11.5],
        "B": [8.0, 10.1, 9.9, 8.1, 10.2, 9.0, 8.8, 9.9],
        "C": [9.4, 14.8, 10.1, 7.9, 17.1, 10.0, 6.2, 15.3],
    }
}


def printed(p: float) -> str:
    return "< .0001" if p < 0.0001 else f"{p:.4f}".removeprefix("0")


def test_groups_are_checked_and_what_speaks_against_them_is_a_caution(steadyhand: Steadyhand, tmp_path: Path) -> None:
    declared = "factors: {condition: between}\n"
    page = read(steadyhand, study(tmp_path / "s", GROUPS, ["measure: time_s, test: t_welch"], declared, apart=True))
    one, other = (np.array(GROUPS["time_s"][name]) for name in "AB")
    ps = [printed(float(stats.shapiro(values).pvalue)) for values in (one, other)]
    levene = stats.levene(one, other, center="mean")
    assert f"A − B {ps[0]} and {ps[1]} {levene.statistic:.2f} {printed(float(levene.pvalue))}" in page
    assert "Values within a group are not normally distributed (Shapiro-Wilk test) for Time (s)" in page


def test_sphericity_is_shown_with_both_corrections(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page = read(steadyhand, study(tmp_path / "s", THREE, ["measure: time_s, test: rm_anova"]))
    (row,) = (one for one in steadyhand.results()["comparisons"] if one["contrast"] is None)
    details = row["details"]
    shown = [f"{details[name]:.3f}".removeprefix("0") for name in ("mauchly_w", "epsilon_gg", "epsilon_hf")]
    assert "Mauchly's p is below the 5 % level in 1 of 1" in page
    assert f"{shown[0]} {printed(details['mauchly_p'])} {shown[1]} {shown[2]} {printed(details['p_gg'])}" in page
    assert "rests on the Greenhouse-Geisser p" in page
    assert (
        "with p corrected for sphericity (Greenhouse-Geisser) beside the uncorrected one, its pairs by paired t" in page
    )


def test_two_conditions_have_no_sphericity(steadyhand: Steadyhand, tmp_path: Path) -> None:
    two: Values = {"time_s": {name: THREE["time_s"][name] for name in "AB"}}
    page = read(steadyhand, study(tmp_path / "s", two, ["measure: time_s, test: rm_anova"]))
    assert "phericity" not in page
    assert "rm ANOVA: repeated-measures ANOVA. P values are not adjusted." in page
