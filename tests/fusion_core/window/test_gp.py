"""The paper's estimator against its printed figures and against independent, slower mathematics."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import eval_hermite

from fusion_core import Samples, Sensor, Term, WindowGP
from fusion_core.estimator import replay_loop

TRACKER = Sensor("position", 8.0, 0.1, 1)
IMU = Sensor("acceleration", 100.0, 0.0, 1)
BOTH = {"tracker": TRACKER, "imu": IMU}


def paper_window(fused: bool, length: int = 5) -> tuple[np.ndarray, list[str]]:
    """Lags and sensors of the paper's window at a frame's delivery: 30 and 90 Hz, 0.1 s late, l_a = 3L + 7."""
    lag = -0.1 - np.arange(length)[::-1] / 30
    if not fused:
        return lag, ["tracker"] * length
    count = 3 * length + 9 - 2
    return np.concatenate([lag, -np.arange(count)[::-1] / 90]), ["tracker"] * length + ["imu"] * count


@pytest.mark.parametrize(
    ("fused", "mean", "sd_mm"),
    [(False, "zero", 29.85), (True, "zero", 12.88), (False, "constant", 33.29), (True, "constant", 12.88)],
)
def test_sd_at_now_with_the_papers_parameters(fused: bool, mean: str, sd_mm: float) -> None:
    """Table 1 prints 29.89 and 12.04 mm; exact second derivatives give 29.85 and 12.88."""
    _, variance = WindowGP(BOTH, mean=mean).gains(*paper_window(fused))  # type: ignore[arg-type]
    assert round(float(np.sqrt(variance)), 2) == sd_mm


@pytest.mark.parametrize("fused", [False, True])
def test_position_gains_sum_to_one_with_a_constant_mean(fused: bool) -> None:
    lag, names = paper_window(fused)
    weights, _ = WindowGP(BOTH).gains(lag, names)
    assert weights[:5].sum() == pytest.approx(1.0, abs=1e-9)


def test_exact_derivatives_agree_with_the_wide_grid() -> None:
    """K_a as the paper's second difference, on a latent grid one sample wider on each side (eqs. 17 to 24)."""
    length, step = 5, 1 / 90
    count = 3 * length + 7
    latent = np.arange(-count, 2) * step  # the newest acceleration, at 0, has a neighbour on each side
    difference = latent[:, None] - latent[None, :]
    prior = 5.66e4 * np.exp(-4.19 * difference**2)
    operator = np.zeros((length + count, len(latent)))
    for row in range(length):
        operator[row, count - 9 - 3 * (length - 1 - row)] = 1
    for row in range(count):
        operator[length + row, row : row + 3] = np.array([1, -2, 1]) / step**2
    noise = np.diag([64.0] * length + [1e4] * count)
    observed = operator @ prior @ operator.T + noise
    with_now = operator @ prior[:, count]
    sd = np.sqrt(5.66e4 - with_now @ np.linalg.solve(observed, with_now))
    _, variance = WindowGP(BOTH, mean="zero").gains(*paper_window(fused=True, length=length))
    assert float(np.sqrt(variance)) == pytest.approx(float(sd), abs=0.2)
    _, on_grid = WindowGP(BOTH, mean="zero", derivative="finite_difference").gains(*paper_window(True, length))
    assert float(np.sqrt(on_grid)) == pytest.approx(float(sd), rel=1e-6)


