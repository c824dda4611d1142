"""The compiled adaptive filter beside the slow one, and the laws it keeps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion_core import FusionAdaptive, Samples, Sensor, replay_loop
from fusion_core.adaptive import layout
from tests.benchmarks.departures import SENSORS, Departure, recorded, simulated
from tests.fusion_core.adaptive.dense import taken


def _steady(seconds: float = 2.0) -> dict[str, Samples]:
    """A simulated recording whose frames come one by one, 0.1 s late, with all of the phone's readings before them."""
    return recorded(simulated(seconds + 1.0, seed=3), Departure()).samples


def test_the_compiled_filter_is_the_textbook_one() -> None:
    samples = _steady()
    estimator = FusionAdaptive(SENSORS)
    times = samples["tracker"].arrival
    trace = np.zeros((len(times), layout.FACTS + 2 * layout.SIZE))
    estimator.traced(samples, times, trace)
    assert np.abs(trace[:, layout.CLOCK_S]).max() > 1e-4  # the offset moves, so that what depends on it is tried
    dense = taken(estimator.model, samples["tracker"], samples["imu"])
    facts, mean, sd = np.split(trace[-1], [layout.FACTS, layout.FACTS + layout.SIZE])
    assert facts[layout.AT] == pytest.approx(dense["time"], abs=1e-9)
    np.testing.assert_allclose(facts[[layout.CLOCK_S, layout.CLOCK_VARIANCE]], dense["clock"], rtol=1e-5)
    np.testing.assert_allclose(facts[layout.NOISE : layout.NOISE + 4], dense["scale"], rtol=1e-6)
    np.testing.assert_allclose(mean, dense["mean"], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(sd, np.sqrt(np.diag(dense["covariance"])), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "departure",
    [Departure(), Departure(burst_s=0.1), Departure(jitter_s=0.02), Departure(clock_s=0.03), Departure(spell="swap")],
)
def test_live_is_replay(departure: Departure) -> None:
    whole = recorded(simulated(14.0), departure)
    estimator = FusionAdaptive(SENSORS)
    times = whole.times[::7]
    live, replay = replay_loop(estimator, whole.samples, times), estimator.replay(whole.samples, times)
    np.testing.assert_allclose(live.mean, replay.mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(live.sd, replay.sd, rtol=0, atol=1e-9)


def test_a_held_position_and_zeros_are_no_measurements() -> None:
    for spell in ("freeze", "zeros"):
        whole = recorded(simulated(30.0), Departure(spell=spell))
        lost = recorded(simulated(30.0), Departure(spell="loss"))
        estimator = FusionAdaptive(SENSORS)
        first, second = (estimator.replay(one.samples, one.times).mean - one.truth for one in (whole, lost))
        assert np.sqrt(np.mean(first**2)) < 1.1 * np.sqrt(np.mean(second**2))


def test_a_tracker_that_says_nothing_but_zero_is_believed() -> None:
    frames, forces = np.arange(0, 3, 1 / 30), np.arange(0, 3, 1 / 90)
    samples = {
        "tracker": Samples(frames, frames + 0.1, np.zeros((len(frames), 3))),
        "imu": Samples(forces, forces, np.zeros((len(forces), 3))),
    }
    track = FusionAdaptive(SENSORS).replay(samples, forces[forces > 2])
    assert np.abs(track.mean).max() < 1e-6
    assert track.sd.max() < 8


def test_the_phone_may_fall_silent() -> None:
    """Then positions alone are shown, and no less well than they come."""
    whole = recorded(simulated(40.0), Departure())
    imu, frames = whole.samples["imu"], whole.samples["tracker"]
    heard = imu.time < 20
    assert imu.rotation is not None
    assert imu.force is not None
    silent = Samples(imu.time[heard], imu.arrival[heard], imu.value[heard], imu.rotation[heard], imu.force[heard])
    late = whole.times > 24
    track = FusionAdaptive(SENSORS).replay({"tracker": frames, "imu": silent}, whole.times[late])
    raw = frames.value[np.searchsorted(frames.arrival, whole.times[late], side="right") - 1]
    fused, held = (np.sqrt(np.mean((one - whole.truth[late]) ** 2)) for one in (track.mean, raw))
    assert fused < held


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10_000), st.integers(1, 2))
def test_fewer_axes_are_the_same_filter(seed: int, dimension: int) -> None:
    """An axis more that nothing moves and nothing sees changes nothing: without rotations, axes share only scales."""
    random = np.random.default_rng(seed)
    frames, forces = np.arange(0, 1.5, 1 / 30), np.arange(0, 1.5, 1 / 90)
    value, felt = random.normal(0, 8, (len(frames), dimension)), random.normal(0, 100, (len(forces), dimension))
    sensors = {"t": Sensor("position", 8.0, 0.1, dimension), "a": Sensor("acceleration", 100.0, 0.0, dimension)}
    samples = {"t": Samples(frames, frames + 0.1, value), "a": Samples(forces, forces, felt)}
    track = FusionAdaptive(sensors).replay(samples, forces)
    assert track.mean.shape == (len(forces), dimension)
    mirrored = {"t": Samples(frames, frames + 0.1, -value), "a": Samples(forces, forces, -felt)}
    other = FusionAdaptive(sensors).replay(mirrored, forces)
    np.testing.assert_allclose(other.mean, -track.mean, atol=1e-9)
    np.testing.assert_allclose(other.sd, track.sd, atol=1e-9)


def test_a_hand_that_neither_sensor_sees_is_not_sent_away() -> None:
    """No frame and no reading for three seconds: what is shown stays near, and its SD says how near."""
    whole = recorded(simulated(40.0), Departure())
    imu, frames = whole.samples["imu"], whole.samples["tracker"]
    heard, seen = ((one.time < 20.0) | (one.time > 23.0) for one in (imu, frames))
    assert imu.rotation is not None
    assert imu.force is not None
    phone = Samples(imu.time[heard], imu.arrival[heard], imu.value[heard], imu.rotation[heard], imu.force[heard])
    samples = {"tracker": Samples(frames.time[seen], frames.arrival[seen], frames.value[seen]), "imu": phone}
    blind = (whole.times > 20.0) & (whole.times < 23.15)
    track = FusionAdaptive(SENSORS).replay(samples, whole.times)
    error = track.mean - whole.truth
    held = frames.value[np.searchsorted(frames.arrival, 20.0) - 1] - whole.truth[blind]
    assert np.sqrt(np.mean(error[blind] ** 2)) < 2.0 * np.sqrt(np.mean(held**2))
    assert np.mean(np.abs(error[blind]) < 1.96 * track.sd[blind]) > 0.9
    after = (whole.times > 24.0) & (whole.times < 30.0)
    assert np.sqrt(np.mean(error[after] ** 2)) < 1.3 * np.sqrt(np.mean(error[whole.times > 30.0] ** 2))
