"""The clock's filters of the adaptive filter once more, slowly: see `dense`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from fusion_core.adaptive.layout import Records

if TYPE_CHECKING:
    from tests.fusion_core.adaptive.dense import Dense


class DenseClock:
    """The clock's filters as textbook ones: each of eleven offsets a state of 15 with a covariance of its own.

    A state is position, velocity, acceleration error and correlated noise, three axes each, and a lever arm. They get
    the accelerations as the large filter corrects them, which is not theirs, so its mean is handed over at each frame.
    """

    STEP_S, FIRST_S, NUMBER = 0.02, -0.14, 11

    def __init__(self, model: Records, noise: float, drift: float, position: np.ndarray) -> None:
        self.model, self.knows_arm = model[0], False
        self.weight = np.zeros(self.NUMBER)
        self.offset = self.FIRST_S + self.STEP_S * np.arange(self.NUMBER)
        begin = np.kron(
            np.array([[noise + drift, 0, 0, -drift], [0, 500.0**2, 0, 0], [0, 0, 1000.0**2, 0], [-drift, 0, 0, drift]]),
            np.eye(3),
        )
        self.covariance = block_diag(begin, self.model["prior"][17] * np.eye(3))
        self.mean = np.zeros((self.NUMBER, 15))
        self.mean[:, :3] = position
        self.judge()

    def take(
        self, large: Dense, before: float, stamp: float, position: np.ndarray, psd: float, turned: np.ndarray
    ) -> None:
        """A frame by its stamp; `large` is the large filter, moved to the frame and not yet corrected."""
        dt = stamp - before
        self._move(large, dt, psd)
        if not self.knows_arm:
            self.knows_arm = True
            to_phone = np.eye(15)
            to_phone[:3, 12:] = -turned
            self.mean, self.covariance = self.mean @ to_phone.T, to_phone @ self.covariance @ to_phone.T
        kept = np.exp(-dt / min(10.0, 1.0 + (large.time - large.began) / 2))
        observed = self._observed(turned)
        spread = observed @ self.covariance @ observed.T + large.scale[0] * np.eye(3)
        apart = np.empty((self.NUMBER, 3))
        for one, offset in enumerate(self.offset):
            first, second = large.integrals(before + offset, stamp + offset)
            net = [integral[:, 0] - integral[:, 1:] @ large.mean[6:17] for integral in (first, second)]
            self.mean[one, :3] += net[1]
            self.mean[one, 3:6] += net[0]
            apart[one] = position - self._observed(large.turned(stamp + offset)) @ self.mean[one]
        squared = np.einsum("oi,ij,oj->o", apart, np.linalg.inv(spread), apart)
        surprised = np.maximum(squared / self.model["surprise"], 1.0)
        cost = np.minimum(squared, self.model["surprise"]) + 9.0 * np.log(surprised)
        self.weight = kept * self.weight - 0.5 * cost - 0.5 * np.linalg.slogdet(spread)[1]
        gain = self.covariance @ observed.T @ np.linalg.inv(spread) / max(squared.min() / self.model["surprise"], 1.0)
        self.mean = self.mean + apart @ gain.T
        self.covariance = self.covariance - gain @ observed @ self.covariance
        best = int(np.argmax(self.weight))
        for one in map(int, np.flatnonzero(self.weight < self.weight[best] - 5.0)):
            self.mean[one, :3] -= turned @ (self.mean[best, 12:] - self.mean[one, 12:])
            self.mean[one, 12:] = self.mean[best, 12:]

        self.judge()

    def judge(self) -> None:
        """Offset and variance: the vertex and bend of the log weights, times the prior of two normals."""
        inner = slice(1, self.NUMBER - 1)
        best = 1 + int(np.argmax((self.weight - 0.5 * (self.offset / 0.02) ** 2)[inner]))
        before, here, after = self.weight[best - 1 : best + 2]
        bend = max((2 * here - before - after) / self.STEP_S**2, 0.0)
        pull = bend * self.offset[best] + (after - before) / (2 * self.STEP_S)
        if bend > 1 / 0.002**2:
            self.weight *= 1 / 0.002**2 / bend
        parts = []
        for share, sd in ((0.7, 0.005), (0.3, 0.02)):
            variance = 1 / (bend + 1 / sd**2)
            parts.append((share * np.sqrt(variance) / sd * np.exp(variance * pull**2 / 2), variance * pull, variance))
        evidence, mean, variance = np.array(parts).T
        evidence = evidence / evidence.sum()
        within = evidence @ mean
        self.variance = float(evidence @ (variance + (mean - within) ** 2))
        low, high = self.offset[best] - self.STEP_S, self.offset[best] + self.STEP_S
        self.value = float(np.clip(within, low, high))

    def _move(self, large: Dense, dt: float, psd: float) -> None:
        fade = np.exp(-dt / large.scale[3]) if large.scale[3] > 0 else 0.0
        small = np.array([[1, dt, dt**2 / 2, 0], [0, 1, dt, 0], [0, 0, 1, 0], [0, 0, 0, fade]])
        added = np.diag([0.0, 0.0, 900.0 * dt, (1 - fade**2) * large.scale[2]])
        added[:2, :2] += (large.scale[1] + psd) * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        transition = block_diag(np.kron(small, np.eye(3)), np.eye(3))
        self.mean = self.mean @ transition.T
        self.covariance = transition @ self.covariance @ transition.T
        self.covariance += block_diag(np.kron(added, np.eye(3)), np.zeros((3, 3)))

    @staticmethod
    def _observed(turned: np.ndarray) -> np.ndarray:
        return np.hstack([np.eye(3), np.zeros((3, 6)), np.eye(3), turned])
