"""The hand's path and its parts: lengths, overshoot and corrections of movements that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.sessions import movements
from pipeline.sessions.movements import Path as HandPath
from pipeline.statistics.arrays import FloatArray


def minimum_jerk(time: FloatArray, begin_s: float, duration_s: float, length_mm: float) -> FloatArray:
    share = np.clip((time - begin_s) / duration_s, 0, 1)
    found: FloatArray = length_mm * (10 * share**3 - 15 * share**4 + 6 * share**5)
    return found


def test_the_filter_halves_the_power_at_5_hz_and_shifts_nothing() -> None:
    time = np.arange(0, 6, 1 / 90)
    for hertz, gain in ((0.5, 1.0), (5.0, np.sqrt(0.5)), (20.0, 0.0)):
        wave = np.column_stack([np.sin(2 * np.pi * hertz * time), np.zeros_like(time)])
        (path,) = movements.smoothed(time, wave)
        middle = (path.time_s > 2) & (path.time_s < 4)
        exact = np.sin(2 * np.pi * hertz * path.time_s[middle])
        assert path.position_mm[middle, 0] == pytest.approx(gain * exact, abs=0.02)


def test_a_detour_of_known_length() -> None:
    assert movements.length_mm(np.array([[0.0, 0], [30, 40], [60, 0]])) == pytest.approx(100)
    time = np.arange(0, 6, 1 / 90)
    angle = np.pi * (time - 2) / 2  # a half circle between 2 s and 4 s
    paths = movements.smoothed(time, 100 * np.column_stack([np.cos(angle), np.sin(angle)]))
    half = movements.between(paths, 2.0, 4.0)
    assert half is not None
    assert movements.length_mm(half.position_mm) == pytest.approx(100 * np.pi, rel=1e-4)
    assert movements.length_mm(half.position_mm[[0, -1]]) == pytest.approx(200, rel=1e-4)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10))
def test_a_path_is_as_long_wherever_it_lies_and_grows_with_its_scale(seed: int, scale: float) -> None:
    random = np.random.default_rng(seed)
    time = np.sort(random.uniform(0, 3, 150))
    places = np.cumsum(random.normal(size=(150, 3)), axis=0)
    turn, shift = np.linalg.qr(random.normal(size=(3, 3)))[0], random.normal(0, 100, 3)
    here = movements.between(movements.smoothed(time, places), time[20], time[120])
    there = movements.between(movements.smoothed(time, scale * (places @ turn.T + shift)), time[20], time[120])
    if here is None or there is None:  # a gap
        assert here is there
        return
    assert movements.length_mm(there.position_mm) == pytest.approx(scale * movements.length_mm(here.position_mm))
    way = random.normal(size=(4, 3))
    assert movements.overshoot_mm(there.position_mm, scale * (way @ turn.T + shift)) == pytest.approx(
        scale * movements.overshoot_mm(here.position_mm, way), abs=1e-9 * scale * 1000
    )
    one = movements.between(movements.smoothed(time, places @ turn.T + shift), time[20], time[120])
    assert one is not None
    assert movements.corrections(one) == movements.corrections(here)


def test_a_path_has_no_gap() -> None:
    time = np.concatenate([np.arange(0, 1, 0.02), np.arange(1.5, 3, 0.02)])
    paths = movements.smoothed(time, np.column_stack([time]))
    assert len(paths) == 2
    assert movements.between(paths, 0.2, 0.8) is not None
    assert movements.between(paths, 0.2, 1.1) is not None  # the last 0.12 s are missing, as a late tracker's are
    assert movements.between(paths, 0.2, 1.3) is None
    assert movements.between(paths, 0.5, 2.0) is None
    assert movements.between(paths, -0.5, 0.5) is None
    assert movements.between(paths, 0.5, np.nan) is None
    assert movements.between([], 0.0, 1.0) is None
    assert movements.smoothed(np.array([1.0]), np.array([[2.0]])) == []
    assert movements.smoothed(np.empty(0), np.empty((0, 2))) == []


def test_a_path_of_any_rate_costs_what_its_readings_cost() -> None:
    time = np.array([0.0, 1e-12, 0.1, 0.25, 1e6, 1e6 + 0.1, 1e9])
    paths = movements.smoothed(time, 1e100 * np.ones((7, 2)))
    assert [len(path.time_s) for path in paths] == [26, 11]
    assert all(np.isfinite(path.position_mm).all() for path in paths)


def test_overshoot_of_a_known_size() -> None:
    hand = np.array([[0.0, 0], [60, 5], [112, 3], [95, 0], [100, 0]])
    assert movements.overshoot_mm(hand, np.array([[0.0, 0], [100, 0]])) == pytest.approx(12)
    assert movements.overshoot_mm(hand[:2], np.array([[0.0, 0], [100, 0]])) == 0
    assert np.isnan(movements.overshoot_mm(hand, np.array([[100.0, 0], [100, 0]])))


def test_overshoot_around_corners_is_that_of_the_last_leg() -> None:
    line = np.array([[0.0, 0], [0, 200], [100, 200], [100, 0]])
    way = movements.route(line, np.array([0.0, 50]), np.array([100.0, 120]))
    assert way.tolist() == [[0, 50], [0, 200], [100, 200], [100, 120]]
    assert movements.length_mm(way) == pytest.approx(150 + 100 + 80)
    # At its begin the hand is further down than the target, which is no overshoot; then it goes 7 mm too far down.
    hand = np.array([[0.0, 50], [0, 200], [100, 205], [100, 113], [100, 120]])
    assert movements.overshoot_mm(hand, way) == pytest.approx(7)
    assert movements.route(line, np.array([100.0, 120]), np.array([0.0, 50])).tolist() == way[::-1].tolist()


@pytest.mark.parametrize(
    ("second_mm", "expected"),
    [(0.0, 0), (40.0, 1), (4.0, 0)],  # 4 mm in 0.4 s is slower than a tenth of the first bump's peak
)
def test_a_second_bump_in_the_speed_is_a_correction(second_mm: float, expected: int) -> None:
    time = np.arange(0, 3, 1 / 90)
    x = minimum_jerk(time, 0.5, 0.6, 200) + minimum_jerk(time, 1.3, 0.4, second_mm)
    path = movements.between(movements.smoothed(time, np.column_stack([x, 0 * x])), 0.4, 2.0)
    assert path is not None
    assert movements.corrections(path) == expected


@pytest.mark.parametrize(("second_mm_s", "expected"), [(150, 0), (195, 0), (205, 1), (300, 1)])
def test_a_second_submovement_counts_if_it_stands_out_by_a_tenth_of_the_peak_speed(
    second_mm_s: float, expected: int
) -> None:
    """The speed rises to 1000 mm/s and falls to 100: the second rise must reach 200."""
    speed = np.interp(np.arange(0, 1, 0.01), [0, 0.3, 0.6, 0.8, 1], [0, 1000, 100, second_mm_s, 0])
    time = np.arange(len(speed) + 1) * 0.01
    x_mm = np.concatenate([[0.0], np.cumsum(speed * 0.01)])
    path = HandPath(time.astype(np.float64), np.column_stack([x_mm, np.zeros(len(time))]))
    assert movements.corrections(path) == expected


def test_a_hand_that_rests_corrects_nothing() -> None:
    assert movements.corrections(HandPath(np.arange(3.0), np.zeros((3, 2)))) == 0
    assert movements.corrections(HandPath(np.arange(2.0), np.zeros((2, 2)))) == 0
