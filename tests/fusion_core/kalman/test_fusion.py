"""Fusion at the floor, with everything that goes wrong in a log, and the fixed gains it settles to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion_core import FusionKalman, Sample, Samples, Sensor, Term
from fusion_core.kalman import event_steps
from fusion_core.phone.orientation import rotations
from tests.benchmarks import floor
from tests.fusion_core.window.test_gp import RATED, regular

SPACE = {"tracker": Sensor("position", 8.0, 0.1), "imu": Sensor("acceleration", 100.0)}
PLAIN: dict[str, Any] = {"bias_frame": "tracker", "gate_sd": 0.0, "adaptation": 0.0}


@pytest.mark.parametrize("motion", list(floor.MOTIONS))
@pytest.mark.parametrize("case", list(floor.CASES))
def test_errors_stay_near_the_floor(case: str, motion: str) -> None:
    """The floor of 3.40 mm an axis is the posterior's SD with all the past; CASES says what is allowed above it."""
    parameters, trouble, most_mm = floor.CASES[case]
    moved = floor.MOTIONS[motion]
    error = floor.errors(FusionKalman(floor.SENSORS, **parameters), moved, trouble, runs=60)  # type: ignore[arg-type]
    assert floor.scored(error) <= most_mm
    assert abs(floor.lag_s(error, moved)) <= 0.005


def test_settled_fixed_gains_are_those_of_the_event_time_path() -> None:
    samples, times = regular(60.0)
    event = FusionKalman(RATED, **PLAIN).replay(samples, times)
    fixed = FusionKalman(RATED, **PLAIN, path="fixed_gain").replay(samples, times)
    settled = times > 40
    np.testing.assert_allclose(fixed.mean[settled], event.mean[settled], atol=1e-6)
    np.testing.assert_allclose(fixed.sd[settled], event.sd[settled], atol=1e-6)


@pytest.mark.parametrize("after_s", [0.002, 0.0055, 0.009])
def test_fixed_gains_know_where_in_the_cycle_accelerations_fall(after_s: float) -> None:
    samples, times = regular(60.0)
    imu = samples["imu"]
    samples["imu"] = Samples(imu.time + after_s, imu.arrival + after_s, imu.value)
    event = FusionKalman(RATED, **PLAIN).replay(samples, times + after_s)
    fixed = FusionKalman(RATED, **PLAIN, path="fixed_gain").replay(samples, times + after_s)
    np.testing.assert_allclose(fixed.mean[times > 40], event.mean[times > 40], atol=1e-6)


def test_fixed_gains_survive_lost_frames() -> None:
    """They are then not the best, and still near."""
    samples, times = regular(30.0)
    keep = np.random.default_rng(1).random(len(samples["tracker"])) > 0.2
    tracker = samples["tracker"]
    samples["tracker"] = Samples(tracker.time[keep], tracker.arrival[keep], tracker.value[keep])
    event = FusionKalman(RATED, **PLAIN).replay(samples, times)
    fixed = FusionKalman(RATED, **PLAIN, path="fixed_gain").replay(samples, times)
    assert np.sqrt(np.mean((fixed.mean - event.mean)[times > 10] ** 2)) < 2.0


