"""Where selections landed relative to their targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.plane import XY, Plane, square
from pipeline.report.figures.style import (
    BLACK,
    GREY,
    MARKS_MAX,
    PALE,
    WIDTH,
    as_label,
    colour,
    finite,
    headed,
    marker,
    multiples,
    styled,
)
from pipeline.report.figures.wording import listed
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import number
from pipeline.words.phrases import counted

_PANEL = 3.4  # inches: the highest


def _selection_errors_words(
    selections: pd.DataFrame, conditions: Sequence[str], plane: Plane = XY, px_per_mm: float | None = None
) -> Words:
    """Each condition's mean error and the size of its ellipse."""
    scale, unit = (1.0, "mm") if px_per_mm is None else (px_per_mm, "px")
    parts = []
    for condition in conditions:
        rows = selections[selections["condition"] == condition]
        offsets = scale * offsets_mm(rows, plane)
        if not len(offsets):
            parts.append(f"{condition}: none")
            continue
        x, y = offsets.mean(axis=0)
        ellipse = ellipse_95(offsets)
        lengths = () if ellipse is None else [number(length, 1) for length in ellipse.lengths]
        size = f", ellipse {' × '.join(lengths)} {unit}" if lengths else ""
        people = counted(rows["participant"].nunique(), "participant")
        parts.append(
            f"{condition}: n = {number(len(offsets), 0)}, {people}, mean ({number(x, 1)}, {number(y, 1)}) {unit}{size}"
        )
    summary = f"{listed(parts)}."
    return Words(
        "Where selections landed relative to their target, which is at zero; the cross is the mean, and the ellipse"
        f" would contain 95 % of further selections if they were normally distributed and independent. {summary}",
        f"Scatter of selection errors in {plane[0]} and {plane[1]} by condition. {summary}",
    )


@drawing(_selection_errors_words)
@styled
def selection_errors(
    selections: pd.DataFrame, conditions: Sequence[str], plane: Plane = XY, px_per_mm: float | None = None
) -> Figure:
    """Where selections landed relative to their targets: one panel per condition, with mean and 95 % ellipse.

    `selections` has the columns of that table. The axes are in pixels if `px_per_mm` is given, else in mm.
    """
    scale, unit = (1.0, "mm") if px_per_mm is None else (px_per_mm, "px")
    across = min(len(conditions), 4)
    figure, every, across = multiples(len(conditions), min(WIDTH / across * 0.92, _PANEL), a_row=4)
    reach = 0.0
    for index, (axes, condition) in enumerate(zip(every, conditions, strict=True)):
        rows = selections[selections["condition"] == condition]
        offsets = scale * offsets_mm(rows, plane)
        reach = max(reach, _scatter(axes, offsets, (colour(index), marker(index))))
        headed(axes, f"{as_label(condition, 80 // across)} (n = {number(len(offsets), 0)})", fontsize=9)
        axes.axhline(0, color=GREY, linewidth=0.6, zorder=0)
        axes.axvline(0, color=GREY, linewidth=0.6, zorder=0)
        square(axes, plane, unit)
        axes.set_xlabel(f"Error, {plane[0]} ({unit})")
        axes.set_ylabel(f"Error, {plane[1]} ({unit})" if index % across == 0 else "")
        axes.grid(color=PALE, linewidth=0.6)
        axes.set_axisbelow(True)
    reach = 1.05 * reach or 1.0
    every[0].set_xlim(-reach, reach)
    every[0].set_ylim(-reach, reach)
    return figure


def offsets_mm(selections: pd.DataFrame, plane: Plane) -> FloatArray:
    """Selected minus target (n, 2) in mm, of the selections that have both in this plane."""
    parts = [selections[f"{axis}_mm"].to_numpy(np.float64) - selections[f"target_{axis}_mm"] for axis in plane]
    offsets = np.column_stack(parts).astype(np.float64)
    known: FloatArray = offsets[np.isfinite(offsets).all(axis=1)]
    return known


def _scatter(axes: Axes, offsets: FloatArray, look: tuple[str, str]) -> float:
    """Draw selections, their mean and ellipse; return how far from zero the outermost part is."""
    if not len(offsets):
        return 0.0
    shade, mark = look
    many = len(offsets) > MARKS_MAX // 4  # of several panels, one per condition
    axes.scatter(offsets[:, 0], offsets[:, 1], s=9, color=shade, marker=mark, alpha=0.4, linewidth=0, rasterized=many)
    ellipse = ellipse_95(offsets)
    reach = float(np.abs(offsets).max())
    if ellipse is not None:
        patch = Ellipse(ellipse.centre, *ellipse.lengths, angle=ellipse.angle_deg)
        patch.set(facecolor="none", edgecolor=BLACK, linewidth=1.3, zorder=3)
        axes.add_patch(patch)
        reach = max(reach, float(np.abs(ellipse.centre).max() + max(ellipse.lengths) / 2))
    axes.plot(*offsets.mean(axis=0), "+", color=BLACK, markersize=9, markeredgewidth=1.6, zorder=4)
    return reach


@dataclass(frozen=True)
class Ellipse95:
    """Centre, lengths of the major and the minor axis, and the angle of the major one from the plane's first axis."""

    centre: tuple[float, float]
    lengths: tuple[float, float]
    angle_deg: float


def ellipse_95(points: FloatArray) -> Ellipse95 | None:
    """The ellipse that contains a further point of the same bivariate normal with 95 %; None for less than four.

    T² of one new observation: its squared Mahalanobis distance is below 2 (n² − 1) / (n (n − 2)) · F(2, n − 2)
    (Johnson and Wichern, Applied Multivariate Statistical Analysis, 5.4). None where all points lie on one line.
    """
    from scipy import stats

    n = len(points)
    if n < 4:
        return None
    variances, directions = np.linalg.eigh(np.cov(finite(points).reshape(n, 2), rowvar=False))
    if not variances[0] > 1e-12 * variances[1]:
        return None
    squared = 2 * (n**2 - 1) / (n * (n - 2)) * stats.f.ppf(0.95, 2, n - 2)
    lengths = 2 * np.sqrt(squared * variances[::-1])
    along = directions[:, 1]
    x, y = points.mean(axis=0)
    angle = float(np.degrees(np.arctan2(along[1], along[0])))
    return Ellipse95((float(x), float(y)), (float(lengths[0]), float(lengths[1])), angle)
