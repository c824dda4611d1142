"""How well each estimator follows the hand: the paper's Table 1 and Figures 6, 8 and 9 for any study."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from fusion_core import FloatArray, Samples, accuracy
from pipeline import figures, recording, tables
from pipeline.document.model import Block, Paragraph, Section, Strong, Table, columns
from pipeline.figures import View
from pipeline.recording import SMOOTHED, Recording
from pipeline.sections.material import Material, Row
from pipeline.wording import NOTHING, counted, number, percent, seconds

_VIEW_S = 4.0  # long enough for a reach, short enough to see single frames
_ROWS_MAX = 120


SMOOTHED_REMARK = (
    " Estimates are held against all readings smoothed, before and after each instant, by the fusion filter. That"
    " leaves out whatever all sensors have wrong together, and is kinder to estimators that resemble it."
)


def section(material: Material) -> Section | None:
    """Fusion accuracy; None for a study of tables alone."""
    if not material.sessions or not material.study.estimators:
        return None
    rows = material.rows("accuracy")
    blocks: list[Block] = [Paragraph(_method(material))]
    if rows:
        if any(row["reference"] == SMOOTHED for row in rows):
            blocks.append(Paragraph((Strong("No reference was recorded."), SMOOTHED_REMARK)))
        blocks.append(_summary_table(material, rows))
        blocks.append(_error_figure(material, pd.DataFrame(rows)))
    else:
        blocks.append(Paragraph(("The logs hold no reference position, so errors cannot be given.",)))
    blocks += _session_figures(material)
    if rows and len(material.sessions) > 1:
        blocks.append(_session_table(rows))
    return Section("accuracy", "Fusion accuracy", tuple(blocks))


def _method(material: Material) -> tuple[str | Strong, ...]:
    listed = [f"{name} ({settings.type})" for name, settings in material.study.estimators.items()]
    return (
        (
            "Every estimator was run over the same raw streams and asked, at the arrival of each acceleration, where"
            " the hand is at that instant, from what had arrived by then. Estimators: "
        ),
        Strong("; ".join(listed)),
        ".",
    )


def _summary_table(material: Material, rows: list[Row]) -> Table:
    titles = (
        "Estimator",
        "RMSE (mm)",
        "Stated SD (mm)",
        "In 95 % interval",
        "Lag (ms)",
        "Lead, paper's (ms)",
        "Jitter at rest (mm)",
    )
    cells = tuple(
        (
            row["estimator"],
            number(row["rmse_mm"], 2),
            number(row["sd_mm"], 2),
            percent(row["coverage_95"], 0),
            seconds(row["lag_s"]),
            seconds(row["lead_xcorr_s"]),
            number(row["jitter_mm"], 2),
        )
        for row in material.rows("accuracy_means")
    )
    n, axes = len({row["session"] for row in rows}), len(material.study.axes)
    where = f"{axes} axes together" if axes > 1 else f"along {material.study.axes[0]}"
    return Table(
        "table-accuracy",
        f"Accuracy of each estimator against the reference, means over {counted(n, 'session')} ({where}). Lower is"
        " better in all columns but the third, which should be near 95 %.",
        columns(titles, 1),
        cells,
        "RMSE: root mean square distance to the reference. Stated SD: the error the estimator says it makes. In 95 % "
        "interval: share of instants and axes where the reference is within 1.96 stated SDs. Lag: the shift that fits "
        "the reference best, positive = late. Lead: the paper's measure, the peak of the cross-correlation with the "
        "tracker as it arrived, positive = ahead of it; fragile where the hand moves only once or drifts. Jitter: SD "
        "while the hand is slower than 20 mm/s.",
    )


def _session_table(rows: list[Row]) -> Table:
    titles = (
        "Session",
        "Estimator",
        "RMSE (mm)",
        "Stated SD (mm)",
        "In 95 % interval",
        "Lag (ms)",
        "95 % interval (ms)",
        "Jitter (mm)",
    )
    cells = tuple(
        (
            row["session"],
            row["estimator"],
            number(row["rmse_mm"], 2),
            number(row["sd_mm"], 2),
            percent(row["coverage_95"], 0),
            seconds(row["lag_s"]),
            NOTHING if row["lag_low_s"] is None else f"[{seconds(row['lag_low_s'])}, {seconds(row['lag_high_s'])}]",
            number(row["jitter_mm"], 2),
        )
        for row in rows[:_ROWS_MAX]
    )
    more = (
        f" The first {_ROWS_MAX} of {len(rows)} rows; all are in tables/accuracy.csv." if len(rows) > _ROWS_MAX else ""
    )
    return Table(
        "table-accuracy-sessions",
        f"The same for each session, the lag with its 95 % interval.{more}",
        columns(titles, 2),
        cells,
        "Intervals of the lag: moving-block bootstrap, blocks of 0.5 s.",
    )


def _error_figure(material: Material, rows: pd.DataFrame) -> Block:
    n = rows["session"].nunique()
    best = rows.groupby("estimator")["rmse_mm"].mean().idxmin()
    return material.figure(
        "accuracy",
        figures.errors,
        f"Error (left) and lag (right) of each estimator, a small mark a session (n = {n}), the large one their mean. "
        "An estimator that helps sits to the left in both.",
        f"Dot plot of RMSE and lag by estimator over {n} sessions; {best} has the lowest mean RMSE.",
        rows,
    )


def _session_figures(material: Material) -> list[Block]:
    """The paper's figures for one session: the first that can be used."""
    session = material.sessions[0]
    loaded = recording.load(material.study, material.ingested[0])
    tracks = tables.read("tracks", material.fused[0])
    if tracks.empty or not loaded.samples:
        return []
    view = _view(material, loaded, tracks)
    span = f"session {session.id}, axis {view.axis}, the {_VIEW_S:g} s with most movement"
    blocks: list[Block] = [
        material.figure(
            "streams",
            figures.streams,
            f"What the sensors delivered ({span}). The tracker's frames are noisy and come late; the accelerations are "
            "prompt.",
            f"Tracker positions over time with the reference, and accelerations below, for {span}.",
            view,
        )
    ]
    if view.tracks:
        blocks.append(
            material.figure(
                "estimates",
                figures.estimates,
                f"What each estimator makes of them ({span}): its mean and two stated SDs, and beside it its error in"
                " the band it states. Look whether it runs behind the reference, how much it trembles, and whether the"
                " error stays in the band.",
                f"One panel an estimator ({', '.join(view.tracks)}) with mean, band, reference and tracker frames.",
                view,
            )
        )
    return blocks + _lead_figure(material, loaded, tracks, session.id)