def test_a_slow_posterior_written_out_gives_the_same_estimate() -> None:
    """One window of irregular times by the textbook formulas of kriging with an unknown constant mean."""
    random = np.random.default_rng(3)
    frames, now, v, w = np.sort(random.uniform(0, 0.3, 4)), 0.43, 5.66e4, 4.19
    forces = np.sort(random.uniform(frames[0], 0.42, 20))
    positions, accelerations = random.normal(1000, 30, (4, 1)), random.normal(0, 500, (20, 1))

    def covariance(i: int, j: int, d: float) -> float:
        """cov(f⁽ⁱ⁾(t), f⁽ʲ⁾(t')) by Hermite polynomials, a second opinion on the closed forms."""
        n = i + j
        derivative = v * w ** (n / 2) * (-1) ** n * eval_hermite(n, np.sqrt(w) * d) * np.exp(-w * d**2)
        return float((-1) ** j * derivative)

    readings = [(t, 0) for t in frames] + [(t, 2) for t in forces]
    among = np.array([[covariance(i, j, t - u) for u, j in readings] for t, i in readings])
    among += np.diag([64.0] * 4 + [1e4] * 20)
    with_now = np.array([covariance(i, 0, t - now) for t, i in readings])
    ones = np.array([1.0] * 4 + [0.0] * 20)
    values = np.concatenate([positions[:, 0], accelerations[:, 0]])
    inverse = np.linalg.inv(among)
    constant = ones @ inverse @ values / (ones @ inverse @ ones)
    expected = constant + with_now @ inverse @ (values - constant * ones)
    samples = {
        "tracker": Samples(frames, np.full(4, 0.425), positions),
        "imu": Samples(forces, forces, accelerations),
    }
    track = WindowGP(BOTH, window=4).replay(samples, np.array([now]))
    assert track.mean[0, 0] == pytest.approx(expected, abs=1e-6)


def test_start_up_uses_what_there_is() -> None:
    """With fewer than L positions the estimate is that of a window as long as there are (Algorithm 1)."""
    frames = Samples(np.arange(3) / 30, np.arange(3) / 30 + 0.1, np.array([[0.0], [5.0], [9.0]]))
    forces = Samples(np.arange(20) / 90, np.arange(20) / 90, np.zeros((20, 1)))
    samples, now = {"tracker": frames, "imu": forces}, np.array([0.17])
    long, short = WindowGP(BOTH, window=5).replay(samples, now), WindowGP(BOTH, window=3).replay(samples, now)
    assert long.mean[0, 0] == pytest.approx(short.mean[0, 0], abs=1e-9)


def test_a_far_away_constant_costs_nothing_with_the_constant_mean() -> None:
    """Zero mean pulls a hand at 1000 mm towards zero; the constant mean does not (method, trap 3)."""
    at = Samples(np.arange(30) / 30, np.arange(30) / 30 + 0.1, np.full((30, 1), 1000.0))
    only = {"tracker": TRACKER}
    constant = WindowGP(only).replay({"tracker": at}, np.array([1.0]))
    zero = WindowGP(only, mean="zero").replay({"tracker": at}, np.array([1.0]))
    assert constant.mean[0, 0] == pytest.approx(1000.0, abs=1e-6)
    assert 1000 - zero.mean[0, 0] > 50


