"""A fusion that accelerations have sent away: how far it goes, and how soon it is back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fusion_core import Estimator, FusionAdaptive, PositionKalman, Raw
from fusion_core.samples import Samples
from tests.benchmarks.departures import DEPARTURES, SENSORS, Departure, Recorded, Source, recorded, simulated

_KNOCK_AT_S = 20.0
FUSION = FusionAdaptive(SENSORS)


def _rms_mm(estimator: Estimator, whole: Recorded, within: npt.NDArray[np.bool_]) -> float:
    """The distance of what is shown from the hand, over the instants within."""
    error = estimator.replay(whole.samples, whole.times).mean[within] - whole.truth[within]
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def _knocked() -> Recorded:
    """A phone that says, for a tenth of a second, 20 m/s² of which the hand knows nothing."""
    source = simulated(40.0)
    struck = (source.time > _KNOCK_AT_S) & (source.time < _KNOCK_AT_S + 0.1)
    return recorded(
        replace(source, force_mm_s2=source.force_mm_s2 + np.outer(struck, [20_000.0, 0.0, 0.0])), Departure()
    )


def _unseen(whole: Recorded, begin_s: float, end_s: float) -> Recorded:
    frames = whole.samples["tracker"]
    seen = (frames.time < begin_s) | (frames.time > end_s)
    tracker = Samples(frames.time[seen], frames.arrival[seen], frames.value[seen])
    return replace(whole, samples={**whole.samples, "tracker": tracker})


def _shaken(source: Source, sd_mm_s2: float) -> Source:
    shaking = np.random.default_rng(5).normal(0.0, sd_mm_s2, source.force_mm_s2.shape)
    return replace(source, force_mm_s2=source.force_mm_s2 + shaking)


def test_after_a_knock_the_fusion_is_back_with_the_frames_that_follow() -> None:
    """They are where positions alone expected the hand: it is not another body that the tracker follows."""
    whole = _knocked()
    soon = (whole.times > _KNOCK_AT_S + 0.4) & (whole.times < _KNOCK_AT_S + 1.6)
    assert _rms_mm(FUSION, whole, soon) < _rms_mm(Raw(SENSORS), whole, soon)


def test_knocked_while_unseen_it_is_back_when_the_tracker_is() -> None:
    """Two metres away by then; the frames are near where the hand was last seen."""
    whole = _unseen(_knocked(), _KNOCK_AT_S - 0.1, _KNOCK_AT_S + 1.2)
    after = (whole.times > _KNOCK_AT_S + 1.5) & (whole.times < _KNOCK_AT_S + 3.0)
    assert _rms_mm(FUSION, whole, after) < 1.2 * _rms_mm(Raw(SENSORS), whole, after)


def test_a_shaken_phone_does_not_take_an_unseen_hand_away() -> None:
    """The hand is at most as far from where it is shown as from where it was last seen."""
    whole = _unseen(recorded(_shaken(simulated(40.0), 10_000.0), Departure()), 20.0, 23.0)
    unseen = (whole.times > 20.5) & (whole.times < 23.0)
    assert _rms_mm(FUSION, whole, unseen) < _rms_mm(Raw(SENSORS), whole, unseen)


def test_a_phone_that_is_shaken_loses_to_neither_filter_of_positions() -> None:
    """As its motor may, at rest and in motion, and read at 50 Hz."""
    whole = recorded(_shaken(simulated(40.0), 5_000.0), DEPARTURES["phone at 50 Hz"])
    always = np.ones(len(whole.times), dtype=bool)
    for alone in (Raw(SENSORS), PositionKalman(SENSORS)):
        assert _rms_mm(FUSION, whole, always) < _rms_mm(alone, whole, always)
