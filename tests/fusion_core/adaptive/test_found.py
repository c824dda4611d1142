"""What the adaptive filter says of its sensors, beside what the simulated ones are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from fusion_core import FusionAdaptive, Samples, Sensor
from fusion_core.adaptive.found import Found
from tests.benchmarks.departures import DEPARTURES, SENSORS, Departure, recorded, simulated

FUSION = FusionAdaptive(SENSORS)
OWN_MOUNTING = Rotation.from_rotvec([0.015, -0.01, 0.012])  # of the simulated phone, whatever else departs


def of(departure: Departure, seed: int = 0) -> dict[str, Found]:
    samples = recorded(simulated(60.0, seed), departure, seed + 10).samples
    return {one.quantity: one for one in FUSION.found(samples)}


@pytest.mark.parametrize("noise_sd_mm", [3.0, 8.0, 20.0])
def test_the_trackers_noise_is_found(noise_sd_mm: float) -> None:
    noise = of(Departure(noise_sd_mm=noise_sd_mm))["tracker_noise"]
    assert noise.ci_low < noise_sd_mm < noise.ci_high
    assert noise.value == pytest.approx(noise_sd_mm, rel=0.1)


@pytest.mark.parametrize(("name", "late_s"), [("as stated", 0.0), ("latency 80 ms", -0.02), ("latency 130 ms", 0.03)])
def test_the_trackers_delay_is_found(name: str, late_s: float) -> None:
    late = of(DEPARTURES[name])["tracker_late"]
    assert late.ci_low < late_s < late.ci_high
    assert late.ci_high - late.ci_low < 0.015


@pytest.mark.parametrize("degrees", [0.0, 5.0])
def test_mounting_and_lever_arm_are_found(degrees: float) -> None:
    figures = of(Departure(mounting_deg=degrees))
    turned = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, -0.64, 0.48])) * OWN_MOUNTING
    for axis, wanted in zip("xyz", np.degrees(turned.as_rotvec()), strict=True):
        assert figures[f"mounting_{axis}"].value == pytest.approx(wanted, abs=0.3)
    for axis, arm_mm in zip("xyz", (30.0, 40.0, -10.0), strict=True):
        assert figures[f"lever_arm_{axis}"].value == pytest.approx(arm_mm, abs=6.0)


def test_heading_and_scale_are_found() -> None:
    assert of(DEPARTURES["yaw 15°"])["heading"].value == pytest.approx(15.0, abs=1.5)
    scaled = of(DEPARTURES["accelerometer scale 3 %"])["scale"]
    assert scaled.ci_low < 3.0 < scaled.ci_high


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Of the clock and of the lever arm, in five recordings: as few of 20 intervals once in a thousand times."""
    held = []
    for seed in range(5):
        figures = of(Departure(), seed)
        truth = {"tracker_late": 0.0, "lever_arm_x": 30.0, "lever_arm_y": 40.0, "lever_arm_z": -10.0}
        held += [figures[name].ci_low <= value <= figures[name].ci_high for name, value in truth.items()]
    assert stats.binom.cdf(sum(held), len(held), 0.95) > 0.001


def test_nothing_is_said_before_the_first_position_nor_of_a_phone_that_knows_no_orientation() -> None:
    samples = recorded(simulated(5.0), Departure()).samples
    none = Samples(np.empty(0), np.empty(0), np.empty((0, 3)))
    assert FUSION.found({**samples, "tracker": none}) == []
    blind = replace(samples["imu"], rotation=None, force=None)
    assert [one.quantity for one in FUSION.found({**samples, "imu": blind})] == ["tracker_noise", "tracker_late"]


def test_of_two_axes_there_is_no_heading() -> None:
    sensors = {"tracker": Sensor("position", 8.0, 0.1, 2), "imu": Sensor("acceleration", 100.0, 0.0, 2)}
    flat = {
        name: replace(
            one, value=one.value[:, :2].copy(), rotation=None if one.rotation is None else one.rotation[:, :2].copy()
        )
        for name, one in recorded(simulated(10.0), Departure()).samples.items()
    }
    quantities = {one.quantity for one in FusionAdaptive(sensors).found(flat)}
    assert "lever_arm_x" in quantities
    assert "heading" not in quantities
