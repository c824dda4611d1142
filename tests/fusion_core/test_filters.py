"""Filters without a model of motion, on signals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import Holt, OneEuro, Raw, Samples, Sensor

SENSORS = {"tracker": Sensor("position", 8.0, 0.1, 1)}
FRAMES = np.arange(0, 10, 1 / 30)


def seen(value: np.ndarray) -> dict[str, Samples]:
    return {"tracker": Samples(FRAMES, FRAMES + 0.1, value[:, None])}


def test_raw_holds_the_newest_frame() -> None:
    track = Raw(SENSORS).replay(seen(FRAMES), np.array([0.05, 0.1, 0.12, 0.14]))
    np.testing.assert_allclose(track.mean[1:, 0], [0, 0, 1 / 30])
    assert np.isnan(track.mean[0, 0])


def test_one_euro_steps_towards_a_new_place_as_its_cut_off_says() -> None:
    """At rest the filter is a first-order low-pass: after a step each frame leaves 1 − α of the way."""
    still = np.where(FRAMES < 5, 0.0, 1.0)
    track = OneEuro(SENSORS, min_cutoff_hz=2.0, beta_per_mm=0.0).replay(seen(still), FRAMES[160:165] + 0.1)
    share = 1 / (1 + 1 / (2 * np.pi * 2.0 / 30))
    left = 1 - track.mean[:, 0]
    np.testing.assert_allclose(left[1:] / left[:-1], 1 - share, rtol=1e-9)


def test_one_euro_is_steadier_at_rest_and_less_late_in_motion_than_one_cut_off_is() -> None:
    noise = np.random.default_rng(0).normal(0, 8, len(FRAMES))
    adaptive, slow = OneEuro(SENSORS, beta_per_mm=0.02), OneEuro(SENSORS, beta_per_mm=0.0)
    late = FRAMES[60:] + 0.1
    assert np.std(adaptive.replay(seen(noise), late).mean) < 0.6 * 8
    ramp = 500 * FRAMES
    assert np.all(adaptive.replay(seen(ramp), late).mean > slow.replay(seen(ramp), late).mean + 10)


def test_holt_follows_a_ramp_without_lag_once_settled() -> None:
    late = FRAMES[200:] + 0.1
    track = Holt(SENSORS, ahead_s=0.1).replay(seen(300 * FRAMES), late)
    np.testing.assert_allclose(track.mean[:, 0], 300 * late, atol=0.01)
    held = Holt(SENSORS, ahead_s=0.0).replay(seen(300 * FRAMES), late)
    np.testing.assert_allclose(held.mean[:, 0], 300 * (late - 0.1), atol=0.01)


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        (OneEuro, {"min_cutoff_hz": 0.0}, "min_cutoff_hz must be a number above 0"),
        (OneEuro, {"beta_per_mm": -1.0}, "beta_per_mm must be a number, 0 or more"),
        (Holt, {"level_weight": 1.5}, "level_weight must be above 0 and at most 1, got 1.5"),
        (Holt, {"ahead_s": float("inf")}, "ahead_s must be a number, 0 or more"),
    ],
)
def test_parameters_out_of_range_are_named(kind: type, parameters: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        kind(SENSORS, **parameters)
