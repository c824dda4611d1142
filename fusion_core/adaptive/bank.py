"""How noisy the tracker is and how far accelerations can be trusted: small filters, each with an answer of its own.

A member knows position, velocity, an acceleration error and correlated noise of each axis, and all axes share one
covariance. It gets accelerations as the large filter's state corrects them and positions less the lever arm; what the
large filter does not know of phone and clock yet is added to every member's noise (Schmidt's "considered" parameters),
so that a lever arm still unknown is not taken for a noisy tracker. Members are weighed by the likelihood of the
positions, with forgetting; one whose positions surprise too much loses no more than a logarithm, and takes them in by
as much less.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive.layout import (
    ACCELERATION_PSD,
    AHEAD,
    ARM,
    AT,
    BEGAN,
    BIAS,
    DRIFT_S,
    DRIFT_VARIANCE,
    HELD,
    INPUTS,
    MEMBERS,
    NOISE,
    NOISE_DRIFT,
    NOISE_DRIFT_S,
    RATE_PSD,
    TRACKER_VARIANCE,
    TRUST,
    USES_PHONE,
    VELOCITY,
    Model,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_FORGET_S = 10.0
_USUAL_S = 2.0  # of the slow averages of couplings
_USUAL_ARM_S = 0.3  # of the lever arm's: a member's position follows slower turns, as it follows slow noise
_CORRELATED_S = 0.5  # how long an acceleration error from a wrong mounting lasts
_INDEPENDENT = 0.15  # of frames with correlated noise: one in seven, of 30 a second where it lasts 0.2 s
_TAIL = 3.0  # per axis: how fast the likelihood falls where positions surprise
_RATE_SD = 1000.0  # mm/s²: the acceleration error before any reading, of a mounting that is off by 6°
_ACCELERATION_SD = 5000.0  # mm/s²: the acceleration itself, of members that do not use the phone

# Rows of State.bank_covariance: position, velocity, rate (the acceleration error) and correlated noise.
_PP, _PV, _PR, _PN, _VV, _VR, _VN, _RR, _RN, _NN = range(10)


@compiled(inner=True)
def begin(model: Model, state: State, position: FloatArray) -> None:
    """All members at the first position."""
    for member in range(MEMBERS):
        state.weight[member] = 0.0
    begin_again(model, state, position)
    judge(model, state)


@compiled(inner=True)
def begin_again(model: Model, state: State, position: FloatArray) -> None:
    """The motion begins anew at a position; weights stay."""
    mean, own = state.bank_mean, state.bank_covariance
    for member in range(MEMBERS):
        for part in range(len(mean)):
            mean[part, member] = 0.0
        for part in range(len(own)):
            own[part, member] = 0.0
        drift = model.member[DRIFT_VARIANCE, member]
        rate = _RATE_SD if model.member[USES_PHONE, member] else _ACCELERATION_SD
        for axis in range(model.dimension):
            mean[axis, member] = position[axis]
        own[_PP, member], own[_NN, member] = model.member[TRACKER_VARIANCE, member] + drift, drift
        own[_VV, member], own[_RR, member], own[_PN, member] = model.prior[VELOCITY], rate * rate, -drift


@compiled(inner=True)
def to_phone(model: Model, state: State, turned: FloatArray) -> None:
    """As `moments.to_phone`, with the large filter's lever arm."""
    for axis in range(model.dimension):
        arm = 0.0
        for part in range(3):
            arm += turned[axis, part] * state.mean[ARM + part]
        for member in range(MEMBERS):
            state.bank_mean[axis, member] -= arm


@compiled(inner=True)
def considered(model: Model, state: State, turned: FloatArray, coupling: FloatArray, dt: float) -> tuple[float, float]:
    """Variance of positions and density of accelerations, an axis, that come of what is not known yet.

    Only changes against the couplings of the last seconds count: what does not change is a constant of the member.
    """
    usual, covariance = state.usual, state.covariance
    of_arm, of_input = 1.0 - np.exp(-dt / _USUAL_ARM_S), 1.0 - np.exp(-dt / _USUAL_S)
    position, acceleration, apart = 0.0, 0.0, np.empty(3 + INPUTS)
    for axis in range(model.dimension):
        for part in range(3 + INPUTS):
            now = turned[axis, part] if part < 3 else coupling[0, axis, part - 3] / dt
            apart[part] = now - usual[axis, part]
            usual[axis, part] += (of_arm if part < 3 else of_input) * apart[part]
        for one in range(3):
            for other in range(3):
                position += apart[one] * apart[other] * covariance[ARM + one, ARM + other]
        for one in range(INPUTS):
            for other in range(INPUTS):
                acceleration += apart[3 + one] * apart[3 + other] * covariance[BIAS + one, BIAS + other]
    return position / model.dimension, acceleration * _CORRELATED_S / model.dimension


