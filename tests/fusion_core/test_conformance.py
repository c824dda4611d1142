"""What must hold for every estimator there is."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion_core import ESTIMATORS, Estimator, Samples, Sensor, replay_loop
from fusion_core.estimator import Resuming
from fusion_core.phone.orientation import rotate

SENSORS = {"tracker": Sensor("position", 8.0, 0.1, 3), "imu": Sensor("acceleration", 100.0, 0.0, 3)}
TIMES = np.arange(0.0513, 2.0, 0.0371)  # never at the very instant of an arrival

RATED = {"tracker": replace(SENSORS["tracker"], rate_hz=30.0), "imu": replace(SENSORS["imu"], rate_hz=90.0)}
_SETTLED = {"bias_frame": "tracker", "gate_sd": 0.0, "adaptation": 0.0}
VARIANTS: dict[str, tuple[str, dict[str, Sensor], dict[str, Any]]] = {
    **{name: (name, SENSORS, {}) for name in ESTIMATORS},
    "window_gp, regular": ("window_gp", RATED, {}),
    "window_gp, average": ("window_gp", SENSORS, {"mean": "window", "bias_sd_mm_s2": 200.0}),
    "window_gp, differences": ("window_gp", SENSORS, {"derivative": "finite_difference"}),
    "fusion_kalman, in the tracker's frame": ("fusion_kalman", SENSORS, _SETTLED),
    "fusion_kalman, Matérn": ("fusion_kalman", SENSORS, {"prior": "matern72"}),
    "fusion_kalman, fixed gain": ("fusion_kalman", RATED, {**_SETTLED, "path": "fixed_gain"}),
}
estimators = pytest.mark.parametrize("name", list(VARIANTS))


def build(name: str, **sensors: Sensor) -> Estimator:
    kind, used, parameters = VARIANTS[name]
    if sensors and parameters.get("path") == "fixed_gain":
        pytest.skip("fixed gains are of two sensors")
    if sensors and kind == "fusion_adaptive":
        pytest.skip("fusion_adaptive is of two sensors")
    return ESTIMATORS[kind](sensors or used, **parameters)


def recording(seed: int = 0, regular: bool = True, shuffled: bool = False) -> dict[str, Samples]:
    """Two seconds of both sensors; irregular: jittered stamps and dropped frames; shuffled: some overtake others."""
    random = np.random.default_rng(seed)
    samples = {}
    for name, rate, late, scale in (("tracker", 30, 0.1, 100.0), ("imu", 90, 0.002, 500.0)):
        time = np.arange(0, 2, 1 / rate)
        if not regular:
            time = np.sort(time + random.uniform(0, 0.6 / rate, len(time)))[random.random(len(time)) > 0.2]
        arrival = time + late + (random.uniform(0, 0.08, len(time)) if shuffled else 0.0)
        order = np.argsort(arrival, kind="stable")
        samples[name] = Samples(time[order], arrival[order], random.normal(0, scale, (len(time), 3))[order])
    return samples


def same(first: Any, second: Any, tolerance_mm: float = 1e-9) -> None:
    np.testing.assert_array_equal(np.isnan(first.mean), np.isnan(second.mean))
    np.testing.assert_allclose(first.mean, second.mean, rtol=0, atol=tolerance_mm)
    np.testing.assert_allclose(first.sd, second.sd, rtol=0, atol=tolerance_mm)


@estimators
@pytest.mark.parametrize("kind", ["regular", "irregular", "shuffled"])
def test_replay_is_one_update_a_sample_and_one_predict_a_time(name: str, kind: str) -> None:
    estimator = build(name)
    samples = recording(1, regular=kind == "regular", shuffled=kind == "shuffled")
    same(estimator.replay(samples, TIMES), replay_loop(estimator, samples, TIMES), 1e-8)


@estimators
@pytest.mark.parametrize("there", [(), ("tracker",), ("imu",), ("tracker", "imu")])
@pytest.mark.parametrize("empty", [(), ("tracker",), ("imu",)])
def test_streams_that_are_missing_or_empty_are_no_fault(
    name: str, there: tuple[str, ...], empty: tuple[str, ...]
) -> None:
    nothing = Samples(np.empty(0), np.empty(0), np.empty((0, 3)))
    samples = {sensor: recording(1)[sensor] for sensor in there} | dict.fromkeys(empty, nothing)
    estimator = build(name)
    for times in (TIMES, TIMES[::-1], np.empty(0)):
        same(estimator.replay(samples, times), replay_loop(estimator, samples, times), 1e-8)


@estimators
@settings(deadline=None, max_examples=15)
@given(cut=st.floats(0.1, 1.9), seed=st.integers(0, 5))
def test_no_estimator_sees_the_future(name: str, cut: float, seed: int) -> None:
    estimator = build(name)
    whole = recording(seed, regular=False, shuffled=True)
    past = {}
    for sensor, samples in whole.items():
        known = samples.arrival <= cut
        past[sensor] = Samples(samples.time[known], samples.arrival[known], samples.value[known])
    times = TIMES[cut >= TIMES]
    if len(times):
        same(estimator.replay(whole, times), estimator.replay(past, times))


@estimators
def test_states_are_pure_and_go_on_elsewhere(name: str) -> None:
    estimator = build(name)
    samples = recording(2)
    state = estimator.start()
    for index in range(20):
        state = estimator.update(state, "tracker", samples["tracker"][index])
        state = estimator.update(state, "imu", samples["imu"][3 * index])
    before = estimator.predict(state, 0.8)
    elsewhere = pickle.loads(pickle.dumps((estimator, state)))  # noqa: S301 - our own bytes
    for one, other in zip(elsewhere[0].predict(elsewhere[1], 0.8), before, strict=True):
        np.testing.assert_array_equal(one, other)
    estimator.update(state, "tracker", samples["tracker"][20])
    for one, other in zip(estimator.predict(state, 0.8), before, strict=True):
        np.testing.assert_array_equal(one, other)


@estimators
def test_nothing_is_known_before_the_first_frame_and_unused_sensors_change_nothing(name: str) -> None:
    estimator = build(name, tracker=SENSORS["tracker"])
    mean, sd = estimator.predict(estimator.start(), 0.0)
    assert mean.shape == sd.shape == (3,)
    assert np.isnan(mean).all() and np.isnan(sd).all()
    samples = recording(3)
    alone = estimator.replay({"tracker": samples["tracker"]}, TIMES)
    same(estimator.replay(samples, TIMES), alone)


@estimators
@settings(deadline=None, max_examples=10)
@given(
    shift=st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    turn=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(x * x for x in q) > 0.1),
)
def test_rigid_motion_of_the_world_moves_the_estimate_with_it(
    name: str, shift: tuple[float, ...], turn: tuple[float, ...]
) -> None:
    estimator = build(name)
    here = recording(4, regular=False)
    quaternion = np.array(turn)
    there = {
        "tracker": Samples(
            here["tracker"].time, here["tracker"].arrival, rotate(quaternion, here["tracker"].value) + np.array(shift)
        ),
        "imu": Samples(here["imu"].time, here["imu"].arrival, rotate(quaternion, here["imu"].value)),
    }
    one, other = estimator.replay(here, TIMES), estimator.replay(there, TIMES)
    known = np.isfinite(one.mean).all(axis=1)
    np.testing.assert_allclose(rotate(quaternion, one.mean[known]) + np.array(shift), other.mean[known], atol=1e-6)
    np.testing.assert_allclose(one.sd, other.sd, atol=1e-9)


@estimators
def test_the_origin_of_time_does_not_matter(name: str) -> None:
    estimator = build(name)
    here = recording(5)
    later = {key: Samples(s.time + 64.0, s.arrival + 64.0, s.value) for key, s in here.items()}
    # A second difference over 11 ms takes eight of a number's sixteen digits.
    tolerance_mm = 1e-3 if "differences" in name else 1e-6
    same(estimator.replay(here, TIMES), estimator.replay(later, TIMES + 64.0), tolerance_mm)


@estimators
def test_stated_sds_are_positive_and_the_same_for_every_axis(name: str) -> None:
    track = build(name).replay(recording(6), TIMES[5:])
    assert (track.sd > 0).all()
    np.testing.assert_allclose(track.sd, np.repeat(track.sd[:, :1], 3, axis=1), rtol=1e-12)  # sums by BLAS


@estimators
@pytest.mark.parametrize("kind", ["regular", "irregular", "shuffled"])
def test_a_replay_piece_by_piece_is_that_of_the_whole_to_the_last_bit(name: str, kind: str) -> None:
    estimator = build(name)
    if not (isinstance(estimator, Resuming) and estimator.resumes):
        pytest.skip("is replayed as a whole")
    samples = recording(3, regular=kind == "regular", shuffled=kind == "shuffled")
    whole, state, parts = estimator.replay(samples, TIMES), estimator.start(), []
    for since, until in pairwise((-np.inf, 0.4, 0.41, 1.3, 1.7, np.inf)):
        inside = {key: (one.arrival >= since) & (one.arrival < until) for key, one in samples.items()}
        piece = {
            key: Samples(one.time[inside[key]], one.arrival[inside[key]], one.value[inside[key]])
            for key, one in samples.items()
        }
        track, state = estimator.resume(state, piece, TIMES[(since <= TIMES) & (until > TIMES)])
        parts.append(track)
    np.testing.assert_array_equal(np.concatenate([part.mean for part in parts]), whole.mean)
    np.testing.assert_array_equal(np.concatenate([part.sd for part in parts]), whole.sd)
