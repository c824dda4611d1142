"""Ratings of a simulated session, by the response model that study.yaml states. It is an assumption, not a finding."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.sessions.recording import seeded
from pipeline.study.simulation import Workload


def ratings(
    model: Workload, seed: int, participant: str, condition: str, measured: Mapping[str, float]
) -> dict[str, float]:
    """One rating per scale: its base, plus a rise per doubling of each driver, the person's own level, and noise.

    `measured` holds the session's drivers; one that is not finite or not above 0 adds nothing.
    """
    rated = {}
    for name, scale in model.scales.items():
        level = model.person_sd * seeded(str(seed), participant, "rating", name).standard_normal()
        chance = model.noise_sd * seeded(str(seed), participant, condition, "rating", name).standard_normal()
        rating = scale.base + level + chance
        for driver, rise in scale.per_doubling.items():
            if np.isfinite(measured[driver]) and measured[driver] > 0:
                rating += rise * np.log2(measured[driver] / model.usual[driver])
        stepped = model.lowest + model.step * round((rating - model.lowest) / model.step)
        rated[name] = float(np.clip(stepped, model.lowest, model.highest))
    return rated
