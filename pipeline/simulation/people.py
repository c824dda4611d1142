"""Simulated participants: each drawn from the traits of study.yaml by a seed of their own."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from pipeline.sessions.recording import seeded
from pipeline.simulation.hand_steps import INTERMITTENT, SECOND_ORDER_LAG, STEP_S, Person, Sway
from pipeline.study.simulation import SelectionSimulation, Trait

_MODELS = {"intermittent": INTERMITTENT, "second_order_lag": SECOND_ORDER_LAG}
_LONGEST_DELAY_S = 0.9  # less than the memory of the compiled steps


def person(settings: SelectionSimulation, participant: str) -> Person:
    """One participant: the same in every condition, and independent of the other participants.

    `expected_lag_s` is what they expect of a lag of 1 s; `used_to_lag` scales it to that of a display.
    """
    drawn = {}
    for name in type(settings.traits).model_fields:
        trait: Trait = getattr(settings.traits, name)
        drawn[name] = _drawn(trait, seeded(str(settings.seed), participant, name))
    del drawn["tremor_mm"], drawn["drift_mm"]
    share = min(drawn.pop("expected_lag_share"), 1.0)
    drawn["visual_delay_s"] = min(drawn["visual_delay_s"], _LONGEST_DELAY_S)
    return Person(model=_MODELS[settings.model], expected_lag_s=share, **drawn)


def used_to_lag(person: Person, lag_s: float) -> Person:
    """The participant once they are used to a display that is `lag_s` late: they expect their share of that lag."""
    return person._replace(expected_lag_s=person.expected_lag_s * min(max(lag_s, 0.0), _LONGEST_DELAY_S))


def _drawn(trait: Trait, random: np.random.Generator) -> float:
    """A log-normal draw with the trait's mean and coefficient of variation: no trait is below zero."""
    spread = np.sqrt(np.log1p(trait.cv**2))
    return float(trait.mean * np.exp(spread * random.standard_normal() - spread**2 / 2))


@lru_cache(maxsize=8)
def sway(frequency_hz: float, damping_ratio: float, sd_mm: float) -> Sway:
    """A resonator whose position has the stated SD once it has settled, driven by noise through a 40-ms filter."""
    from scipy.linalg import expm, solve_discrete_lyapunov

    turning, filter_s = 2 * np.pi * frequency_hz, 0.04
    stiffness, damping = turning**2, 2 * damping_ratio * turning
    rates = np.array([[0.0, 1.0, 0.0], [-stiffness, -damping, 1.0], [0.0, 0.0, -1 / filter_s]])
    transition = expm(rates * STEP_S)
    settled = solve_discrete_lyapunov(transition, np.diag([0.0, 0.0, 1.0]))
    return Sway(np.ascontiguousarray(transition), float(sd_mm / np.sqrt(settled[0, 0])), stiffness, damping)
