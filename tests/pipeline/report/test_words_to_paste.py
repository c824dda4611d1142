"""The texts to paste are as short as a paper's: amounts with their intervals, and pairs that do not differ together."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from tests.pipeline.analysis.test_options import Values, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

ALIKE: Values = {
    "time_s": {
        "A": [9.1, 11.2, 10.4, 9.8, 12.0, 10.9],
        "B": [9.4, 10.8, 10.6, 9.5, 12.3, 10.7],
        "C": [9.0, 11.4, 10.1, 10.1, 11.8, 11.1],
    }
}
SLOWER: Values = {
    "time_s": {
        "A": [20.0, 21, 19, 22, 20.5, 14, 15, 13.5, 14.2, 15.1],
        "B": [15.0, 16.5, 14.2, 16.4, 15.9, 14.1, 14.8, 13.6, 14.5, 15.0],
    }
}


def test_pairs_that_do_not_differ_are_said_together_with_the_least_p(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page = read(steadyhand, study(tmp_path / "s", ALIKE, ["measure: time_s, test: t_paired"]))
    pairs = (("A", "B"), ("A", "C"), ("B", "C"))
    least = min(stats.ttest_rel(ALIKE["time_s"][one], ALIKE["time_s"][other]).pvalue for one, other in pairs)
    p = f"{least:.3f}".removeprefix("0")
    text = page.replace("\u00a0", " ")
    assert re.search(
        rf"Time did not differ significantly between any two conditions \[row\] \(p ≥ {p}, n = 6\)\.", text
    )


def test_groups_under_a_condition_have_a_direction_and_an_amount(steadyhand: Steadyhand, tmp_path: Path) -> None:
    people = "participant,group\n" + "".join(f"P{at:02},{'new' if at <= 5 else 'old'}\n" for at in range(1, 11))
    folder = study(
        tmp_path / "s", SLOWER, ["measure: time_s, test: mixed_anova"], "factors: {group: between}\n", people=people
    )
    page = read(steadyhand, folder).replace("\u00a0", " ")
    new, old = SLOWER["time_s"]["A"][:5], SLOWER["time_s"]["A"][5:]
    bounds = stats.ttest_ind(new, old, equal_var=False).confidence_interval()
    amount = f"by {np.mean(new) - np.mean(old):.2f} s, 95 % CI [{bounds.low:.2f}, {bounds.high:.2f}]"
    assert f"Time was significantly lower for old than for new at A ({amount}" in page


def test_a_rank_test_answers_by_its_shift(steadyhand: Steadyhand, tmp_path: Path) -> None:
    """Hodges and Lehmann's: the median of all averages of two differences, and not the difference of the means."""
    two: Values = {
        "time_s": {"A": [11.0, 10.2, 12.5, 9.8, 13.1, 11.7, 30.9], "B": [8.1, 9.4, 7.9, 8.8, 10.2, 9.1, 9.6]}
    }
    page = read(steadyhand, study(tmp_path / "s", two, ["measure: time_s, test: wilcoxon"]))
    differences = np.subtract(two["time_s"]["A"], two["time_s"]["B"])
    averages = [(one + other) / 2 for at, one in enumerate(differences) for other in differences[at:]]
    assert f"{np.median(averages):.2f} s [" in page
    assert "(shift): Hodges and Lehmann's estimate" in page
    assert re.search(rf"by {np.median(averages):.2f}.s, 95.% CI \[[\d., ]+\], Hodges-Lehmann shift", page)


def test_the_first_page_has_the_effects_of_other_factors_too(steadyhand: Steadyhand, tmp_path: Path) -> None:
    people = "participant,group\n" + "".join(f"P{at:02},{'new' if at <= 5 else 'old'}\n" for at in range(1, 11))
    folder = study(
        tmp_path / "s", SLOWER, ["measure: time_s, test: mixed_anova"], "factors: {group: between}\n", people=people
    )
    first_page = read(steadyhand, folder).partition("Back to the contents")[0]
    assert "Time (s): mixed ANOVA: group, F(1, 8) = " in first_page.replace("\u00a0", " ")
