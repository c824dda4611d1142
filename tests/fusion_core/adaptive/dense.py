"""The adaptive filter once more, slowly: whole matrices in plain NumPy, readings in order, nothing left out.

Written from the package's theory of operation, with none of its compiled code: integrals by Gauss and Legendre's
rule, transitions and observations as full matrices, the bank as eighty-odd textbook filters. For recordings in which
every frame is a measurement and comes after the phone's readings of its time.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from fusion_core.adaptive import layout
from fusion_core.adaptive.layout import Records
from fusion_core.samples import Samples
from tests.fusion_core.adaptive.dense_clock import DenseClock

P, V, INPUT, ARM, DRIFT = slice(0, 3), slice(3, 6), slice(6, 17), slice(17, 20), slice(20, 23)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)


def cross(vector: np.ndarray) -> np.ndarray:
    """[v]×."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def integrands(imu: Samples) -> np.ndarray:
    """Of each reading the acceleration and the input coupling, a flat (3, 12): (n, 36)."""
    assert imu.rotation is not None
    assert imu.force is not None
    rows = []
    up = imu.rotation[0] @ imu.force[0] - imu.value[0]
    up = up / np.linalg.norm(up)
    for value, rotation, force in zip(imu.value, imu.rotation, imu.force, strict=True):
        level = value - up * (up @ value)
        turn = np.column_stack([level, np.cross(up, level)])
        rows.append(np.column_stack([value, rotation, rotation @ cross(force), np.eye(3), turn]).ravel())
    return np.array(rows)


def between(time: np.ndarray, rows: np.ndarray, at: float) -> np.ndarray:
    """The row at a time, between two rows by a straight line; before the first and after the last, these."""
    after = int(np.clip(np.searchsorted(time, at), 1, len(time) - 1))
    share = np.clip((at - time[after - 1]) / (time[after] - time[after - 1]), 0.0, 1.0)
    return np.asarray((1 - share) * rows[after - 1] + share * rows[after])


