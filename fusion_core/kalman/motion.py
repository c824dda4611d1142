"""Priors of the hand's motion as linear stochastic differential equations: how a state moves over a step."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import NamedTuple

import numpy as np

from fusion_core.checks import require_positive
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray


class Motion(NamedTuple):
    """A prior in the form the compiled steps take; `states` per axis begin with position, velocity, acceleration.

    A Wiener process follows from `jerk_psd_mm2_s5` alone. An `anchored` process also returns to a constant, its last
    state: the transition of the others over dt is exp(−decay·dt) Σ powers[k]·dtᵏ, and `stationary` their covariance.
    """

    powers: FloatArray
    decay: float
    stationary: FloatArray
    jerk_psd_mm2_s5: float
    anchored: bool

    @property
    def states(self) -> int:
        """States per axis."""
        return len(self.stationary)


@dataclass(frozen=True)
class Wiener:
    """The acceleration is a Wiener process: Bar-Shalom, Li and Kirubarajan (2001), section 6.2.3."""

    jerk_psd_mm2_s5: float
    initial_speed_sd_mm_s: float
    initial_acceleration_sd_mm_s2: float

    def __post_init__(self) -> None:
        require_positive(
            jerk_psd_mm2_s5=self.jerk_psd_mm2_s5,
            initial_speed_sd_mm_s=self.initial_speed_sd_mm_s,
            initial_acceleration_sd_mm_s2=self.initial_acceleration_sd_mm_s2,
        )

    def motion(self) -> Motion:
        """The motion for the compiled steps, which does not return to a constant."""
        return Motion(np.zeros((1, 3, 3)), 0.0, np.zeros((3, 3)), self.jerk_psd_mm2_s5, False)

    def initial_covariance(self, position_variance_mm2: float) -> FloatArray:
        """Covariance (3, 3) once the first position has been seen."""
        variances = [position_variance_mm2, self.initial_speed_sd_mm_s**2, self.initial_acceleration_sd_mm_s2**2]
        return np.diag(np.array(variances, dtype=np.float64))


@dataclass(frozen=True)
class Matern72:
    """A Matérn-7/2 process about an unknown constant, as a state-space model: Hartikainen and Särkkä (2010).

    k(τ) = s²(1 + λτ + ²⁄₅λ²τ² + ¹⁄₁₅λ³τ³) exp(−λτ), λ = √7 / `length_scale_s`, s = `signal_sd_mm`. The states are
    position, velocity, acceleration, jerk and the constant.
    """

    signal_sd_mm: float
    length_scale_s: float

    def __post_init__(self) -> None:
        require_positive(signal_sd_mm=self.signal_sd_mm, length_scale_s=self.length_scale_s)

    @property
    def _rate(self) -> float:
        return float(np.sqrt(7.0) / self.length_scale_s)

    def _drift(self) -> FloatArray:
        rate = self._rate
        drift = np.eye(4, k=1)
        drift[3] = [-(rate**4), -4 * rate**3, -6 * rate**2, -4 * rate]
        return drift

    def _stationary(self) -> FloatArray:
        """Covariance (4, 4) of the process and its first three derivatives."""
        from scipy.linalg import solve_continuous_lyapunov

        density = self.signal_sd_mm**2 * 32 * self._rate**7 / 5
        noise = np.zeros((4, 4))
        noise[3, 3] = density
        return np.asarray(solve_continuous_lyapunov(self._drift(), -noise), dtype=np.float64)

    def motion(self) -> Motion:
        """The motion for the compiled steps: all eigenvalues are −λ, so the transition is a cubic times a decay."""
        powers = np.zeros((4, 5, 5))
        powers[:, :4, :4] = _series(self._drift() + self._rate * np.eye(4))
        stationary = np.zeros((5, 5))
        stationary[:4, :4] = self._stationary()
        return Motion(powers, self._rate, stationary, 0.0, True)

    def initial_covariance(self, position_variance_mm2: float) -> FloatArray:
        """Covariance (5, 5) once the first position has been seen; the constant is that position less the process."""
        process = self._stationary()
        covariance = np.zeros((5, 5))
        covariance[:4, :4] = process
        covariance[4, :4] = covariance[:4, 4] = -process[0]
        covariance[4, 4] = process[0, 0]
        covariance[0, :] = covariance[:, 0] = 0.0
        covariance[0, 0] = covariance[0, 4] = covariance[4, 0] = position_variance_mm2
        covariance[4, 4] += position_variance_mm2
        return covariance


Prior = Wiener | Matern72


def _series(nilpotent: FloatArray) -> FloatArray:
    """Aᵏ/k! for k below the size of A, (n, n, n)."""
    powers = [np.linalg.matrix_power(nilpotent, k) / factorial(k) for k in range(len(nilpotent))]
    return np.array(powers, dtype=np.float64)


@compiled(inner=True)
def add_wiener_noise(density: float, dt: float, noise: FloatArray, apart: int, axis: int) -> None:
    """Adds the process noise over `dt` s to position, velocity and acceleration of one axis, in place.

    Their rows in `noise` are `axis`, `axis + apart` and `axis + 2·apart`. Bar-Shalom, Li and Kirubarajan (2001),
    section 6.2.3, with the jerk's spectral density `density`.
    """
    speed, rate, squared = apart + axis, 2 * apart + axis, dt * dt
    noise[axis, axis] += density * squared * squared * dt / 20.0
    noise[axis, speed] += density * squared * squared / 8.0
    noise[speed, axis] += density * squared * squared / 8.0
    noise[axis, rate] += density * squared * dt / 6.0
    noise[rate, axis] += density * squared * dt / 6.0
    noise[speed, speed] += density * squared * dt / 3.0
    noise[speed, rate] += density * squared / 2.0
    noise[rate, speed] += density * squared / 2.0
    noise[rate, rate] += density * dt


@compiled(inner=True)
def step(motion: Motion, dt: float, jerk_psd: float, transition: FloatArray, noise: FloatArray) -> None:
    """Writes the transition and the process noise over `dt` seconds, (states, states) each, for one axis.

    The jerk's density is the larger of the prior's and `jerk_psd`.
    """
    if motion.anchored:
        _anchored(motion, dt, transition)
        _stationary_noise(motion.stationary, transition, noise)
    else:
        transition[:] = 0.0
        for state in range(3):
            transition[state, state] = 1.0
        transition[0, 1] = transition[1, 2] = dt
        transition[0, 2] = dt * dt / 2.0
        noise[:] = 0.0
    add_wiener_noise(max(motion.jerk_psd_mm2_s5, jerk_psd), dt, noise, 1, 0)


@compiled(inner=True)
def position_step(motion: Motion, dt: float, jerk_psd: float, of_position: FloatArray) -> float:
    """Writes the position's row (states,) of the transition over `dt` seconds; returns the position's process noise."""
    if not motion.anchored:
        of_position[0], of_position[1], of_position[2] = 1.0, dt, dt * dt / 2.0
        return max(motion.jerk_psd_mm2_s5, jerk_psd) * dt * dt * dt * dt * dt / 20.0
    states = len(motion.stationary)
    transition, noise = np.empty((states, states)), np.empty((states, states))
    step(motion, dt, jerk_psd, transition, noise)
    for state in range(states):
        of_position[state] = transition[0, state]
    return float(noise[0, 0])


@compiled
def _anchored(motion: Motion, dt: float, transition: FloatArray) -> None:
    """Writes the transition: a cubic times a decay for the process, and the rest of the position from the constant."""
    moving = len(transition) - 1
    decay = np.exp(-motion.decay * dt)
    transition[:] = 0.0
    for row in range(moving):
        for column in range(moving):
            power = decay
            for k in range(len(motion.powers)):
                transition[row, column] += motion.powers[k, row, column] * power
                power *= dt
        transition[row, moving] = (1.0 if row == 0 else 0.0) - transition[row, 0]
    transition[moving, moving] = 1.0


@compiled
def _stationary_noise(stationary: FloatArray, transition: FloatArray, noise: FloatArray) -> None:
    """Writes the noise that keeps a stationary process stationary: Q = P − F P Fᵀ, for all states but the constant."""
    moving = stationary.shape[0] - 1
    noise[:] = 0.0
    for row in range(moving):
        for column in range(row + 1):
            kept = 0.0
            for k in range(moving):
                for other in range(moving):
                    kept += transition[row, k] * stationary[k, other] * transition[column, other]
            noise[row, column] = noise[column, row] = stationary[row, column] - kept