@compiled(inner=True)
def move(model: Model, state: State, dt: float, net: FloatArray, more_psd: float) -> None:
    """All members moved over `dt` seconds, with the first and second integrals `net` (2, 3) of the accelerations.

    Loops over members are innermost and without branches, so that the compiler does several at once.
    """
    _move_means(model, state, dt, net)
    own, parameters = state.bank_covariance, model.member
    half, cube = dt * dt / 2.0, dt * dt * dt
    fourth, fifth = cube * dt / 8.0, cube * dt * dt / 20.0
    for member in range(MEMBERS):
        rate, kept = parameters[RATE_PSD, member], state.kept[member]
        psd = (parameters[ACCELERATION_PSD, member] + more_psd) * parameters[USES_PHONE, member]
        pv, pr, vr, rr = own[_PV, member], own[_PR, member], own[_VR, member], own[_RR, member]
        speed, rates, speed_rate = pv + dt * own[_VV, member] + half * vr, pr + dt * vr + half * rr, vr + dt * rr
        own[_PP, member] += dt * (pv + speed) + half * (pr + rates) + psd * cube / 3.0 + rate * fifth
        own[_PV, member] = speed + dt * rates + psd * half + rate * fourth
        own[_PR, member] = rates + rate * cube / 6.0
        own[_VV, member] += dt * (vr + speed_rate) + psd * dt + rate * cube / 3.0
        own[_VR, member] = speed_rate + rate * half
        own[_RR, member] = rr + rate * dt
        vn, rn = own[_VN, member], own[_RN, member]
        own[_PN, member] = kept * (own[_PN, member] + dt * vn + half * rn)
        own[_VN, member], own[_RN, member] = kept * (vn + dt * rn), kept * rn
        fresh = (1.0 - kept * kept) * parameters[DRIFT_VARIANCE, member]
        own[_NN, member] = kept * kept * own[_NN, member] + fresh


@compiled
def _move_means(model: Model, state: State, dt: float, net: FloatArray) -> None:
    mean, half, phone = state.bank_mean, dt * dt / 2.0, model.member[USES_PHONE]
    for member in range(MEMBERS):
        drift_s = model.member[DRIFT_S, member]
        state.kept[member] = np.exp(-dt / drift_s) if drift_s > 0.0 else 0.0
    for axis in range(model.dimension):
        for member in range(MEMBERS):
            rate, used = mean[6 + axis, member], phone[member]
            mean[axis, member] += dt * mean[3 + axis, member] + half * rate + used * net[1, axis]
            mean[3 + axis, member] += dt * rate + used * net[0, axis]
            mean[9 + axis, member] *= state.kept[member]


@compiled(inner=True)
def take_in(model: Model, state: State, position: FloatArray, more_variance: float, dt: float) -> None:
    """A position taken in by all members, and their weights moved by how likely it was to each."""
    since = state.fact[AT] - state.fact[BEGAN]
    kept = np.exp(-dt / min(_FORGET_S, 1.0 + since / 2.0))
    mean, own, apart = state.bank_mean, state.bank_covariance, np.empty((3, MEMBERS))
    gain = np.empty(MEMBERS)
    for member in range(MEMBERS):
        variance = own[_PP, member] + 2.0 * own[_PN, member] + own[_NN, member]
        variance += model.member[TRACKER_VARIANCE, member] + more_variance
        squared = 0.0
        for axis in range(model.dimension):
            off = position[axis] - mean[axis, member] - mean[9 + axis, member]
            apart[axis, member] = off
            squared += off * off
        squared /= variance
        state.weight[member] = state.weight[member] * kept + weighed(model, squared, variance)
        gain[member] = 1.0 / (variance * max(squared / model.surprise, 1.0))
    _correct(model.dimension, mean, own, apart, gain)