@pytest.mark.parametrize(
    ("sensors", "parameters", "message"),
    [
        ({}, {"gate_sd": 4.0}, "path fixed_gain needs gate_sd 0.0, got 4.0"),
        ({}, {"bias_frame": "body"}, "path fixed_gain needs bias_frame tracker, got body"),
        ({"flow": Sensor("velocity", 5.0)}, {}, "needs one position sensor and one acceleration sensor"),
        ({"imu": Sensor("acceleration", 100.0)}, {}, "imu has no rate_hz"),
        (
            {"imu": Sensor("acceleration", 100.0, rate_hz=100.0)},
            {},
            "a multiple of the position rate",
        ),
    ],
)
def test_what_fixed_gains_need_is_named(sensors: Any, parameters: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        FusionKalman({**RATED, **sensors}, **{**PLAIN, "path": "fixed_gain", **parameters})


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"prior": "brownian"}, "prior must be wiener or matern72, got 'brownian'"),
        ({"jerk_psd_mm2_s5": 0.0}, "jerk_psd_mm2_s5 must be a number above 0, got 0.0"),
        ({"prior": "matern72", "length_scale_s": -1.0}, "length_scale_s must be a number above 0"),
        ({"adaptation": float("nan")}, "adaptation must be a number, 0 or more, got nan"),
        ({"path": "fast"}, "path must be event_time or fixed_gain, got 'fast'"),
    ],
)
def test_parameters_out_of_range_are_named(parameters: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        FusionKalman(SPACE, **parameters)


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        (lambda: Sensor("position", 0.0), "noise_sd must be a number above 0, got 0.0"),
        (lambda: Sensor("position", float("inf")), "noise_sd must be a number above 0, got inf"),
        (lambda: Sensor("position", 8.0, -0.1), "latency_s must be a number, 0 or more, got -0.1"),
        (lambda: Sensor("position", 8.0, dimension=4), "dimension must be 1, 2 or 3, got 4"),
        (lambda: Sensor("position", 8.0, rate_hz=0.0), "rate_hz must be a number above 0"),
        (lambda: Sensor("jerk", 8.0), "operator 'jerk' is not one of position, velocity, acceleration"),
        (lambda: Sensor((), 8.0), "operator needs a term whose weight is not 0"),
        (lambda: Sensor((Term(1.0, 3),), 8.0), "derivative must be 0, 1 or 2, got 3"),
        (lambda: Sensor("velocity", 8.0, dimension=2, axes=(0,)), "axes must be 2 of 0, 1 and 2"),
    ],
)
def test_sensors_out_of_range_are_named(sensor: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sensor()


def test_sensors_that_do_not_fit_together_are_named() -> None:
    with pytest.raises(ValueError, match="flow: a sensor of dimension 1 must say which axes of the 3 it sees"):
        FusionKalman({**SPACE, "flow": Sensor("velocity", 5.0, dimension=1)})
    with pytest.raises(ValueError, match="flow: only window_gp takes an operator with a term at another time"):
        FusionKalman({**SPACE, "flow": Sensor((Term(1.0), Term(-1.0, at_s=-0.03)), 1.0)})


def test_readings_of_the_wrong_shape_or_not_finite_are_named() -> None:
    estimator = FusionKalman(SPACE)
    with pytest.raises(ValueError, match=r"tracker: a reading must have shape \(3,\), .* got \(2,\)"):
        estimator.update(estimator.start(), "tracker", Sample(0.0, 0.1, np.zeros(2)))
    with pytest.raises(ValueError, match="imu: a reading must be finite"):
        estimator.update(estimator.start(), "imu", Sample(0.0, 0.1, np.array([0.0, np.nan, 0.0])))
    flat = {"tracker": Samples(np.zeros(1), np.zeros(1), np.zeros((1, 2)))}
    with pytest.raises(ValueError, match=r"tracker: readings must have shape \(n, 3\), .* got \(1, 2\)"):
        estimator.replay(flat, np.zeros(1))


def turning(seconds: float, bias_mm_s2: np.ndarray) -> tuple[dict[str, Samples], np.ndarray]:
    """A hand that is still but turns the phone, whose accelerometer is off by a constant in its own frame."""
    random = np.random.default_rng(2)
    frames, forces = np.arange(0, seconds, 1 / 30), np.arange(0, seconds, 1 / 90)
    half = 0.6 * forces
    turned = rotations(np.stack([np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)], axis=1))
    felt = turned @ bias_mm_s2 + random.normal(0, 100, (len(forces), 3))
    samples = {
        "tracker": Samples(frames, frames + 0.1, random.normal(0, 8, (len(frames), 3))),
        "imu": Samples(forces, forces, felt, turned),
    }
    return samples, forces[forces > 20]


def test_a_bias_is_constant_in_the_phones_own_frame() -> None:
    samples, times = turning(60.0, np.array([500.0, 0.0, 200.0]))
    rmse = {
        frame: float(np.sqrt(np.mean(FusionKalman(SPACE, bias_frame=frame).replay(samples, times).mean ** 2)))
        for frame in ("body", "tracker")
    }
    assert rmse["body"] < 4.5
    assert rmse["tracker"] > 1.3 * rmse["body"]


