"""A tracker that follows another body for a while, where the fusion itself soon knows little of where the hand is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusion_core import Estimator, FusionAdaptive, Raw
from fusion_core.samples import Samples
from tests.benchmarks.departures import SENSORS, Departure, Recorded, recorded, simulated

FUSION = FusionAdaptive(SENSORS)


def rmse_mm(whole: Recorded, estimator: Estimator = FUSION) -> float:
    error = estimator.replay(whole.samples, whole.times).mean - whole.truth
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


@pytest.mark.parametrize("spell", ["swap", "zeros", "freeze"])
@pytest.mark.parametrize("withheld", [False, True])
def test_it_costs_no_more_than_not_being_seen(spell: str, withheld: bool) -> None:
    """The heading, which is found from positions where the phone does not say it, is not led away either."""
    source = simulated(30.0, swing=2.0)
    lost = rmse_mm(recorded(source, Departure(spell="loss", withheld=withheld)))
    assert rmse_mm(recorded(source, Departure(spell=spell, withheld=withheld))) < 1.02 * lost


def test_another_body_is_told_though_the_fusion_would_not_be_surprised() -> None:
    """Accelerations that are all wrong widen what a hand is expected to do, beyond where the other body is."""
    source = simulated(40.0)
    wrong = np.random.default_rng(2).normal(0.0, 20_000.0, source.force_mm_s2.shape)
    shaken = replace(source, force_mm_s2=source.force_mm_s2 + wrong)
    whole = recorded(shaken, Departure(spell="swap"))
    assert rmse_mm(whole) < rmse_mm(whole, Raw(SENSORS))


def test_a_hand_that_was_set_aside_is_where_it_is_seen_after_a_second_and_a_half() -> None:
    whole = recorded(simulated(30.0), Departure())
    frames = whole.samples["tracker"]
    moved_mm = np.where(frames.time[:, None] < 15.0, 0.0, [400.0, -300.0, 100.0])
    tracker = Samples(frames.time, frames.arrival, frames.value + moved_mm)
    shown = FUSION.replay({**whole.samples, "tracker": tracker}, whole.times).mean
    after = whole.times > 17.0
    off = shown[after] - whole.truth[after] - [400.0, -300.0, 100.0]
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 20.0
