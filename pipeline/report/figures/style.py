"""The style that all figures share: colours that colour-blind readers can distinguish, labels, panels, and saving."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec

import matplotlib as mpl
import matplotlib.font_manager
import matplotlib.ticker
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from pipeline.report.figures.named_marks import titled
from pipeline.report.glyphs import FALLBACK, FAMILY, FONTS, showable
from pipeline.statistics import T
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import MINUS, THIN_SPACE

Drawn = ParamSpec("Drawn")
Place = Literal["outside upper left", "outside lower left", "outside right center"]

# Okabe and Ito (2008), darkest first, so that neighbours also differ in print without colour.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
BLACK = COLOURS[6]
FAMILIES = [FAMILY, FALLBACK]
GREY = "#6b757d"
PALE = "#e3e7ea"
MARKS_MAX = 2000  # more are drawn as a bitmap, since an SVG with each of them is slow to open
WIDTH = 7.2  # inches: the width of a page's text
_PANELS_A_ROW = 4
_NAME_LENGTH = 32
_TICKS = 8.5

_STYLE: dict[Any, Any] = {
    "font.family": FAMILIES,
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "xtick.labelsize": _TICKS,
    "ytick.labelsize": _TICKS,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.4,
    "figure.constrained_layout.use": True,
    "text.parse_math": False,  # a name with two dollar signs is a name
    "svg.fonttype": "path",
    "svg.hashsalt": "steadyhand",
    "savefig.dpi": 150,  # of bitmaps
}


matplotlib.font_manager.fontManager.addfont(FONTS / "SteadyhandSans-Regular.ttf")


def styled(function: Callable[Drawn, Figure]) -> Callable[Drawn, Figure]:
    """Draw a figure in the report's style, whatever style a notebook has set."""

    @wraps(function)
    def drawn(*arguments: Drawn.args, **named: Drawn.kwargs) -> Figure:
        with mpl.rc_context(_STYLE):
            figure = function(*arguments, **named)
            label_ticks(figure)
        return figure

    return drawn


def label_ticks(figure: Figure) -> None:
    """Have matplotlib make the labels of ticks, which it else does when they are asked for, in the style of then."""
    for axes in figure.axes:
        axes.get_xticklabels()
        axes.get_yticklabels()


def save(figure: Figure, path: Path) -> None:
    """A figure as SVG, the same bytes for the same data.

    The canvas lays it out as it draws it. `savefig` would draw all of it once before, which takes a third of the time.
    """
    canvas, dpi = figure.canvas, figure.dpi
    try:
        with mpl.rc_context(_STYLE):
            figure.dpi = mpl.rcParams["savefig.dpi"]
            svg: Any = FigureCanvasSVG(figure)
            written = io.StringIO()
            svg.print_svg(written, metadata={"Date": None, "Creator": "Steadyhand"})
        path.write_text(titled(written.getvalue()), encoding="utf-8", newline="\n")
    finally:
        figure.set_canvas(canvas)
        figure.dpi = dpi


def draw(function: Callable[..., Figure], path: Path, *arguments: Any) -> None:
    """Draw a figure and save it as SVG."""
    save(function(*arguments), path)


def as_label(text: object, length: int = _NAME_LENGTH) -> str:
    """A name as a label: characters that the font lacks are replaced, and a long name is cut to leave room for data."""
    shown = showable(str(text))
    if shown.startswith("_"):  # matplotlib leaves such names out of legends
        shown = THIN_SPACE + shown
    return shown if len(shown) <= length else f"{shown[: length - 1]}…"


def colour(index: int) -> str:
    """The colour of the condition or estimator at this place."""
    return COLOURS[index % len(COLOURS)]


def marker(index: int) -> str:
    """The marker of the condition or estimator at this place."""
    return MARKERS[index % len(MARKERS)]


def panels(rows: int = 1, columns: int = 1, height: float = 3.0, **options: Any) -> tuple[Figure, list[Axes]]:
    """A figure as wide as a page and its panels, row by row."""
    figure = Figure(figsize=(WIDTH, height))
    return figure, list(np.atleast_1d(figure.subplots(rows, columns, **options)).ravel())


