"""A task of study.yaml in the form that the compiled participant takes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pipeline.errors import PipelineError
from pipeline.simulation.hand_steps import Layout
from pipeline.statistics.arrays import FloatArray
from pipeline.study.simulation import Ring, Task

_POINT_APART_MM = 1.0
_ON_PATH_MM = 5.0  # a target further from the path than this is not on it


def targets(task: Task) -> FloatArray:
    """The targets (k, 2) in the order in which they are selected."""
    if task.targets_mm:
        return np.array(task.targets_mm, dtype=np.float64)
    return np.concatenate([_of_ring(ring) for ring in task.rings])


def _diameters(task: Task) -> FloatArray:
    """The targets' diameters (k,)."""
    if task.targets_mm:
        return np.full(len(task.targets_mm), task.target_diameter_mm)
    return np.concatenate([np.full(ring.targets + 1, ring.target_diameter_mm) for ring in task.rings])


def _of_ring(ring: Ring) -> FloatArray:
    """The targets (k, 2) of a ring in order: each as far across from the last as possible, and the first once more."""
    half = (ring.targets + 1) // 2
    order = [step * half % ring.targets for step in range(ring.targets)] if ring.targets % 2 else []
    if not order:
        order = [place for pair in range(ring.targets // 2) for place in (pair, pair + ring.targets // 2)]
    angle = 2 * np.pi * np.array([*order, order[0]]) / ring.targets
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    found: FloatArray = np.array(ring.centre_mm) + ring.diameter_mm / 2 * around
    return found


def path_points(task: Task) -> FloatArray:
    """Points (n, 2) along the path, 1 mm apart; (0, 2) without one."""
    if not task.path_mm:
        return np.empty((0, 2))
    corners = np.array(task.path_mm, dtype=np.float64)
    pieces = [corners[:1]]
    for begin, end in pairwise(corners):
        count = max(1, round(float(np.linalg.norm(end - begin)) / _POINT_APART_MM))
        pieces.append(begin + (end - begin) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def layout(task: Task, where: str) -> Layout:
    """The task with each target's place on the path. Raises PipelineError, beginning with `where`, if one is off it."""
    path, wanted = path_points(task), targets(task)
    at = np.zeros(len(wanted), np.int64)
    begin = 0
    for index, target in enumerate(wanted if len(path) else ()):
        apart = np.linalg.norm(path[begin:] - target, axis=1)
        if apart.min() > _ON_PATH_MM:
            raise PipelineError(
                f"{where}: task: targets_mm: {target.tolist()} is {apart.min():.0f} mm off what is left of the path "
                "after the target before it; put it on the path"
            )
        at[index] = begin = begin + int(np.argmin(apart))
    window = (np.inf, np.inf) if task.window_mm is None else task.window_mm
    if task.window_mm is not None and not len(path):
        raise PipelineError(f"{where}: task: window_mm needs a path_mm, along which participants find the targets")
    return Layout(path, wanted, at, np.array(window, dtype=np.float64) / 2, _diameters(task) / 2)


def start(layout: Layout) -> FloatArray:
    """Where the hand (2,) is before the first target: at the begin of the path, or in the middle of the targets."""
    begin: FloatArray = layout.path_mm[0] if len(layout.path_mm) else layout.targets_mm.mean(axis=0)
    return begin