def test_a_pause_of_a_minute_neither_fails_nor_grows() -> None:
    time = np.arange(0, 62, 1 / 90)
    frames = np.concatenate([np.arange(0, 1, 1 / 30), np.arange(61, 62, 1 / 30)])
    samples = {
        "tracker": Samples(frames, frames + 0.1, np.zeros((len(frames), 1))),
        "imu": Samples(time, time, np.zeros((len(time), 1))),
    }
    estimator = WindowGP(BOTH)
    track = estimator.replay(samples, np.arange(0.5, 62, 0.5))
    assert np.isfinite(track.mean).all()
    assert np.abs(track.mean).max() < 1e-6


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"window": 0}, "window must be 1 or more"),
        ({"mean": "median"}, "mean must be constant or window or zero, got 'median'"),
        ({"signal_variance_mm2": -1.0}, "signal_variance_mm2 must be a number above 0, got -1.0"),
        ({"inverse_scale_s2": float("nan")}, "inverse_scale_s2 must be a number above 0"),
    ],
)
def test_parameters_out_of_range_are_named(parameters: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        WindowGP(BOTH, **parameters)  # type: ignore[arg-type]


def test_without_a_position_sensor_there_is_nothing_to_estimate() -> None:
    with pytest.raises(ValueError, match="needs a position sensor, got imu"):
        WindowGP({"imu": IMU})


def test_the_average_of_the_window_is_a_mean_too() -> None:
    """Far away positions alone are answered by their average and what the prior makes of the rest."""
    at = Samples(np.arange(5) / 30, np.arange(5) / 30, np.array([[1000.0], [1001.0], [999.0], [1002.0], [998.0]]))
    only = {"tracker": TRACKER}
    own = WindowGP(only, mean="window").replay({"tracker": at}, np.array([0.2]))
    less = Samples(at.time, at.arrival, at.value - 1000.0)
    zero = WindowGP(only, mean="zero").replay({"tracker": less}, np.array([0.2]))
    assert own.mean[0, 0] == pytest.approx(1000.0 + zero.mean[0, 0], abs=1e-9)


def test_an_unknown_bias_over_the_window_costs_nothing() -> None:
    """With σ_b²·11ᵀ beside the noise of accelerations and σ_b large, an offset of theirs changes nothing (method)."""
    frames, forces = np.arange(30) / 30, np.arange(100) / 90

    def shown(offset_mm_s2: float, bias_sd_mm_s2: float) -> float:
        samples = {
            "tracker": Samples(frames, frames + 0.1, np.zeros((30, 1))),
            "imu": Samples(forces, forces, np.full((100, 1), offset_mm_s2)),
        }
        estimator = WindowGP(BOTH, window=20, bias_sd_mm_s2=bias_sd_mm_s2)
        return float(estimator.replay(samples, np.array([1.05])).mean[0, 0])

    assert abs(shown(300.0, 0.0)) > 4.0
    assert shown(300.0, 1e5) == pytest.approx(shown(0.0, 1e5), abs=1e-3)


RATED = {
    "tracker": Sensor("position", 8.0, 0.1, 3, rate_hz=30),
    "imu": Sensor("acceleration", 100.0, 0.0, 3, rate_hz=90),
}


def regular(seconds: float = 6.0) -> tuple[dict[str, Samples], np.ndarray]:
    """A regular recording, its stamps in whole nanoseconds, of a hand that moves at up to 1 m/s."""
    random = np.random.default_rng(8)
    frames, forces = (np.round(np.arange(0, seconds, 1 / rate), 9) for rate in (30, 90))
    position = 300 * np.sin(3 * frames[:, None] + np.arange(3)) + random.normal(0, 8, (len(frames), 3))
    acceleration = -2700 * np.sin(3 * forces[:, None] + np.arange(3)) + random.normal(0, 100, (len(forces), 3))
    samples = {
        "tracker": Samples(frames, frames + 0.1, position),
        "imu": Samples(forces, forces, acceleration),
    }
    return samples, forces


def test_weights_of_regular_windows_are_those_of_their_own_times_to_a_millionth() -> None:
    samples, times = regular()
    auto, own = WindowGP(RATED), WindowGP(RATED, path="event_time")
    fast, slow = auto.replay(samples, times), own.replay(samples, times)
    np.testing.assert_allclose(fast.mean, slow.mean, atol=1e-6)
    np.testing.assert_allclose(fast.sd, slow.sd, atol=1e-6)
    assert 0 < len(auto._known_patterns) < 50
    assert not own._known_patterns


def test_an_irregular_stretch_takes_its_own_times() -> None:
    """A dropped frame leaves the fixed weights, and comes back to them once the window is regular again."""
    samples, times = regular()
    keep = np.arange(len(samples["tracker"])) != 90
    tracker = samples["tracker"]
    samples["tracker"] = Samples(tracker.time[keep], tracker.arrival[keep], tracker.value[keep])
    fast = WindowGP(RATED).replay(samples, times)
    slow = WindowGP(RATED, path="event_time").replay(samples, times)
    np.testing.assert_allclose(fast.mean, slow.mean, atol=1e-6)


def test_a_displacement_is_an_operator_of_the_users_own() -> None:
    """Optical flow between two frames observes p(t) − p(t − 33 ms); in a window it stands for the velocity."""
    step = 1 / 30
    flow = Sensor((Term(1.0), Term(-1.0, at_s=-step)), 0.5, 0.0, 1)
    sensors = {"tracker": TRACKER, "flow": flow}
    frames = np.arange(0, 2, step)
    truth = 200 * frames
    samples = {
        "tracker": Samples(frames, frames + 0.1, truth[:, None]),
        "flow": Samples(frames, frames, np.full((len(frames), 1), 200 * step)),
    }
    now = np.array([1.9])
    with_flow = WindowGP(sensors).replay(samples, now)
    without = WindowGP({"tracker": TRACKER}).replay(samples, now)
    assert with_flow.mean[0, 0] == pytest.approx(380.0, abs=2.0)
    assert with_flow.sd[0, 0] < 0.5 * without.sd[0, 0]


def test_a_sensor_of_one_axis_leaves_the_others_as_they_are() -> None:
    flow = Sensor("velocity", 5.0, 0.0, 1, axes=(1,))
    sensors = {"tracker": Sensor("position", 8.0, 0.1, 3), "flow": flow}
    frames = np.arange(0, 1, 1 / 30)
    path = np.stack([np.zeros_like(frames), 300 * frames, np.zeros_like(frames)], axis=1)
    samples = {
        "tracker": Samples(frames, frames + 0.1, path),
        "flow": Samples(frames, frames, np.full((len(frames), 1), 300.0)),
    }
    now = np.array([0.95])
    both = WindowGP(sensors).replay(samples, now)
    alone = WindowGP({"tracker": sensors["tracker"]}).replay(samples, now)
    np.testing.assert_allclose(both.mean[0, [0, 2]], alone.mean[0, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(both.sd[0, [0, 2]], alone.sd[0, [0, 2]], atol=1e-9)
    assert both.sd[0, 1] < 0.6 * both.sd[0, 0]
    assert both.mean[0, 1] == pytest.approx(285.0, abs=3.0)


def test_two_trackers_are_better_than_one() -> None:
    sensors = {"tracker": TRACKER, "second": Sensor("position", 4.0, 0.05, 1)}
    frames = np.arange(0, 1, 1 / 30)
    still = np.zeros((len(frames), 1))
    samples = {
        "tracker": Samples(frames, frames + 0.1, still),
        "second": Samples(frames + 0.01, frames + 0.06, still),
    }
    now = np.array([1.0])
    assert (
        WindowGP(sensors).replay(samples, now).sd[0, 0] < WindowGP({"tracker": TRACKER}).replay(samples, now).sd[0, 0]
    )


def test_a_sensor_later_than_the_horizon_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"horizon_s must cover .* tracker is 3.0 s late, horizon_s is 2.0"):
        WindowGP({"tracker": Sensor("position", 8.0, 3.0, 1)})


def test_readings_that_say_the_same_leave_no_factor_and_still_an_estimate() -> None:
    """Twelve readings within 12 ms, exact to a nanometre: round-off leaves their covariances no Cholesky factor."""
    frames = np.linspace(0.0, 0.011, 12)
    covariances = 5.66e4 * np.exp(-4.19 * (frames[:, None] - frames) ** 2) + 1e-12 * np.eye(12)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(covariances)
    value = 40.0 + 3.0 * frames[:, None]
    gp = WindowGP({"tracker": Sensor("position", 1e-6, 0.0, 1)}, window=12)
    samples, times = {"tracker": Samples(frames, frames, value)}, np.repeat(frames, 2)
    for track in (gp.replay(samples, times), replay_loop(gp, samples, times)):
        np.testing.assert_allclose(track.mean[:, 0], np.repeat(value[:, 0], 2), rtol=0, atol=1e-3)
        assert (track.sd < 0.01).all()


@pytest.mark.parametrize("mean", ["zero", "constant", "window"])
@pytest.mark.parametrize("derivative", ["exact", "finite_difference"])
def test_a_batch_is_its_windows_one_by_one(mean: str, derivative: str) -> None:
    """Also where instants are left out, repeated or go back, and the tracker pauses for longer than the horizon."""
    random = np.random.default_rng(11)
    frames = np.cumsum(random.uniform(0.02, 0.05, 90))
    frames[50:] += 1.2
    forces = np.cumsum(random.uniform(0.005, 0.02, 450))
    samples = {
        "tracker": Samples(frames, frames + 0.1, 800.0 + random.normal(0, 50, (90, 1))),
        "imu": Samples(forces, forces, random.normal(0, 500, (450, 1))),
    }
    times = np.sort(random.choice(forces, 150))
    times = np.concatenate([times, times[40:60], [0.0], times[100:]])
    gp = WindowGP(BOTH, mean=mean, derivative=derivative, bias_sd_mm_s2=50.0, horizon_s=0.8)  # type: ignore[arg-type]
    batch, loop = gp.replay(samples, times), replay_loop(gp, samples, times)
    np.testing.assert_allclose(batch.mean, loop.mean, rtol=0, atol=1e-6)
    np.testing.assert_allclose(batch.sd, loop.sd, rtol=0, atol=1e-6)
    assert np.isnan(batch.mean[170]).all()