def multiples(
    count: int, row_height: float, a_row: int = _PANELS_A_ROW, **options: Any
) -> tuple[Figure, list[Axes], int]:
    """A figure of `count` small panels with shared scales, the panels, and how many stand in a row.

    Axes are labelled at the left and at the bottom, also in a panel above a place that stays empty.
    """
    down = -(-count // a_row)
    across = -(-count // down)  # four by three a row are two and two, not three and one
    shared: dict[str, Any] = {"sharex": True, "sharey": True} | options
    figure, every = panels(down, across, 0.6 + row_height * down, **shared)
    for axes in every:
        axes.locator_params(nbins=4)
    for spare in every[count:]:
        spare.set_visible(False)
        if shared["sharex"]:
            every[every.index(spare) - across].tick_params(labelbottom=True)
    return figure, every[:count], across


def lowest(every: Sequence[Axes], across: int) -> list[Axes]:
    """The panels with none below them."""
    return list(every[-across:])


def legend(figure: Figure, axes: Iterable[Axes], columns: int = 4, place: Place = "outside upper left") -> None:
    """A legend outside the panels that explains each label once; none if nothing has a label."""
    handles: dict[str, Artist] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        figure.legend(list(handles.values()), list(handles), loc=place, ncols=columns)


def mean_and_interval(values: FloatArray, method: str = T) -> tuple[float, float, float]:
    """Mean and the ends of its 95 % interval by a method of `statistics.descriptive`; NaN for what there is none of."""
    from pipeline.statistics.descriptive import mean_interval

    mean = float(np.mean(values)) if len(values) else np.nan
    return mean, *(mean_interval(values, method) or (np.nan, np.nan))


def finite(values: Any) -> FloatArray:
    """The finite values, as an array (n,)."""
    array = np.asarray(values, dtype=np.float64)
    known: FloatArray = array[np.isfinite(array)]
    return known


def draw_mean(
    axes: Axes, at: float, values: FloatArray, look: tuple[str, str], upright: bool = True, method: str = T
) -> None:
    """Draw a mean with its 95 % interval at a place on the axis; `look` is colour and marker."""
    mean, low, high = mean_and_interval(values, method)
    shade, mark = look
    place = ([at], [mean]) if upright else ([mean], [at])
    ends: dict[str, Any] = {"yerr" if upright else "xerr": arms_of(mean, low, high)}
    axes.errorbar(
        *place,
        **ends,
        fmt=mark,
        color=shade,
        markersize=8,
        markeredgecolor="white",
        capsize=4,
        linewidth=2,
        zorder=4,
    )


def arms_of(mean: float, low: float, high: float) -> FloatArray | None:
    """The interval of a single mean as matplotlib takes it; None where there is none."""
    return None if np.isnan(low) else arms(*(np.array([value]) for value in (mean, low, high)))


def arms(middle: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Intervals as matplotlib takes them: distances below and above the middle (2, n), 0 where there is no interval."""
    return np.nan_to_num(np.maximum(0, np.stack([middle - low, high - middle])))


def grouped(axes: Axes) -> None:
    """Group the thousands on the value axis, and write a true minus sign."""
    axes.yaxis.set_major_formatter(
        mpl.ticker.FuncFormatter(lambda value, _: f"{value:,.10g}".replace(",", THIN_SPACE).replace("-", MINUS))
    )


def headed(axes: Axes, title: str, **look: Any) -> None:
    """A title above a panel whose upright axis has no factor such as 1e6 above it.

    It has none where it is `grouped`, and where it has names, or numbers near 0. matplotlib would move the title out of
    a factor's way; told where the title is, it need not look, which it does three times a panel with every label
    measured: a fifteenth of what drawing costs.
    """
    axes.set_title(title, y=1.0, **look)


def as_pixels(axes: Axes, marks: int) -> float:
    """The zorder for a panel with so many marks; if there are too many, they become one bitmap."""
    if marks <= MARKS_MAX:
        return 2.0
    axes.set_rasterization_zorder(0)
    return -1.0


def thinned(count: int, most: int) -> slice:
    """Slice that keeps at most `most` of `count` points, evenly spaced."""
    return slice(None, None, max(1, -(-count // most)))
