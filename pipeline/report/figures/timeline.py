"""Timeline: every session's streams, silences and events on one page."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import BLACK, COLOURS, GREY, MARKS_MAX, as_label, legend, panels, styled
from pipeline.statistics.arrays import FloatArray
from pipeline.tables.columns import S_PER_NS
from pipeline.words.numbers import number
from pipeline.words.phrases import counted

_GAP_TIMES = 5  # a silence is marked if it is so many times the usual interval
_ROW = 0.17  # inches
_SHADES = 20  # shares are rounded to so many steps
_PALE = 0.93
_CROSS: dict[str, Any] = {"marker": "X", "color": COLOURS[5], "edgecolor": BLACK, "linewidths": 0.5, "s": 26}


def _timeline_words(stream_rates: pd.DataFrame, events: pd.DataFrame, exclusions: pd.DataFrame) -> Words:
    """How many silences there are, the longest one, and how many sessions were set aside."""
    sessions, silent = stream_rates["session"].nunique(), silences(stream_rates)
    summary = f"{counted(sessions, 'session')}, {counted(len(silent), 'stretch', 'stretches')} with a silence"
    if len(silent):
        worst = silent.iloc[int(np.argmax(silent["gap_max_s"].to_numpy(np.float64)))]
        summary += f", the longest {number(float(worst['gap_max_s']), 2)} s ({worst['session']}, {worst['stream']})"
    aside = len(set_aside(exclusions))
    summary += f"; {counted(aside, 'session')} set aside." if aside else "; none set aside."
    return Words(
        f"What arrived when, one row per stream of each session: {summary} The paler a stretch, the fewer messages"
        " arrived; a cross marks a silence of at least five usual intervals and 50 ms.",
        f"Timeline of every session's streams. {summary}",
    )


@drawing(_timeline_words)
@styled
def timeline(stream_rates: pd.DataFrame, events: pd.DataFrame, exclusions: pd.DataFrame) -> Figure:
    """One row per stream of each session, shaded by how many of its usual messages arrived, with silences and events.

    The arguments are the tables of these names. Sessions that were set aside stand below, as dotted lines.
    """
    sessions = list(dict.fromkeys(stream_rates["session"]))
    aside = [session for session in map(str, set_aside(exclusions)) if session not in sessions]
    rows = [(str(session), str(stream)) for session, stream in _rows(stream_rates)]
    height = 1.1 + _ROW * (len(rows) + 0.6 * len(sessions) + 1.4 * len(aside))
    figure, (axes,) = panels(height=height)
    at, place = {}, 0.0
    labels = []
    for session in sessions:
        streams = [stream for owner, stream in rows if owner == session]
        for stream in streams:
            at[session, stream] = place
            heading = f"{as_label(session, 22)}  " if stream == streams[0] else ""
            labels.append((place, heading + as_label(stream, 12)))
            place += 1
        _events(axes, stream_rates, events, session, (place - len(streams) - 0.5, place - 0.5))
        place += 0.6
    shares = _shares(stream_rates)
    _cells(axes, shares, at)
    _silences(axes, shares, at)
    end = float((shares["begin_s"] + shares["duration_s"]).max()) if len(shares) else 1.0
    for session in aside:
        axes.plot([0, end], [place, place], color=GREY, linewidth=1, linestyle=(0, (1, 2)))
        labels.append((place, f"{as_label(session, 22)}  set aside"))
        place += 1.4
    axes.set_yticks([where for where, _ in labels], [label for _, label in labels])
    axes.tick_params(axis="y", length=0, labelsize=7.5)
    axes.set_ylim(place - 0.4, -0.9)
    axes.set_xlim(0, end)
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("Time since the session's first message (s)")
    _legend(figure, axes)
    return figure


def _rows(stream_rates: pd.DataFrame) -> list[tuple[object, object]]:
    return list(dict.fromkeys(zip(stream_rates["session"], stream_rates["stream"], strict=True)))


def set_aside(exclusions: pd.DataFrame) -> list[str]:
    """The sessions of `exclusions` that were set aside."""
    return list(exclusions.loc[exclusions["what"] == "session set aside", "session"].dropna())


def _shares(stream_rates: pd.DataFrame) -> pd.DataFrame:
    """`stream_rates` with begin_s since the session's first message, and which share of the usual messages arrived."""
    first = stream_rates.groupby("session")["time_ns"].transform("min")
    rate = stream_rates["messages"].astype("float64") / stream_rates["duration_s"]
    usual = rate.groupby([stream_rates["session"], stream_rates["stream"]]).transform("median")
    return stream_rates.assign(
        begin_s=(stream_rates["time_ns"] - first).astype("float64") * S_PER_NS,
        share=(rate / usual.where(usual > 0)).clip(0, 1).fillna(0.0),
        usual_s=1 / usual.where(usual > 0),
    )


