"""The RMSE axis and the label of the lag axis, which the figures of accuracy share."""

from __future__ import annotations

import matplotlib as mpl
import matplotlib.ticker
import pandas as pd
from matplotlib.axes import Axes

from pipeline.words.accuracy_reference import SMOOTHED, reference_phrase

RECORDED = reference_phrase(())

_WIDE = 100.0  # ratio of the axis' ends above which only powers of ten have room for their numbers


def lag_label(standard: str = RECORDED) -> str:
    """The label of an axis of lags; `standard` is what estimates are compared with."""
    return f"Lag behind {standard} (ms)"


def along_rmse(axes: Axes, rmse_mm: pd.Series, standard: str = RECORDED) -> None:
    """Put RMSE along x, on a logarithmic scale if the largest is more than 15 times the smallest.

    `standard` is what estimates are compared with, as `reference_phrase` words it.
    """
    if rmse_mm.max() > 15 * rmse_mm.min() > 0:
        axes.set_xscale("log")
        low, high = axes.get_xlim()
        axes.xaxis.set_major_locator(mpl.ticker.LogLocator(subs=(1.0, 2.0, 5.0) if high < _WIDE * low else (1.0,)))
        axes.xaxis.set_major_formatter(mpl.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(mpl.ticker.NullFormatter())
    else:
        axes.set_xlim(left=0)
    axes.set_xlabel(f"RMSE {'from' if SMOOTHED in standard else 'against'} {standard} (mm)")
