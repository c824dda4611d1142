"""How much may come from one source: an honest one loses nothing after a stall, a flood is bounded."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.live.limits import Flow, admit

NS, LIMIT = 1_000_000_000, 300.0


def taken(times_ns: list[int], limit: float = LIMIT) -> tuple[int, Flow]:
    """How many of what comes at these times are taken."""
    flow, count = Flow(limit, times_ns[0]), 0
    for at in times_ns:
        flow, admitted = admit(flow, limit, at)
        count += admitted
    return count, flow


@given(rate=st.floats(1, 299), begins_s=st.floats(3, 8), stall_s=st.floats(0, 2), often=st.integers(1, 3))
def test_what_waited_while_the_machine_stood_still_is_taken(
    rate: float, begins_s: float, stall_s: float, often: int
) -> None:
    """A phone's pace is below the limit; what it sent during each stall comes at its end, at once."""
    sent = [round(number * NS / rate) for number in range(round(rate * begins_s * (often + 1)))]
    stalls = [(begins_s * (at + 1), begins_s * (at + 1) + stall_s) for at in range(often)]
    for begin_s, end_s in stalls:
        sent = [round(end_s * NS) if begin_s * NS < at < end_s * NS else at for at in sent]
    assert taken(sorted(sent))[0] == len(sent)


@given(seed=st.integers(0, 2**32), longest_ms=st.floats(0.1, 20))
def test_never_more_than_two_seconds_worth_over_the_pace(seed: int, longest_ms: float) -> None:
    steps = np.random.default_rng(seed).uniform(0, longest_ms * 1e6, 2000).astype(np.int64)
    times: list[int] = np.cumsum(steps).tolist()
    assert taken(times)[0] <= LIMIT * (times[-1] - times[0]) / NS + 2 * LIMIT + 1


def test_a_flood_is_bounded_and_told_after_ten_seconds() -> None:
    flood = list(range(0, 12 * NS, NS // 5000))
    count, flow = taken(flood)
    assert count <= 12 * LIMIT + 2 * LIMIT
    assert flow.refused == len(flood) - count
    assert flow.is_flood
    assert not taken(flood[: 5 * 5000])[1].is_flood
