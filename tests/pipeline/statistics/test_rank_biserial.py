"""The interval of the rank-biserial correlation: against R, and against the p that it must not contradict."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.statistics.wilcoxon import wilcoxon
from tests.pipeline import r_reference

CASES = [name for name in r_reference.expected("rank_biserial") if name != "versions"]
ZEROS: tuple[Literal["dropped", "pratt"], ...] = ("dropped", "pratt")


@pytest.mark.parametrize("zeros", ZEROS)
@pytest.mark.parametrize("case", CASES)
def test_against_leaving_out_one_after_the_other_in_r(case: str, zeros: Literal["dropped", "pratt"]) -> None:
    wanted = r_reference.expected("rank_biserial")[case][zeros]
    rows = [row for row in r_reference.rows("rank_biserial") if row["case"] == case]
    differences = np.array([float(row["difference"]) for row in rows])
    found = wilcoxon(differences, np.zeros(len(differences)), zeros=zeros)
    assert found.effect_size == pytest.approx(wanted["r"], rel=1e-9)
    assert found.p == pytest.approx(wanted["p"], rel=1e-9)
    assert [found.ci_low, found.ci_high] == pytest.approx(wanted["ci"], rel=1e-9)


@settings(deadline=None, max_examples=300)
@given(
    differences=st.lists(st.integers(-6, 9), min_size=2, max_size=14).filter(any),
    zeros=st.sampled_from(ZEROS),
    scale=st.sampled_from([1.0, 0.1, 1e95]),
)
def test_it_leaves_out_zero_exactly_where_p_is_below_05(
    differences: list[int], zeros: Literal["dropped", "pratt"], scale: float
) -> None:
    found = wilcoxon(np.array(differences) * scale, np.zeros(len(differences)), zeros=zeros)
    assert found.p is not None
    assert found.effect_size is not None
    assert found.ci_low is not None
    assert found.ci_high is not None
    assert (found.ci_low > 0 or found.ci_high < 0) == (found.p < 0.05)
    assert -1 <= found.ci_low <= found.effect_size <= found.ci_high <= 1
    turned = wilcoxon(-np.array(differences) * scale, np.zeros(len(differences)), zeros=zeros)
    assert turned.ci_low == pytest.approx(-found.ci_high)
    assert turned.ci_high == pytest.approx(-found.ci_low)


def test_one_difference_against_the_others_makes_nothing_more_certain() -> None:
    """Fifteen of one sign have a lower bound; a sixteenth against them does not raise it to the next bound."""
    alone = wilcoxon(np.arange(2.0, 18.0), np.zeros(16))
    against = wilcoxon(np.concatenate([[-1.0], np.arange(2.0, 17.0)]), np.zeros(16))
    assert alone.ci_low is not None
    assert against.ci_low is not None
    assert against.ci_low <= alone.ci_low


def test_thousands_of_pairs_have_an_interval_too() -> None:
    differences = np.random.default_rng(0).normal(0.1, 1, 3001)
    found = wilcoxon(differences, np.zeros(3001))
    assert found.ci_low is not None
    assert found.ci_high is not None
    assert 0 < found.ci_low < (found.effect_size or 0) < found.ci_high < 0.2