@compiled
def _correct(dimension: int, mean: FloatArray, own: FloatArray, apart: FloatArray, gain: FloatArray) -> None:
    """Means and covariances of all members corrected, with the inverse of each innovation's variance as `gain`."""
    for member in range(MEMBERS):
        share = gain[member]
        p, v = own[_PP, member] + own[_PN, member], own[_PV, member] + own[_VN, member]
        r, n = own[_PR, member] + own[_RN, member], own[_PN, member] + own[_NN, member]
        for axis in range(dimension):
            off = share * apart[axis, member]
            mean[axis, member] += p * off
            mean[3 + axis, member] += v * off
            mean[6 + axis, member] += r * off
            mean[9 + axis, member] += n * off
        own[_PP, member] -= share * p * p
        own[_PV, member] -= share * p * v
        own[_PR, member] -= share * p * r
        own[_PN, member] -= share * p * n
        own[_VV, member] -= share * v * v
        own[_VR, member] -= share * v * r
        own[_VN, member] -= share * v * n
        own[_RR, member] -= share * r * r
        own[_RN, member] -= share * r * n
        own[_NN, member] -= share * n * n


@compiled(inner=True)
def weighed(model: Model, squared: float, variance: float) -> float:
    """The log density of a position, of normal noise, beyond `surprise` falling only as a power."""
    log_density = -0.5 * model.dimension * np.log(variance)
    if squared > model.surprise:
        tail = _TAIL * model.dimension * np.log(squared / model.surprise)
        return float(log_density - 0.5 * (model.surprise + tail))
    return float(log_density - 0.5 * squared)


@compiled(inner=True)
def judge(model: Model, state: State) -> None:
    """The scales as the members that use the phone see them, averages of logarithms by weight.

    Leaves every member's share in `share`, those with the phone and those without each summing to 1. How large
    correlated noise is hangs on how long it lasts, which its frames hardly say: so its members count more alike there.
    """
    _to_shares(model, state, 0, model.first_alone)
    _to_shares(model, state, model.first_alone, MEMBERS)
    noise, trust, drift, drift_s, drifting, alike = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for member in range(model.first_alone):
        share = state.share[member]
        noise += share * model.log_member[TRACKER_VARIANCE, member]
        trust += share * model.log_member[ACCELERATION_PSD, member]
        if model.member[DRIFT_VARIANCE, member] > 0.0:
            drift += share**_INDEPENDENT * model.member[DRIFT_VARIANCE, member]
            alike += share**_INDEPENDENT
            drift_s += share * model.log_member[DRIFT_S, member]
            drifting += share
    state.fact[NOISE], state.fact[TRUST] = np.exp(noise), np.exp(trust)
    state.fact[NOISE_DRIFT] = drifting * drift / alike if drifting > 0.0 else 0.0
    state.fact[NOISE_DRIFT_S] = np.exp(drift_s / drifting) if drifting > 0.0 else 0.0


@compiled(inner=True)
def noise(state: State) -> float:
    """The variance of a position's noise, as found."""
    return float(state.fact[NOISE] + state.fact[NOISE_DRIFT])


@compiled
def _to_shares(model: Model, state: State, begin: int, end: int) -> None:
    """The shares of the members from `begin` to `end`, which sum to 1."""
    highest, total = -np.inf, 0.0
    for member in range(begin, end):
        highest = max(highest, state.weight[member] + model.log_prior[member])
    for member in range(begin, end):
        state.share[member] = np.exp(state.weight[member] + model.log_prior[member] - highest)
        total += state.share[member]
    for member in range(begin, end):
        state.share[member] /= total


@compiled(inner=True)
def by_positions(model: Model, state: State, ahead_s: float, answers: FloatArray) -> None:
    """What members that do not use the phone say of the position, `ahead_s` gone on and held, into `answers`."""
    mean = state.bank_mean
    for axis in range(3):
        ahead, held = 0.0, 0.0
        if axis < model.dimension:
            for member in range(model.first_alone, MEMBERS):
                gone = ahead_s * (mean[3 + axis, member] + ahead_s / 2.0 * mean[6 + axis, member])
                held += state.share[member] * mean[axis, member]
                ahead += state.share[member] * (mean[axis, member] + gone)
        answers[AHEAD + axis], answers[HELD + axis] = ahead, held
