"""Tables to figures: one function a figure, one look for all. Each takes tables and gives a matplotlib Figure.

Columns are those of pipeline.tables; `draw` and `save` write a figure as SVG.
"""

from __future__ import annotations

from pipeline.report.figures.accuracy import calibration, errors, lag_and_error, trade_off
from pipeline.report.figures.canvas import path, paths, selection_errors, task_layout
from pipeline.report.figures.outcomes import paired, scales, trials, workload
from pipeline.report.figures.power import Labels, power
from pipeline.report.figures.sensors import estimates, lead, noise, streams
from pipeline.report.figures.style import draw, save
from pipeline.report.figures.timeline import timeline

__all__ = [
    "Labels",
    "calibration",
    "draw",
    "errors",
    "estimates",
    "lag_and_error",
    "lead",
    "noise",
    "paired",
    "path",
    "paths",
    "power",
    "save",
    "scales",
    "selection_errors",
    "streams",
    "task_layout",
    "timeline",
    "trade_off",
    "trials",
    "workload",
]