class Dense:
    """State of 23 and bank; `take` moves to a frame and takes it in."""

    def __init__(self, model: Records, imu: Samples, position: np.ndarray, time: float) -> None:
        self.model, self.imu, self.time, self.began = model[0], imu, time, time
        self.rows = integrands(imu)
        self.mean, self.covariance = np.zeros(23), np.diag(self.model["prior"])
        self.mean[P] = position
        self.knows_arm = False
        self.usual = np.zeros((3, 14))
        members = self.model["member"].T
        self.bank_mean = np.zeros((len(members), 4, 3))
        self.bank_mean[:, 0] = position
        self.bank = []
        for variance, _, _, phone, drift, _ in members:
            own = np.diag([variance + drift, self.model["prior"][3], (1000.0 if phone else 5000.0) ** 2, drift])
            own[0, 3] = own[3, 0] = -drift
            self.bank.append(own)
        self.weight = np.zeros(len(members))
        self.judge()
        self.stamp = time
        self.clock = DenseClock(model, self.scale[0], self.scale[2], position)

    def turned(self, time: float) -> np.ndarray:
        """The rotation, between readings by a straight line."""
        assert self.imu.rotation is not None
        return between(self.imu.time, self.imu.rotation.reshape(-1, 9), time).reshape(3, 3)

    def integrals(self, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """First and second integrals of acceleration (3) and input coupling (3, 11), as (3, 12) each."""
        knots = np.concatenate([[begin], self.imu.time[(self.imu.time > begin) & (self.imu.time < end)], [end]])
        first, second = np.zeros(36), np.zeros(36)
        for left, right in pairwise(knots):
            half = (right - left) / 2
            for at, share in zip((left + right) / 2 + half * NODES, half * WEIGHTS, strict=True):
                value = between(self.imu.time, self.rows, at)
                first += share * value
                second += share * (end - at) * value
        return first.reshape(3, 12), second.reshape(3, 12)

    def take(self, stamp: float, position: np.ndarray) -> None:
        """A frame, moved to and taken in."""
        time = stamp + self.clock.value
        dt = time - self.time
        first, second = self.integrals(self.time, time)
        net = [integral[:, 0] - integral[:, 1:] @ self.mean[INPUT] for integral in (first, second)]
        self._move(dt, first, second)
        self.time = time
        turned = self.turned(time)
        if not self.knows_arm:
            self.knows_arm = True
            to_phone = np.eye(23)
            to_phone[P, ARM] = -turned
            self.mean, self.covariance = to_phone @ self.mean, to_phone @ self.covariance @ to_phone.T
        of_positions, of_accelerations = self._considered(dt, turned, first[:, 1:] / dt)
        of_phone = position - turned @ self.mean[ARM]
        squared_speed = float(self.mean[V] @ self.mean[V] / 3)
        of_positions += squared_speed * self.clock.variance
        self._bank(dt, net, of_phone, of_positions, of_accelerations)
        self.judge()
        self.clock.take(self, self.stamp, stamp, position, of_accelerations * dt / (stamp - self.stamp), turned)
        self.stamp = stamp
        self._correct(turned, position, squared_speed * self.clock.variance)

    def _move(self, dt: float, first: np.ndarray, second: np.ndarray) -> None:
        kept = np.exp(-dt / self.scale[3]) if self.scale[3] > 0 else 0.0
        transition, noise = np.eye(23), np.diag(self.model["walk"] * dt)
        transition[P, V], transition[P, INPUT], transition[V, INPUT] = dt * np.eye(3), -second[:, 1:], -first[:, 1:]
        transition[DRIFT, DRIFT] = kept * np.eye(3)
        given = np.zeros(23)
        given[P], given[V] = second[:, 0], first[:, 0]
        white = self.scale[1] * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        noise[:6, :6] += np.kron(white, np.eye(3))
        noise[DRIFT, DRIFT] += (1 - kept**2) * self.scale[2] * np.eye(3)
        self.mean = transition @ self.mean + given
        self.covariance = transition @ self.covariance @ transition.T + noise

    def _considered(self, dt: float, turned: np.ndarray, coupling: np.ndarray) -> tuple[float, float]:
        apart = np.column_stack([turned, coupling]) - self.usual
        self.usual = self.usual + (1 - np.exp(-dt / np.repeat([0.3, 2.0], [3, 11]))) * apart
        arm = np.trace(apart[:, :3] @ self.covariance[ARM, ARM] @ apart[:, :3].T) / 3
        inputs = np.trace(apart[:, 3:] @ self.covariance[INPUT, INPUT] @ apart[:, 3:].T) / 3
        return float(arm), float(0.5 * inputs)

    def _bank(self, dt: float, net: list[np.ndarray], position: np.ndarray, variance: float, psd: float) -> None:
        kept = np.exp(-dt / min(10.0, 1.0 + (self.time - self.began) / 2))
        white = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        rate = np.array(
            [
                [dt**5 / 20, dt**4 / 8, dt**3 / 6],
                [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                [dt**3 / 6, dt**2 / 2, dt],
            ]
        )
        observed = np.array([1.0, 0, 0, 1.0])
        for index, (noise, trust, rate_psd, phone, drift, drift_s) in enumerate(self.model["member"].T):
            fade = np.exp(-dt / drift_s) if drift > 0 else 0.0
            transition = np.array([[1, dt, dt**2 / 2, 0], [0, 1, dt, 0], [0, 0, 1, 0], [0, 0, 0, fade]])
            added = block_diag(rate_psd * rate, (1 - fade**2) * drift)
            added[:2, :2] += phone * (trust + psd) * white
            own = transition @ self.bank[index] @ transition.T + added
            mean = transition @ self.bank_mean[index] + phone * np.array([net[1], net[0], np.zeros(3), np.zeros(3)])
            apart, spread = position - observed @ mean, observed @ own @ observed + noise + variance
            squared = apart @ apart / spread
            surprised = max(squared / self.model["surprise"], 1.0)
            cost = min(squared, self.model["surprise"]) + 9.0 * np.log(surprised)
            self.weight[index] = kept * self.weight[index] - 0.5 * cost - 1.5 * np.log(spread)
            gain = own @ observed / (spread * surprised)
            self.bank_mean[index] = mean + np.outer(gain, apart)
            self.bank[index] = own - np.outer(gain, gain) * spread * surprised

    def judge(self) -> None:
        """Tracker variance, trust, variance and time of correlated noise."""
        phone = self.model["member"][layout.USES_PHONE] > 0
        member, odds = self.model["member"].T[phone], (self.weight + self.model["log_prior"])[phone]
        weight = np.exp(odds - odds.max())
        weight /= weight.sum()
        drifting = member[:, layout.DRIFT_VARIANCE] > 0
        share = weight[drifting] / weight[drifting].sum()
        alike = share**0.15 / np.sum(share**0.15)
        self.scale = (
            float(np.exp(weight @ np.log(member[:, layout.TRACKER_VARIANCE]))),
            float(np.exp(weight @ np.log(member[:, layout.ACCELERATION_PSD]))),
            float(weight[drifting].sum() * alike @ member[drifting, layout.DRIFT_VARIANCE]),
            float(np.exp(share @ np.log(member[drifting, layout.DRIFT_S]))),
        )

    def _correct(self, turned: np.ndarray, position: np.ndarray, of_clock: float) -> None:
        observed = np.zeros((3, 23))
        observed[:, P], observed[:, ARM], observed[:, DRIFT] = np.eye(3), turned, np.eye(3)
        apart = position - observed @ self.mean
        own = observed @ self.covariance @ observed.T
        variance = self.scale[0] + of_clock
        squared = apart @ np.linalg.solve(own + variance * np.eye(3), apart)
        if squared > self.model["surprise"]:
            variance = squared / self.model["surprise"] * (np.trace(own) / 3 + variance) - np.trace(own) / 3
        gain = self.covariance @ observed.T @ np.linalg.inv(own + variance * np.eye(3))
        self.mean = self.mean + gain @ apart
        self.covariance = self.covariance - gain @ observed @ self.covariance


def taken(model: Records, tracker: Samples, imu: Samples) -> dict[str, Any]:
    """A whole recording: the last mean, covariance and scales, the clock's offset and its variance."""
    dense = Dense(model, imu, tracker.value[0], float(tracker.time[0]))
    for frame in range(1, len(tracker)):
        dense.take(float(tracker.time[frame]), tracker.value[frame])
    clock = (dense.clock.value, dense.clock.variance)
    return {
        "mean": dense.mean,
        "covariance": dense.covariance,
        "scale": dense.scale,
        "time": dense.time,
        "clock": clock,
    }
