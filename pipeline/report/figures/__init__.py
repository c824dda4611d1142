"""Figures of the report and for notebooks.

Each is a `Drawing`: called with tables, whose columns docs/tables.md explains, it gives a matplotlib Figure. Its
`words` take the same tables and give a caption and a text alternative. `save` writes a figure as SVG.
"""

from __future__ import annotations

from pipeline.report.figures.box_plots import workload
from pipeline.report.figures.drawing import Drawing, Words
from pipeline.report.figures.error_and_lag import errors, lag_and_error
from pipeline.report.figures.excerpts import estimates, streams
from pipeline.report.figures.fitts_law import fitts
from pipeline.report.figures.group_clouds import groups
from pipeline.report.figures.hand_paths import path, paths
from pipeline.report.figures.layout import task_layout
from pipeline.report.figures.lead_curves import lead
from pipeline.report.figures.overlay import overlay
from pipeline.report.figures.power import Labels, power
from pipeline.report.figures.practice import practice
from pipeline.report.figures.quantile_plots import normality
from pipeline.report.figures.rainclouds import paired, scales
from pipeline.report.figures.selections import selection_errors
from pipeline.report.figures.sensor_noise import noise
from pipeline.report.figures.stated_sd import calibration
from pipeline.report.figures.style import draw, save
from pipeline.report.figures.timeline import timeline
from pipeline.report.figures.trial_by_trial import trials
from pipeline.report.figures.variants import trade_off

__all__ = [
    "Drawing",
    "Labels",
    "Words",
    "calibration",
    "draw",
    "errors",
    "estimates",
    "fitts",
    "groups",
    "lag_and_error",
    "lead",
    "noise",
    "normality",
    "overlay",
    "paired",
    "path",
    "paths",
    "power",
    "practice",
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
