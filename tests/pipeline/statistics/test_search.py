"""The search for the smallest number that reaches something, and for the fewest participants by simulated studies."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.statistics.power_simulation import Share
from pipeline.statistics.sample_size import Needed, needed
from pipeline.statistics.search import smallest


@given(low=st.integers(-5, 5), more=st.integers(0, 40), threshold=st.integers(-10, 60), data=st.data())
def test_the_smallest_is_found_from_wherever_the_search_begins(
    low: int, more: int, threshold: int, data: st.DataObject
) -> None:
    high = low + more
    start = data.draw(st.integers(low, high))
    wanted = next((number for number in range(low, high + 1) if number >= threshold), None)
    assert smallest(lambda number: number >= threshold, low, high, start) == wanted


@pytest.mark.parametrize("start", range(2, 9))
def test_the_fewest_participants_by_simulation_and_what_its_error_allows(start: int) -> None:
    """Shares of 70, 75, 80 … of 100 studies for 2, 3, 4 … participants, and a power of .8.

    Clopper and Pearson's intervals, by quantiles of the beta distribution: of 70 .600 to .788, of 75 .653 to .831, of
    85 .765 to .914, of 90 .824 to .951. So four reach it, three may, and six do for certain.
    """
    assert needed(lambda n: Share(60 + 5 * n, 100), 0.8, start, 8) == Needed(4, 3, 6)
    assert needed(lambda n: Share(60 + 5 * n, 100), 0.8, min(start, 5), 5) == Needed(4, 3, None)
    assert needed(lambda n: Share(60 + 5 * n, 100), 0.8, min(start, 3), 3) == Needed(None, 3, None)
