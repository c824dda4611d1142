"""Orientations that no hand can have turned to, and phones that were silent and have turned meanwhile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusion_core import Estimator, FusionAdaptive, PositionKalman, Raw
from fusion_core.adaptive.layout import ROWS
from fusion_core.samples import Samples
from tests.benchmarks.departures import SENSORS, Departure, Recorded, recorded, simulated

FUSION = FusionAdaptive(SENSORS)


def _rms_mm(estimator: Estimator, whole: Recorded, begin_s: float, end_s: float) -> float:
    """The distance of what is shown from the hand."""
    within = (whole.times > begin_s) & (whole.times < end_s)
    error = estimator.replay(whole.samples, whole.times).mean[within] - whole.truth[within]
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def _turned_by(angle_deg: float, begin_s: float, end_s: float, seconds: float = 30.0) -> Recorded:
    """A phone whose logged orientation is off by an angle for a while; its forces are right."""
    source = simulated(seconds)
    wrong = (source.time > begin_s) & (source.time < end_s)
    logged = source.quaternion.copy()
    about = Rotation.from_rotvec(np.radians(angle_deg) * np.array([0.6, 0.64, 0.48]))
    logged[wrong] = (about * Rotation.from_quat(logged[wrong])).as_quat()
    return recorded(replace(source, quaternion=logged), Departure())


def _silent(whole: Recorded, name: str, begin_s: float, end_s: float) -> Recorded:
    stream = whole.samples[name]
    heard = (stream.time < begin_s) | (stream.time > end_s)
    columns = (stream.time, stream.arrival, stream.value, stream.rotation, stream.force)
    left = Samples(*(None if column is None else column[heard] for column in columns))  # type: ignore[arg-type]
    return replace(whole, samples={**whole.samples, name: left})


@pytest.mark.parametrize("angle_deg", [90.0, 170.0])
def test_an_orientation_that_is_lost_for_a_moment_is_as_good_as_none(angle_deg: float) -> None:
    """Believed, it would turn gravity into an acceleration, and in 0.3 s into a third of a metre."""
    lost = _rms_mm(FUSION, _turned_by(angle_deg, 20.0, 20.3), 20.0, 22.0)
    assert lost == pytest.approx(
        _rms_mm(FUSION, _silent(_turned_by(0.0, 0, 0), "imu", 20.0, 20.3), 20.0, 22.0), rel=0.3
    )
    assert lost < 0.5 * _rms_mm(Raw(SENSORS), _turned_by(0.0, 0, 0), 20.0, 22.0)


def test_an_orientation_that_stays_elsewhere_is_believed_in_time() -> None:
    """For all that is known the phone was put into its holder anew: then the heading is found again, as ever."""
    whole = _turned_by(60.0, 12.0, 99.0, 40.0)
    assert _rms_mm(FUSION, whole, 13.5, 40.0) < _rms_mm(Raw(SENSORS), whole, 13.5, 40.0)


@settings(max_examples=20, deadline=None)
@given(st.floats(1.0, 30.0), st.sampled_from([30.0, 90.0, 200.0]), st.integers(1, 3), st.integers(1, 3))
def test_no_turn_that_a_gyroscope_can_read_is_taken_for_a_loss(
    rad_s: float, rate_hz: float, repeated: int, dimension: int
) -> None:
    """Whatever the rate of readings and the number of axes, and where each orientation is logged up to three times."""
    repeated = repeated if rate_hz == 90.0 else 1
    time = np.arange(0, 3, 1 / rate_hz)
    known = time[np.arange(len(time)) // repeated * repeated]
    turned = Rotation.from_rotvec(np.outer(known * rad_s, [0.6, 0.64, 0.48]))
    frames = np.arange(0, 3, 1 / 30)
    positions = np.random.default_rng(0).normal(0, 8, (len(frames), dimension))
    rotation, force = turned.as_matrix()[:, :dimension], turned.inv().apply([0, 0, 9806.65])
    estimator = FusionAdaptive({name: replace(sensor, dimension=dimension) for name, sensor in SENSORS.items()})
    samples = {
        "tracker": Samples(frames, frames + 0.1, positions),
        "imu": Samples(time, time, np.zeros((len(time), dimension)), rotation, force),
    }
    _, state = estimator.resume(estimator.start(), samples, np.empty(0))
    kept = state.phone.time[: state.state["count"][0, ROWS]]
    np.testing.assert_array_equal(kept, time[-len(kept) :])


@pytest.mark.parametrize("dimension", [1, 2])
def test_of_one_or_two_axes_an_orientation_is_lost_as_well(dimension: int) -> None:
    """And one that is not lost is believed: readings are left out for the time of the loss alone."""
    time = np.arange(0, 3, 1 / 90)
    lost = (time > 1.0) & (time < 1.3)
    turned = Rotation.from_rotvec(np.outer(np.sin(2 * time) + 2.0 * lost, [0.0, 0.0, 1.0]))
    frames = np.arange(0, 3, 1 / 30)
    estimator = FusionAdaptive(
        {name: replace(sensor, dimension=dimension) for name, sensor in SENSORS.items()}, history_s=2.0
    )
    rotation, force = turned.as_matrix()[:, :dimension], turned.inv().apply([0, 0, 9806.65])
    samples = {
        "tracker": Samples(frames, frames + 0.1, np.zeros((len(frames), dimension))),
        "imu": Samples(time, time, np.zeros((len(time), dimension)), rotation, force),
    }
    _, state = estimator.resume(estimator.start(), samples, np.empty(0))
    kept = state.phone.time[: state.state["count"][0, ROWS]]
    np.testing.assert_array_equal(kept, time[~lost][-len(kept) :])
    assert kept[0] < 1.0


def test_a_phone_that_turned_while_it_was_silent_is_beside_the_hand_at_once() -> None:
    """With its lever arm turned as it was before, it would be shown as far off as the phone is from the hand."""
    whole = _silent(recorded(simulated(30.0, swing=3.0), Departure()), "imu", 20.0, 23.0)
    assert _rms_mm(FUSION, whole, 23.0, 23.2) < _rms_mm(PositionKalman(SENSORS), whole, 23.0, 23.2)


def test_after_a_silence_of_both_the_interval_holds_the_hand() -> None:
    """The phone speaks again before the tracker does: nobody knows what the speed did in between."""
    whole, holds = recorded(simulated(30.0), Departure()), []
    for begin_s in np.arange(8.0, 27.0, 2.3):
        silent = _silent(_silent(whole, "tracker", begin_s, begin_s + 1.1), "imu", begin_s + 0.6, begin_s + 1.0)
        within = (whole.times > begin_s + 1.0) & (whole.times < begin_s + 1.2)
        track = FUSION.replay(silent.samples, whole.times)
        holds.append(np.mean(np.abs(track.mean - whole.truth)[within] <= 1.96 * track.sd[within]))
    assert np.mean(holds) > 0.9


@pytest.mark.parametrize("off_s", [-0.004, -0.008])
def test_of_some_milliseconds_each_clock_has_its_share(off_s: float) -> None:
    """Whichever is wrong, the estimate is between those that trust the right clock and the wrong one."""
    phone = recorded(simulated(40.0), Departure(clock_s=off_s))
    tracker = recorded(simulated(40.0), Departure(latency_s=0.1 + off_s))
    for whole, right, wrong in ((phone, "tracker", "imu"), (tracker, "imu", "tracker")):
        shown, best, worst = (
            _rms_mm(FusionAdaptive(SENSORS, trusted_clock=trusted), whole, 15.0, 40.0)
            for trusted in (None, right, wrong)
        )
        assert shown < worst
        assert shown < 1.1 * best
