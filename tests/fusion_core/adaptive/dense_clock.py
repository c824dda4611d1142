"""The clock's filters of the adaptive filter once more, slowly: see `dense`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag
from scipy.special import softmax

from fusion_core.adaptive.layout import Records

if TYPE_CHECKING:
    from tests.fusion_core.adaptive.dense import Dense


class DenseClock:
    """The clock's filters as textbook ones: each of 21 offsets a state of 15 with a covariance of its own.

    A state is position, velocity, acceleration error and correlated noise, three axes each, and a lever arm. They get
    the accelerations as the large filter corrects them, which is not theirs, so its mean is handed over at each frame.
    """

    STEP_S, FIRST_S, NUMBER = 0.01, -0.14, 21

    def __init__(self, model: Records, noise: float, drift: float, position: np.ndarray) -> None:
        self.model, self.knows_arm = model[0], False
        self.steady = 0.0
        self.weight, self.foretold = np.zeros((2, self.NUMBER)), np.zeros(2)  # of a steady clock, of one that wanders
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
        news = -0.5 * cost - 0.5 * np.linalg.slogdet(spread)[1]
        before_it = softmax(self.weight + self._log_prior, axis=1)
        self.foretold = kept * self.foretold + np.log(before_it @ np.exp(news - news.max())) + news.max()
        left = np.array([kept, 1 / (1 + 0.01**2 * dt * self._parabola(1)[1])])
        self.weight = left[:, None] * self.weight + news
        gain = self.covariance @ observed.T @ np.linalg.inv(spread) / max(squared.min() / self.model["surprise"], 1.0)
        self.mean = self.mean + apart @ gain.T
        self.covariance = self.covariance - gain @ observed @ self.covariance
        weight = self.weight[int(self.wandering > 0.5)]
        best = int(np.argmax(weight))
        for one in map(int, np.flatnonzero(weight < weight[best] - 5.0)):
            self.mean[one, :3] -= turned @ (self.mean[best, 12:] - self.mean[one, 12:])
            self.mean[one, 12:] = self.mean[best, 12:]
        self.judge()

    @property
    def wandering(self) -> float:
        """How likely the clock is one that wanders."""
        return float(softmax(self.foretold + np.array([0.0, -3.0]))[1])

    def judge(self) -> None:
        """Offset and variance: those of either kind of clock, mixed."""
        steady = self._found(0, exact=0.7)
        self.steady = steady[0]
        found = np.array([steady, self._found(1, exact=0.0)])
        share = np.array([1 - self.wandering, self.wandering])
        self.value = float(share @ found[:, 0])
        self.variance = float(share @ (found[:, 1] + (found[:, 0] - self.value) ** 2))

    @property
    def _log_prior(self) -> np.ndarray:
        """Of the offsets, before any frame: about the stated latency, and about where a steady clock is."""
        return np.asarray(-0.5 * ((self.offset - np.array([[0.0], [self.steady]])) / 0.02) ** 2)

    def _parabola(self, kind: int) -> tuple[int, float, float]:
        """Where the weights with the prior are highest, and the bend and slope of the weights there."""
        inner = slice(1, self.NUMBER - 1)
        best = 1 + int(np.argmax((self.weight + self._log_prior)[kind, inner]))
        before, here, after = self.weight[kind, best - 1 : best + 2]
        return best, max((2 * here - before - after) / self.STEP_S**2, 0.0), (after - before) / (2 * self.STEP_S)

    def _found(self, kind: int, exact: float) -> tuple[float, float]:
        """Offset and variance: the vertex and bend of the log weights, times the prior of two normals."""
        about = self.steady if kind else 0.0
        best, bend, slope = self._parabola(kind)
        pull = bend * (self.offset[best] - about) + slope
        if bend > 1 / 0.002**2:
            self.weight[kind] *= 1 / 0.002**2 / bend
        parts = []
        for share, sd in ((exact, 0.005), (1 - exact, 0.02)):
            variance = 1 / (bend + 1 / sd**2)
            parts.append((share * np.sqrt(variance) / sd * np.exp(variance * pull**2 / 2), variance * pull, variance))
        evidence, mean, variance = np.array(parts).T
        evidence = evidence / evidence.sum()
        within = evidence @ mean
        low, high = self.offset[best] - self.STEP_S, self.offset[best] + self.STEP_S
        return float(np.clip(about + within, low, high)), float(evidence @ (variance + (mean - within) ** 2))

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