def silences(stream_rates: pd.DataFrame) -> pd.DataFrame:
    """The stretches with a silence of at least 50 ms and five times the usual interval of the stream."""
    shares = _shares(stream_rates)
    return shares[(shares["gap_max_s"] > _GAP_TIMES * shares["usual_s"]) & (shares["gap_max_s"] > 0.05)]


def _cells(axes: Axes, shares: pd.DataFrame, at: dict[tuple[str, str], float]) -> None:
    """Draw a box for as long as about the same share arrives, paler the fewer arrive."""
    shade = (shares["share"] * _SHADES).round() / _SHADES
    row = pd.Series([at[str(a), str(b)] for a, b in zip(shares["session"], shares["stream"], strict=True)])
    cells = pd.DataFrame({"row": row.to_numpy(), "shade": shade.to_numpy(), "begin": shares["begin_s"].to_numpy()})
    cells["end"] = cells["begin"] + shares["duration_s"].to_numpy()
    run = (cells[["row", "shade"]].diff() != 0).any(axis=1).cumsum()
    boxes = cells.groupby(run).agg({"row": "first", "shade": "first", "begin": "first", "end": "last"})
    x: FloatArray = boxes[["begin", "end", "end", "begin"]].to_numpy(np.float64)
    y = boxes["row"].to_numpy(np.float64)[:, None] + np.array([-0.4, -0.4, 0.4, 0.4])
    full = np.array([0x00, 0x72, 0xB2]) / 255
    colours = _PALE - boxes["shade"].to_numpy(np.float64)[:, None] * (_PALE - full)
    drawn = PolyCollection(list(np.stack([x, y], axis=2)), facecolors=colours, linewidths=0)
    drawn.set_rasterized(len(boxes) > MARKS_MAX)
    axes.add_collection(drawn)


def _silences(axes: Axes, shares: pd.DataFrame, at: dict[tuple[str, str], float]) -> None:
    silent = silences(shares)
    y = [at[str(a), str(b)] for a, b in zip(silent["session"], silent["stream"], strict=True)]
    middle = silent["begin_s"] + silent["duration_s"] / 2
    look: dict[str, Any] = _CROSS | {"zorder": 3}
    axes.scatter(middle, y, rasterized=len(silent) > MARKS_MAX, **look)


def _events(
    axes: Axes, stream_rates: pd.DataFrame, events: pd.DataFrame, session: str, rows: tuple[float, float]
) -> None:
    """Draw the starts of trials as lines across the session's rows, and selections as marks above them."""
    of_session = events[events["session"] == session]
    first = stream_rates.loc[stream_rates["session"] == session, "time_ns"].min()
    time = (of_session["time_ns"] - first).astype("float64") * S_PER_NS
    many: dict[str, Any] = {"rasterized": len(events) > MARKS_MAX}
    starts, chosen = time[of_session["type"] == "trial_start"], time[of_session["type"] == "selection"]
    axes.vlines(starts, rows[0], rows[1], color=BLACK, linewidth=0.7, zorder=2, **many)
    axes.scatter(chosen, np.full(len(chosen), rows[0] - 0.1), s=9, marker="v", color=BLACK, linewidth=0, **many)


def _legend(figure: Figure, axes: Axes) -> None:
    """Explain shades and marks."""
    axes.scatter([], [], marker="s", color=COLOURS[0], label="as many messages as usual")
    axes.scatter([], [], marker="s", color="#ededed", label="none")
    axes.scatter([], [], label="silence", **_CROSS)
    axes.plot([], [], color=BLACK, linewidth=0.9, label="trial's start")
    axes.scatter([], [], marker="v", color=BLACK, s=12, label="selection")
    legend(figure, figure.axes, 5)