def test_accelerations_that_err_widen_the_stated_sd_until_it_is_honest() -> None:
    """An oscillating error of 2000 mm/s², twenty times the stated noise, as from a lever arm on a swinging phone."""
    random = np.random.default_rng(4)
    frames, forces = np.arange(0, 60, 1 / 30), np.arange(0, 60, 1 / 90)
    felt = random.normal(0, 100, (len(forces), 3)) + 2000 * np.sin(6 * forces)[:, None]
    samples = {
        "tracker": Samples(frames, frames + 0.1, random.normal(0, 8, (len(frames), 3))),
        "imu": Samples(forces, forces, felt),
    }
    times = forces[forces > 10]

    def covered(adaptation: float) -> float:
        track = FusionKalman(SPACE, adaptation=adaptation).replay(samples, times)
        return float(np.mean(np.abs(track.mean) <= 1.96 * track.sd))

    assert covered(0.0) < 0.6
    assert 0.90 <= covered(0.05) <= 0.99


def test_a_second_tracker_and_an_optical_flow_are_sensors_like_any() -> None:
    random = np.random.default_rng(5)
    frames = np.arange(0, 20, 1 / 30)
    path = 100 * np.sin(frames)[:, None] * np.array([1.0, 0.5, 0.0])
    speed = 100 * np.cos(frames)[:, None] * np.array([1.0, 0.5])
    samples = {
        "tracker": Samples(frames, frames + 0.1, path + random.normal(0, 8, path.shape)),
        "second": Samples(frames + 0.01, frames + 0.06, path + random.normal(0, 8, path.shape)),
        "flow": Samples(frames, frames + 0.02, speed + random.normal(0, 5, speed.shape)),
    }
    sensors = {"tracker": SPACE["tracker"]}
    more = {"second": Sensor("position", 8.0, 0.05), "flow": Sensor("velocity", 5.0, 0.02, 2, axes=(0, 1))}
    times = np.arange(5, 19.9, 0.01)
    truth = 100 * np.sin(times)[:, None] * np.array([1.0, 0.5, 0.0])
    error = {}
    for used in ((), ("second",), ("second", "flow")):
        estimator = FusionKalman({**sensors, **{name: more[name] for name in used}})
        error[used] = np.sqrt(np.mean((estimator.replay(samples, times).mean - truth)[:, :2] ** 2))
    assert error["second",] < 0.85 * error[()]
    assert error["second", "flow"] < 0.7 * error["second",]


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_nothing_depends_on_how_a_stream_is_split(seed: int) -> None:
    """Two sensors that share a stream's readings between them say the same as the one."""
    random = np.random.default_rng(seed)
    samples, times = regular(2.0)
    own = replace(SPACE["imu"], operator=(Term(1.0, 2),))  # without a bias, so that both are one sensor's
    here = random.random(len(samples["imu"])) < 0.5
    imu = samples["imu"]
    parts = {
        name: Samples(imu.time[kept], imu.arrival[kept], imu.value[kept]) for name, kept in (("a", here), ("b", ~here))
    }
    whole = FusionKalman({"tracker": SPACE["tracker"], "imu": own}).replay(samples, times)
    split = FusionKalman({"tracker": SPACE["tracker"], "a": own, "b": own})
    found = split.replay({"tracker": samples["tracker"], **parts}, times)
    np.testing.assert_allclose(found.mean, whole.mean, atol=1e-9)


def test_a_state_does_not_grow_with_what_it_has_seen() -> None:
    estimator = FusionKalman(SPACE)
    state, sizes = estimator.start(), []
    for index in range(3000):
        time = index / 90
        state = estimator.update(state, "imu", Sample(time, time, np.zeros(3)))
        if index % 3 == 0:
            state = estimator.update(state, "tracker", Sample(time - 0.1, time, np.zeros(3)))
        sizes.append(0 if state.history is None else len(state.history.time))
    assert max(sizes[300:]) == max(sizes[2000:]) < 70


def test_compilation_happens_at_the_start() -> None:
    """Then no reading of a live session waits for it."""
    steps: list[Any] = [event_steps.insert_into_copy, event_steps.predict_position, event_steps.begin]
    estimator = FusionKalman(SPACE)
    state = estimator.start()
    compiled = [len(step.signatures) for step in steps]
    state = estimator.update(state, "tracker", Sample(0.0, 0.1, np.zeros(3)))
    state = estimator.update(state, "imu", Sample(0.1, 0.1, np.zeros(3)))
    estimator.predict(state, 0.11)
    assert [len(step.signatures) for step in steps] == compiled
