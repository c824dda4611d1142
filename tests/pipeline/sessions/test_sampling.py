"""Samples that are missing, from stamps as drivers give them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.sessions.sampling import sampling

STEP_NS = 10_000_000


@given(st.integers(100, 600), st.sets(st.integers(1, 98), max_size=9))
def test_every_lost_sample_of_a_steady_stream_is_counted(count: int, lost: set[int]) -> None:
    kept = [place for place in range(count) if place not in lost]
    found = sampling(np.array(kept) * STEP_NS)
    assert (found.missing, found.expected) == (len(lost), count)
    assert found.share == len(lost) / count


def test_the_order_of_the_file_does_not_matter() -> None:
    stamps = np.delete(np.arange(200) * STEP_NS, [50, 51, 120])
    assert sampling(np.random.default_rng(1).permutation(stamps)) == sampling(stamps)


def test_a_reading_with_the_stamp_of_the_one_before_is_not_missing() -> None:
    place = np.arange(300)
    doubled = np.where(place % 5 == 4, place - 1, place) * STEP_NS  # every fifth, as one camera's driver stamps
    assert sampling(doubled).missing == 0


def test_of_bursts_and_of_two_senders_nobody_can_tell() -> None:
    packet = (np.arange(50)[:, None] * 10 * STEP_NS + np.arange(10) * 50_000).ravel()
    assert sampling(packet)[::2] == (None, "come in bursts")
    two = np.concatenate([np.arange(200) * STEP_NS, np.arange(200) * STEP_NS + round(0.37 * STEP_NS)])
    assert sampling(two)[::2] == (None, "are irregular")
    assert sampling(np.full(20, 5))[::2] == (None, "have a single stamp")
