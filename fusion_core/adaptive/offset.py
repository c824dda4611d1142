"""What the clock's filters say of the offset: how likely each was, as a parabola, and how soon the past is forgotten.

The log likelihoods, with forgetting, are a parabola about the true offset, whose vertex and bend are the offset and
its SD. A hand at rest says nothing of it; the prior then mostly believes the stated latency, or each start would be
uncertain.

How much to forget depends on the clock. One kind is steady: what was found ten seconds ago still holds. The other
wanders about where a steady one would be: in a second it goes so far that of a moving hand only the last second or two
counts. Both are kept, and the offset is that of either by how well it foretold the frames, each by what was known
before it came.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive.layout import CLOCK_S, CLOCK_STEADY_S, CLOCK_VARIANCE, OFFSETS, STEADY, WANDERING, State
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

STEP_S = 0.01  # between the offsets tried; with 0.02 a clock in the middle of two seems to wander between them
FIRST_S = -0.14  # the tracker is later than stated by so much, at the most; and up to 60 ms earlier
_LOG_ODDS_EXACT = (float(np.log(0.7 / 0.3)), -np.inf)  # of a steady clock: so often its stated latency is right,
_EXACT_SD_S, _PRIOR_SD_S = 0.005, 0.02  # as far as any latency is constant; else it is right within a frame or so
_LEAST_SD_S = 0.002  # the past is forgotten so far as to leave no more certainty: no latency is constant
_WANDER_PSD_S = 0.01**2  # s²/s: a clock that wanders goes ten milliseconds in a second
_WANDER_LOG_ODDS = -3.0  # of such a one before any frame, one recording in twenty


@compiled(inner=True)
def begin(state: State) -> None:
    """Nothing is known."""
    state.fact[CLOCK_STEADY_S] = 0.0
    for kind in range(2):
        state.clock_foretold[kind] = 0.0
        for one in range(OFFSETS):
            state.clock_weight[kind, one] = 0.0


@compiled(inner=True)
def weigh(state: State, news: FloatArray, kept: float, dt: float) -> None:
    """The log likelihood (offsets,) of a frame with each offset taken in, `dt` seconds after the one before.

    Of a steady clock `kept` is left of the past. A random walk of variance q dt leaves of a precision b its share
    1 / (1 + q dt b), and so of all log weights, by which the vertex stays where it is.
    """
    for kind in range(2):
        weight, about, left = state.clock_weight[kind], _about(state, kind), kept
        state.clock_foretold[kind] = kept * state.clock_foretold[kind] + _foretold(weight, news, about)
        if kind == WANDERING:
            left = 1.0 / (1.0 + _WANDER_PSD_S * dt * _bend(weight, _highest(weight, about)))
        for one in range(OFFSETS):
            weight[one] = left * weight[one] + news[one]


@compiled
def _about(state: State, kind: int) -> float:
    """Where the offset is before any frame: as stated; or of a clock that wanders, where a steady one is."""
    return float(state.fact[CLOCK_STEADY_S]) if kind == WANDERING else 0.0


@compiled
def _foretold(weight: FloatArray, news: FloatArray, about: float) -> float:
    """The log of a frame's likelihood `news`, averaged over offsets as they were before it."""
    highest, both_highest, total, both = -np.inf, -np.inf, 0.0, 0.0
    for one in range(OFFSETS):
        before = weight[one] + _log_prior(one, about)
        highest, both_highest = max(highest, before), max(both_highest, before + news[one])
    for one in range(OFFSETS):
        before = weight[one] + _log_prior(one, about)
        total += np.exp(before - highest)
        both += np.exp(before + news[one] - both_highest)
    return float(both_highest - highest + np.log(both / total))


@compiled
def _log_prior(one: int, about: float) -> float:
    """The log density of the broad prior at an offset, but for a constant."""
    apart = FIRST_S + one * STEP_S - about
    return float(-0.5 * apart * apart / _PRIOR_SD_S**2)


@compiled
def _highest(weight: FloatArray, about: float) -> int:
    """The likeliest offset that has another on either side."""
    best, highest = 1, -np.inf
    for one in range(1, OFFSETS - 1):
        log_weight = weight[one] + _log_prior(one, about)
        if log_weight > highest:
            best, highest = one, log_weight
    return best


@compiled
def _bend(weight: FloatArray, best: int) -> float:
    """The precision, in 1/s², of an offset by the log weights about the highest."""
    return float(max(-(weight[best - 1] - 2.0 * weight[best] + weight[best + 1]) / STEP_S**2, 0.0))


@compiled
def _log_odds(state: State) -> float:
    """Of a clock that wanders against a steady one."""
    return float(state.clock_foretold[WANDERING] - state.clock_foretold[STEADY] + _WANDER_LOG_ODDS)


@compiled(inner=True)
def likelier(state: State) -> int:
    """The kind of clock that it seems to be."""
    return WANDERING if _log_odds(state) > 0.0 else STEADY


@compiled(inner=True)
def judge(state: State) -> None:
    """The offset and its variance, of both kinds of clock by their odds."""
    wandering = 1.0 / (1.0 + np.exp(min(-_log_odds(state), 500.0)))
    mean, squared = 0.0, 0.0
    for kind in range(2):  # the steady one first, about which the other wanders
        share = wandering if kind == WANDERING else 1.0 - wandering
        _by_parabola(state, kind)
        if kind == STEADY:
            state.fact[CLOCK_STEADY_S] = state.fact[CLOCK_S]
        mean += share * state.fact[CLOCK_S]
        squared += share * (state.fact[CLOCK_S] ** 2 + state.fact[CLOCK_VARIANCE])
    state.fact[CLOCK_S], state.fact[CLOCK_VARIANCE] = mean, squared - mean**2


@compiled
def _by_parabola(state: State, kind: int) -> None:
    """The offset and its variance as the log weights have them, by the parabola about the highest and the prior."""
    weight, about = state.clock_weight[kind], _about(state, kind)
    best = _highest(weight, about)
    here, bend, slope = (
        FIRST_S + best * STEP_S,
        _bend(weight, best),
        (weight[best + 1] - weight[best - 1]) / 2.0 / STEP_S,
    )
    most = 1.0 / _LEAST_SD_S**2
    if bend > most:
        for one in range(OFFSETS):
            weight[one] *= most / bend
    _add_prior(state, bend, bend * (here - about) + slope, _LOG_ODDS_EXACT[kind])
    state.fact[CLOCK_S] = min(max(about + state.fact[CLOCK_S], here - STEP_S), here + STEP_S)


@compiled
def _add_prior(state: State, bend: float, pull: float, log_odds: float) -> None:
    """Mean and variance of an offset o whose log likelihood is pull·o − bend·o²/2, by a prior of two normals.

    With precision λ a normal gives it the mean pull / (bend + λ), the variance 1 / (bend + λ) and the evidence
    √(λ / (bend + λ)) exp(pull² / (bend + λ) / 2); the two are mixed by their evidence and `log_odds`.
    """
    exact, broad = 1.0 / _EXACT_SD_S**2, 1.0 / _PRIOR_SD_S**2
    first, second = pull / (bend + exact), pull / (bend + broad)
    log_odds += 0.5 * pull * (first - second)
    log_odds += 0.5 * np.log(exact / (bend + exact) * (bend + broad) / broad)
    share = 1.0 / (1.0 + np.exp(-log_odds))
    state.fact[CLOCK_S] = share * first + (1.0 - share) * second
    variance = share / (bend + exact) + (1.0 - share) / (bend + broad)
    state.fact[CLOCK_VARIANCE] = variance + share * (1.0 - share) * (first - second) ** 2
