"""How wide the target of each trial is, as far as the study's task says it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.statistics.arrays import FloatArray
from pipeline.study.simulation import Ring, Task

_APART_MM = 1.0  # a logged target further from a place of the task is another one


def widths_mm(task: Task | None, target_mm: FloatArray) -> FloatArray:
    """The diameters (n,) of the targets (n, 2 or more) of successive trials; NaN where the task does not tell.

    Rings of the same circle may have targets of different diameters. Then a session of as many trials as the task has
    is taken to follow the task's order, ring after ring, each with its first target once more at its end.
    """
    widths = np.full(len(target_mm), np.nan)
    if task is None or not len(target_mm):
        return widths
    places = target_mm[:, :2]
    if task.targets_mm:
        apart = np.linalg.norm(places[:, None] - np.array(task.targets_mm)[None], axis=2)
        return np.where((apart <= _APART_MM).any(axis=1), task.target_diameter_mm, np.nan)
    diameters = np.array([ring.target_diameter_mm for ring in task.rings])
    on_ring = np.column_stack([_on(ring, places) for ring in task.rings])
    in_turn = np.repeat(np.arange(len(task.rings)), [ring.targets + 1 for ring in task.rings])
    for index, candidates in enumerate(on_ring):
        if candidates.any() and np.ptp(diameters[candidates]) == 0:
            widths[index] = diameters[candidates][0]
        elif len(in_turn) == len(places) and candidates[in_turn[index]]:
            widths[index] = diameters[in_turn[index]]
    return widths


def _on(ring: Ring, places: FloatArray) -> npt.NDArray[np.bool_]:
    """Which places (n, 2) lie on the circle of a ring."""
    from_centre = np.linalg.norm(places - np.array(ring.centre_mm), axis=1)
    on: npt.NDArray[np.bool_] = np.abs(from_centre - ring.diameter_mm / 2) <= _APART_MM
    return on