def _view(material: Material, loaded: Recording, tracks: pd.DataFrame) -> View:
    """The stretch and axis with the largest movement of the tracker."""
    study = material.study
    tracker = loaded.samples[study.stream_of_kind("position") or next(iter(loaded.samples))]
    axis, begin = _liveliest(tracker)
    end = begin + _VIEW_S

    def cut(time: FloatArray, *values: FloatArray) -> tuple[FloatArray, ...]:
        inside = (time >= begin) & (time <= end)
        return tuple(array[inside] for array in (time, *values))

    accelerations = study.stream_of_kind("acceleration")
    felt = loaded.samples.get(accelerations) if accelerations else None
    shown: dict[str, Any] = {}
    letter = study.axes[axis]
    for name, rows in tracks.groupby("estimator", sort=False):
        time = (rows["time_ns"].to_numpy(np.int64) - loaded.origin_ns) * tables.NANOSECONDS
        mean, sd = (rows[column].to_numpy(np.float64) for column in (f"{letter}_mm", f"sd_{letter}_mm"))
        part = cut(time, mean, sd)
        if study.estimators[str(name)].type != "raw" and len(part[0]):
            shown[str(name)] = part
    pair: Mapping[str, Any] = {
        "reference": None if loaded.reference is None else cut(loaded.reference.time, loaded.reference.value[:, axis]),
        "accelerations": None if felt is None or len(felt) == 0 else cut(felt.time, felt.value[:, axis]),
    }
    frames = cut(tracker.arrival, tracker.value[:, axis])
    return View(letter, (frames[0], frames[1]), tracks=shown, **pair)


def _liveliest(tracker: Samples) -> tuple[int, float]:
    """Axis, and beginning of the stretch, in which the tracker covers most ground."""
    best = (-1.0, 0, float(tracker.arrival[0]))
    for begin in np.arange(tracker.arrival[0], max(tracker.arrival[-1] - _VIEW_S, tracker.arrival[0]) + 1e-9, 0.5):
        inside = (tracker.arrival >= begin) & (tracker.arrival <= begin + _VIEW_S)
        if inside.sum() < 2:
            continue
        ranges = np.ptp(tracker.value[inside], axis=0)
        axis = int(np.argmax(ranges))
        if ranges[axis] > best[0]:
            best = (float(ranges[axis]), axis, float(begin))
    return best[1], best[2]


def _lead_figure(material: Material, loaded: Recording, tracks: pd.DataFrame, session: str) -> list[Block]:
    name = material.study.stream_of_kind("position")
    if name is None:
        return []
    curves, peaks = {}, {}
    for estimator, rows in tracks.groupby("estimator", sort=False):
        time = (rows["time_ns"].to_numpy(np.int64) - loaded.origin_ns) * tables.NANOSECONDS
        settled = time >= loaded.samples[name].arrival[0] + 1.0
        mean = rows[[f"{axis}_mm" for axis in material.study.axes]].to_numpy(np.float64)
        curve = accuracy.lead_curve(time[settled], mean[settled], loaded.samples[name])
        if curve is not None and np.max(np.abs(curve[1])) > 0:
            curves[str(estimator)] = curve
            peaks[str(estimator)] = accuracy.lead_by_cross_correlation(
                time[settled], mean[settled], loaded.samples[name]
            )
    if not curves:
        return []
    return [
        material.figure(
            "lead",
            figures.lead,
            f"How far each estimator is ahead of the tracker as it arrived, by the paper's method (session {session}): "
            "the marks are the peaks. Flat tops make the peak fragile; the lag above does not rest on it.",
            f"Cross-correlation curves of {', '.join(curves)} with the tracker, peaks marked.",
            curves,
            peaks,
        )
    ]
