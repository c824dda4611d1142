"""The plane that people pointed in."""

from __future__ import annotations

from matplotlib.axes import Axes

from pipeline.report.figures.style import grouped

Plane = tuple[str, str]
XY: Plane = ("x", "y")


def square(axes: Axes, plane: Plane = XY, unit: str = "mm") -> None:
    """Make a millimetre as long in both directions, and name the axes."""
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel(f"{plane[0]} ({unit})")
    axes.set_ylabel(f"{plane[1]} ({unit})")
    axes.xaxis.set_major_formatter("{x:g}")
    grouped(axes)
