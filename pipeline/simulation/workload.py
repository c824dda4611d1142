"""Ratings of a simulated session, by the response model that study.yaml states: judgement, and said to be so."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.sessions.recording import seeded
from pipeline.study.simulation import Workload


def ratings(
    model: Workload, seed: int, participant: str, condition: str, measured: Mapping[str, float]
) -> dict[str, float]:
    """A rating a scale: its base, what each doubling of a driver adds, the person's own level, and chance.

    `measured` holds the drivers of the session; one that is not finite adds nothing.
    """
    found = {}
    for name, scale in model.scales.items():
        level = model.person_sd * seeded(str(seed), participant, "rating", name).standard_normal()
        chance = model.noise_sd * seeded(str(seed), participant, condition, "rating", name).standard_normal()
        rating = scale.base + level + chance
        for driver, rise in scale.per_doubling.items():
            if np.isfinite(measured[driver]) and measured[driver] > 0:
                rating += rise * np.log2(measured[driver] / model.usual[driver])
        stepped = model.lowest + model.step * round((rating - model.lowest) / model.step)
        found[name] = float(np.clip(stepped, model.lowest, model.highest))
    return found
