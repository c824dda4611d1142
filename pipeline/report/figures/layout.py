"""The layout of the task: canvas, path, targets, and the window that the display shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.plane import square
from pipeline.report.figures.style import COLOURS, GREY, legend, panels, styled
from pipeline.words.numbers import percent
from pipeline.words.phrases import counted, listing

_CANVAS_MARGIN = 0.06
_TARGETS_NAMED = 30  # more numbers would lie on each other


class Ring(Protocol):
    """Targets on a circle."""

    @property
    def centre_mm(self) -> tuple[float, float]: ...
    @property
    def diameter_mm(self) -> float: ...
    @property
    def targets(self) -> int: ...
    @property
    def target_diameter_mm(self) -> float: ...


class Task(Protocol):
    """Where the targets are, in the tracker's x and y, and how much of it the display shows."""

    @property
    def canvas_x_mm(self) -> tuple[float, float]: ...
    @property
    def canvas_y_mm(self) -> tuple[float, float]: ...
    @property
    def window_mm(self) -> tuple[float, float] | None: ...
    @property
    def path_mm(self) -> Sequence[tuple[float, float]]: ...
    @property
    def targets_mm(self) -> Sequence[tuple[float, float]]: ...
    @property
    def target_diameter_mm(self) -> float: ...
    @property
    def rings(self) -> Sequence[Ring]: ...


def _task_layout_words(task: Task) -> Words:
    """How large the canvas is, how many targets it has, and what part the window shows."""
    size = [high - low for low, high in (task.canvas_x_mm, task.canvas_y_mm)]
    places = targets_of(task)
    diameters = sorted({diameter for _, _, diameter in places})
    summary = f"a canvas of {size[0]:g} × {size[1]:g} mm with {counted(len(places), 'target')}"
    summary += f" of {listing([f'{diameter:g}' for diameter in diameters])} mm" if diameters else ""
    if task.window_mm is not None:
        share = task.window_mm[0] * task.window_mm[1] / (size[0] * size[1])
        summary += (
            f"; the window of {task.window_mm[0]:g} × {task.window_mm[1]:g} mm shows {percent(share, 1)} of it at once"
        )
    return Words(f"The task: {summary}.", f"Layout of {summary}.")


@drawing(_task_layout_words)
@styled
def task_layout(task: Task) -> Figure:
    """The canvas with the path, the targets by number and size, and the window the display shows (paper, Fig. 11)."""
    (left, right), (bottom, top) = task.canvas_x_mm, task.canvas_y_mm
    figure, (axes,) = panels(height=0.9 + 6.2 * float(np.clip((top - bottom) / (right - left), 0.2, 0.9)))
    frame: dict[str, Any] = {"facecolor": "none", "edgecolor": GREY, "linewidth": 1}
    axes.add_patch(Rectangle((left, bottom), right - left, top - bottom, **frame))
    if task.path_mm:
        axes.plot(*np.transpose(task.path_mm), color=GREY, linewidth=1.4, zorder=1, label="path")
    places = targets_of(task)
    for number, (x, y, diameter) in enumerate(places, 1):
        axes.add_patch(Circle((x, y), diameter / 2, facecolor=COLOURS[0], alpha=0.85, linewidth=0, zorder=2))
        if len(places) <= _TARGETS_NAMED:
            axes.annotate(str(number), (x, y), (5, 5), textcoords="offset points", fontsize=8.5)
    axes.scatter([], [], color=COLOURS[0], label=f"targets (n = {len(places)})")
    if task.window_mm is not None and places:
        _window(axes, places[0][:2], task.window_mm)
    square(axes)
    across, down = _CANVAS_MARGIN * (right - left), _CANVAS_MARGIN * (top - bottom)
    axes.set_xlim(left - across, right + across)
    axes.set_ylim(bottom - down, top + down)
    legend(figure, figure.axes, 3)
    return figure


def targets_of(task: Task) -> list[tuple[float, float, float]]:
    """x, y and diameter in mm of every target, each once."""
    places = [(x, y, task.target_diameter_mm) for x, y in task.targets_mm]
    for ring in task.rings:
        angles = 2 * np.pi * np.arange(ring.targets) / ring.targets
        x = ring.centre_mm[0] + ring.diameter_mm / 2 * np.cos(angles)
        y = ring.centre_mm[1] + ring.diameter_mm / 2 * np.sin(angles)
        places += [(float(a), float(b), ring.target_diameter_mm) for a, b in zip(x, y, strict=True)]
    return places


def _window(axes: Axes, centre: tuple[float, float], size: tuple[float, float]) -> None:
    """What the display shows at once, centred on a place."""
    corner = (centre[0] - size[0] / 2, centre[1] - size[1] / 2)
    look: dict[str, Any] = {"facecolor": COLOURS[1], "alpha": 0.25, "edgecolor": COLOURS[1], "linewidth": 1.2}
    label = f"window, {size[0]:g} × {size[1]:g} mm, at target 1"
    axes.add_patch(Rectangle(corner, *size, zorder=1.5, label=label, **look))
