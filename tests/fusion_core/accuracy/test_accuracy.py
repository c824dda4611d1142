"""Accuracy by its formulas, on signals whose answer is known."""

from __future__ import annotations

import statistics

import numpy as np
import pytest

from fusion_core import Samples, accuracy
from fusion_core.accuracy import noise
from fusion_core.phone.calibration import Body
from fusion_core.phone.orientation import rotate, rotations
from pipeline.statistics.arrays import FloatArray


def moving(time: FloatArray) -> FloatArray:
    return np.column_stack([100 * np.sin(3 * time) + 20 * np.sin(11 * time), 50 * np.cos(4 * time)])


def of(time: FloatArray, value: FloatArray) -> Samples:
    return Samples(time, time, value)


def test_rmse_and_stated_sd_are_euclidean() -> None:
    assert accuracy.rmse(np.array([[3.0, 4.0], [0.0, 0.0]]), np.zeros((2, 2))) == pytest.approx(np.sqrt(12.5))
    assert accuracy.stated_sd(np.full((4, 3), 2.0)) == pytest.approx(2 * np.sqrt(3))
    assert accuracy.stated_sd(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(np.sqrt(12.5))


def test_coverage_counts_instants_and_axes() -> None:
    estimate = np.array([[0.0, 0.0], [1.9, 2.0]])
    assert accuracy.coverage_95(estimate, np.ones((2, 2)), np.zeros((2, 2))) == pytest.approx(0.75)


def test_a_gaussian_error_is_covered_95_percent_of_the_time() -> None:
    error = np.random.default_rng(0).normal(0, 3.0, (20_000, 3))
    assert accuracy.coverage_95(error, np.full_like(error, 3.0), np.zeros_like(error)) == pytest.approx(0.95, abs=0.005)


@pytest.mark.parametrize("late_s", [0.1234, 0.0, -0.057])
def test_lag_is_found_to_a_fraction_of_a_sample(late_s: float) -> None:
    fine = np.arange(-1, 21, 1 / 200)
    time = np.arange(0, 20, 1 / 90)
    estimate = moving(time - late_s) + np.random.default_rng(1).normal(0, 2, (len(time), 2))
    found = accuracy.lag(time, estimate, of(fine, moving(fine)), np.random.default_rng(2))
    assert found.value == pytest.approx(late_s, abs=0.001)
    assert found.low <= late_s <= found.high
    assert found.high - found.low < 0.005


def test_lag_of_a_hand_that_never_moves_is_not_claimed() -> None:
    time = np.arange(0, 10, 1 / 90)
    still = np.zeros((len(time), 2))
    for track in (still, still + np.random.default_rng(1).normal(0, 3, still.shape)):
        found = accuracy.lag(time, track, of(time, still), np.random.default_rng(0))
        assert np.isnan(found.value)


def plain_lag(time: FloatArray, estimate: FloatArray, reference: Samples, random: np.random.Generator) -> FloatArray:
    """The lag and its interval by the definition: every cost of every resample."""
    shifts = np.linspace(-0.5, 0.5, 201)
    costs, kept = [], []
    for now, shown in zip(time, estimate, strict=True):
        truth = accuracy.interpolate(reference, now - shifts)
        if np.isfinite(truth).all():
            costs.append(np.sum((shown - truth) ** 2, axis=1))
            kept.append(now)
    block = round(0.5 / float(np.median(np.diff(kept))))
    blocks = np.array([np.sum(costs[first : first + block], axis=0) for first in range(len(costs) - block + 1)])
    picks = random.integers(len(blocks), size=(1000, len(costs) // block))
    lows = []
    for cost in (np.sum(costs, axis=0), *(blocks[row].sum(axis=0) for row in picks)):
        at = int(np.argmin(cost))
        if 0 < at < 200:
            before, here, after = cost[at - 1 : at + 2]
            lows.append(shifts[at] + 0.005 * (before - after) / (2 * (before - 2 * here + after)))
        else:
            lows.append(shifts[at])
    return np.array([lows[0], *np.percentile(lows[1:], [2.5, 97.5])])


@pytest.mark.parametrize("late_s", [0.0, 0.0475, -0.31, 0.49])
@pytest.mark.parametrize("speed", [1.0, 0.02])
def test_lag_is_what_all_costs_give(late_s: float, speed: float) -> None:
    """Fast and slow hands: of these many shifts fit nearly as well as the best, also beyond the range."""
    random = np.random.default_rng(8)
    known = np.cumsum(random.uniform(0.004, 0.02, 700)) - 1.0
    known[300:] += 0.2  # a gap
    time = np.arange(0, 6, 1 / 60) + random.uniform(0, 0.002, 360)
    estimate = moving(speed * (time - late_s)) + random.normal(0, 3, (360, 2))
    reference = of(known, moving(speed * known))
    found = accuracy.lag(time, estimate, reference, np.random.default_rng(9))
    expected = plain_lag(time, estimate, reference, np.random.default_rng(9))
    if not -0.5 < expected[0] < 0.5:
        assert np.isnan(found.value)
    else:
        np.testing.assert_allclose([found.value, found.low, found.high], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_lag_is_what_all_costs_give_where_a_hand_goes_to_and_fro(seed: int) -> None:
    """Four times a second, so that shifts a quarter of a second apart fit about as well in a noisy track."""
    random = np.random.default_rng(seed)
    known, time = np.arange(-1, 7, 1 / 100), np.arange(0, 6, 1 / 60)

    def to_and_fro(at: FloatArray) -> FloatArray:
        return np.column_stack([100 * np.sin(8 * np.pi * at) + 20 * np.sin(3 * at)])

    estimate = to_and_fro(time - 0.05) + random.normal(0, 60, (360, 1))
    reference = of(known, to_and_fro(known))
    found = accuracy.lag(time, estimate, reference, np.random.default_rng(9))
    expected = plain_lag(time, estimate, reference, np.random.default_rng(9))
    np.testing.assert_allclose([found.value, found.low, found.high], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("ahead_s", [0.11, -0.05])
def test_lead_by_cross_correlation_is_positive_ahead_of_the_tracker(ahead_s: float) -> None:
    """The tracker is held between frames, so it is half a frame later than its newest one on average."""
    time = np.arange(0, 40, 1 / 90)
    frames = np.arange(0, 40, 1 / 30)
    tracker = Samples(frames - 0.1, frames, moving(frames - 0.1))
    estimate = moving(time - 0.1 + ahead_s)
    lead = accuracy.lead_by_cross_correlation(time, estimate, tracker)
    assert lead == pytest.approx(ahead_s + 1 / 60, abs=0.012)


def test_the_tracker_held_leads_itself_by_nothing() -> None:
    time, frames = np.arange(0, 40, 1 / 90), np.arange(0, 40, 1 / 30)
    tracker = Samples(frames - 0.1, frames, moving(frames - 0.1))
    held = tracker.value[np.searchsorted(frames, time + 1e-9, side="right") - 1]
    assert accuracy.lead_by_cross_correlation(time, held, tracker) == 0.0


def test_unbiased_cross_correlation_by_its_definition() -> None:
    random = np.random.default_rng(3)
    a, b = random.normal(size=(30, 2)), random.normal(size=(30, 2))
    shifts, found = accuracy.cross_correlation(a, b)
    ca, cb = a - a.mean(axis=0), b - b.mean(axis=0)
    for shift, value in zip(shifts, found, strict=True):
        pairs = [(t, t + shift) for t in range(30) if 0 <= t + shift < 30]
        assert value == pytest.approx(np.mean([ca[t] @ cb[u] for t, u in pairs]), abs=1e-12)


def test_the_reference_is_not_interpolated_over_gaps_or_beyond_its_ends() -> None:
    reference = of(np.array([0.0, 0.04, 0.14, 0.18]), np.array([[0.0], [4.0], [14.0], [18.0]]))
    found = accuracy.interpolate(reference, np.array([-0.01, 0.02, 0.04, 0.09, 0.14, 0.16, 0.2]))[:, 0]
    np.testing.assert_allclose(found, [np.nan, 2, 4, np.nan, 14, 16, np.nan])


def test_jitter_is_the_sd_while_the_hand_is_slow() -> None:
    time = np.arange(0, 10, 1 / 100)
    slow = np.where(time < 5, 0.0, (time - 5) * 100)[:, None]
    track = slow + np.random.default_rng(4).normal(0, 3, (len(time), 1))
    assert accuracy.jitter(time, track, of(time, slow)) == pytest.approx(3.0, rel=0.1)
    fast = (time * 100)[:, None]
    assert np.isnan(accuracy.jitter(time, fast, of(time, fast)))


def test_jitter_pools_the_variances_of_stretches_by_what_is_free_in_each() -> None:
    """Of a track at 5 Hz five and three readings lie in two pauses: √(Σ(n − 1)s² / Σ(n − 1))."""
    time = np.arange(0, 6, 1 / 100)
    moving = np.where((time > 1) & (time < 2.1), 0.0, np.where((time > 4) & (time < 4.7), 0.0, 300.0))
    reference = of(time, np.cumsum(moving / 100)[:, None])
    track_s = np.arange(0.1, 6, 0.2)
    track = np.random.default_rng(4).normal(0, 3, (len(track_s), 2))
    pauses = [track[(track_s > begin) & (track_s < end)] for begin, end in ((1.0, 2.1), (4.0, 4.7))]
    assert [len(pause) for pause in pauses] == [5, 3]
    variances = [statistics.variance(pause[:, 0]) + statistics.variance(pause[:, 1]) for pause in pauses]
    expected = np.sqrt((4 * variances[0] + 2 * variances[1]) / 6)
    assert accuracy.jitter(track_s, track, reference) == pytest.approx(expected)


def test_noise_is_found_in_a_still_stretch_and_drift_is_not_noise() -> None:
    time = np.arange(0, 10, 1 / 100)
    drift = 3 * (time - 5) ** 2
    value = (drift + np.random.default_rng(5).normal(0, 2.5, len(time)))[:, None]
    left = noise.residuals(of(time, value), 0, 10)
    assert np.sqrt(np.mean(left**2)) == pytest.approx(2.5, rel=0.06)


@pytest.mark.parametrize("seed", range(3))
def test_residuals_have_the_mean_square_of_a_regression_on_a_parabola(seed: int) -> None:
    """Of n readings and three coefficients n − 3 are free; with a dozen of them it shows. Statsmodels' mse_resid."""
    from statsmodels.regression.linear_model import OLS

    random = np.random.default_rng(seed)
    time = np.sort(random.uniform(4.0, 6.0, 12))
    value = random.normal(0, 2.5, (12, 2)) + 30 * time[:, None] - 4 * time[:, None] ** 2
    before, after = [3.0, 4 - 1e-9], [6 + 1e-9, 7.0]  # the stretch's first and last 0.1 s, and beyond
    others = np.full((2, 2), 500.0)
    samples = of(np.concatenate([before, time, after]), np.concatenate([others, value, others]))
    left = noise.residuals(samples, 3.9, 6.1)
    design = np.column_stack([np.ones(12), time, time**2])
    expected = [OLS(value[:, axis], design).fit().mse_resid for axis in range(2)]
    np.testing.assert_allclose(np.mean(left**2, axis=0), expected, rtol=1e-9)


def test_too_few_readings_say_nothing_of_the_noise() -> None:
    time = np.linspace(0.1, 0.9, 9)
    assert noise.residuals(of(time, np.ones((9, 2))), 0.0, 1.0).shape == (0, 2)
    time = np.linspace(0.1, 0.9, 10)
    assert len(noise.residuals(of(time, np.ones((10, 2))), 0.0, 1.0)) == 10


def test_still_stretch_by_accelerations_alone() -> None:
    time = np.arange(0, 30, 1 / 90)
    shaking = np.where((time > 8) & (time < 14), 0.0, 1500.0)
    value = (np.random.default_rng(6).normal(0, 50, len(time)) + shaking * np.sin(9 * time))[:, None]
    found = noise.still_by_acceleration(of(time, value))
    assert found is not None
    assert 7.8 < found[0] < found[1] < 14.3


def test_gravity_at_rest_leaves_no_acceleration_whatever_the_orientation() -> None:
    """a = R f + g: at rest the specific force points up."""
    random = np.random.default_rng(7)
    turn = random.normal(size=(50, 4))
    gravity = np.array([0.0, -9806.65, 0.0])
    back = turn * np.array([-1, -1, -1, 1])
    force = rotate(back, np.tile(-gravity, (50, 1)))
    time = np.arange(len(force), dtype=np.float64)
    at_rest = Body(time, time, force, rotations(turn), gravity).acceleration().value
    np.testing.assert_allclose(at_rest, 0, atol=1e-8)


def test_a_quarter_turn_about_z() -> None:
    quarter = np.array([0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)])
    np.testing.assert_allclose(rotate(quarter, np.array([[1.0, 0, 0]])), [[0, 1, 0]], atol=1e-12)


def test_a_quaternion_of_length_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="length above 0"):
        rotate(np.zeros(4), np.ones((2, 3)))


@pytest.mark.parametrize(
    ("time", "value", "message"),
    [
        ([0.0, 1.0], [[1.0]], r"got \(2,\), \(2,\) and \(1, 1\)"),
        ([0.0, np.nan], [[1.0], [2.0]], "must be finite"),
        ([1.0, 0.0], [[1.0], [2.0]], "in order of arrival"),
    ],
)
def test_samples_that_cannot_be_are_refused(time: list[float], value: list[list[float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Samples(np.array(time), np.array(time), np.array(value))


def test_a_long_recording_has_fewer_blocks_to_draw_from_and_the_same_lag(monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.arange(0, 60, 1 / 90)
    track = moving(time - 0.07) + np.random.default_rng(3).normal(0, 5, (len(time), 2))
    whole = accuracy.lag(time, track, of(time, moving(time)), np.random.default_rng(1))
    monkeypatch.setattr(accuracy, "BLOCKS_MAX", 500)
    fewer = accuracy.lag(time, track, of(time, moving(time)), np.random.default_rng(1))
    assert fewer.value == whole.value
    # The SD of a 2.5 percentile of 1000 draws is √(.025·.975/1000)/φ(1.96) = 0.085 of theirs, a 46th of the interval.
    ends = 4 * np.sqrt(2) * (whole.high - whole.low) / 46
    assert abs(fewer.low - whole.low) < ends
    assert abs(fewer.high - whole.high) < ends
