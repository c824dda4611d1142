"""What to see in each figure, said from the data it shows: a function a figure, of that figure's arguments."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.report.figures.accuracy import LINES_MAX, shares
from pipeline.report.figures.canvas import XY, Plane, Task, ellipse_95, offsets_mm, targets_of, way
from pipeline.report.figures.sensors import errors_in, peak_s
from pipeline.report.figures.style import finite, mean_and_interval
from pipeline.report.figures.timeline import set_aside, silences
from pipeline.statistics.arrays import FloatArray
from pipeline.words import (
    MINUS,
    counted,
    interval,
    listing,
    measure_label,
    number,
    percent,
    seconds,
    short_label,
    unit_of,
)

_NAMED = 8  # what a sentence can list


class Said(NamedTuple):
    """What to see in a figure, and what it shows for who cannot see it."""

    caption: str
    alt: str


def _mean(values: FloatArray, digits: int = 2) -> str:
    """A mean, and its 95 % interval where there is one."""
    mean, half = mean_and_interval(values)
    return number(mean, digits) + ("" if np.isnan(half) else f" {interval(mean - half, mean + half, digits)}")


def _listed(parts: Iterable[str], joint: str = "; ") -> str:
    every = list(parts)
    more = f"{joint}… ({len(every)} in all)" if len(every) > _NAMED else ""
    return joint.join(every[:_NAMED]) + more


def _spaced(unit: str) -> str:
    return f" {unit}" if unit else ""


# Outcomes ---------------------------------------------------------------------------------------------------------


def paired(wide: pd.DataFrame, measure: str) -> Said:
    """The means, the differences, and how many participants go the same way."""
    label, unit, complete = measure_label(measure), _spaced(unit_of(measure)), wide.dropna()
    means = _listed(f"{name} {_mean(finite(wide[name]))}{unit} (n = {wide[name].count()})" for name in wide.columns)
    head = (
        f"{label} by condition, {counted(len(complete), 'participant')} complete. Means with 95 % intervals: {means}."
    )
    alt = f"{label}: a raincloud a condition. {means}."
    if len(wide.columns) > 1 and len(complete) > 1:
        told = _differences(complete, unit)
        head += f" {told}"
        alt += f" {told}"
    reading = (
        " Small marks are participants"
        + (", lines join the same one" if len(wide.columns) > 1 else "")
        + "; shapes are their density, thick bars the middle half; large marks are means with 95 % intervals."
    )
    return Said(head + reading, alt)


def _differences(complete: pd.DataFrame, unit: str) -> str:
    first, *others = complete.columns
    parts = []
    for other in others:
        difference = finite(complete[first] - complete[other])
        lower = int(np.sum(difference > 0))
        parts.append(
            f"{first} {MINUS} {other}: {_mean(difference)}{unit}, {lower} of {len(difference)} lower under {other}"
        )
    return f"Right, differences: {_listed(parts)}."


def scales(wide: Mapping[str, pd.DataFrame]) -> Said:
    """How many scales lean which way, and which most."""
    conditions = list(next(iter(wide.values())).columns)
    head = f"Every scale by participant ({_people(wide)}), drawn as the measures above."
    alt = f"A raincloud a scale: {_listed(short_label(name) for name in wide)}."
    if len(conditions) > 1:
        told = _furthest(wide, conditions)
        return Said(f"{head} {told}", f"{alt} {told}")
    return Said(head, alt)


def _people(wide: Mapping[str, pd.DataFrame]) -> str:
    """n, or from which to which where scales differ."""
    complete = [len(table.dropna()) for table in wide.values()]
    low, high = min(complete), max(complete)
    return f"n = {low} complete" if low == high else f"n = {low} to {high} complete"


def _furthest(wide: Mapping[str, pd.DataFrame], conditions: Sequence[str]) -> str:
    """The scale whose means lie furthest apart."""
    spread: dict[str, tuple[float, pd.Series]] = {}
    for measure, table in wide.items():
        means = table.dropna().mean()
        if means.notna().all() and len(means):
            spread[measure] = (float(means.max() - means.min()), means)
    if not spread:
        return "No scale has a participant with every condition."
    measure, (apart, means) = max(spread.items(), key=lambda one: one[1][0])
    if apart == 0:
        return "The means are the same in every scale."
    return (
        f"The means lie furthest apart in {short_label(measure).lower()}: {number(means.max())} under {means.idxmax()},"
        f" {number(means.min())} under {means.idxmin()}."
    )


def workload(wide: Mapping[str, pd.DataFrame]) -> Said:
    """Under which condition the median is lowest, in how many scales."""
    conditions = list(next(iter(wide.values())).columns)
    names = listing([short_label(name) for name in wide])
    head = (
        f"Ratings by scale and condition ({_people(wide)}): boxes hold the middle half of the participants, the thick"
        " line is the median, marks are participants."
    )
    alt = f"Box plots of {names} for {listing(conditions)}."
    if len(conditions) > 1:
        lowest = dict.fromkeys(conditions, 0)
        for table in wide.values():
            medians = table.median()
            alone = medians.index[medians == medians.min()]
            if len(alone) == 1:
                lowest[str(alone[0])] += 1
        counts = listing([f"{count} under {name}" for name, count in lowest.items()])
        told = f"Of {counted(len(wide), 'scale')} the lowest median is in {counts}; others tie."
        told = told if sum(lowest.values()) < len(wide) else told.replace("; others tie", "")
        return Said(f"{head} {told}", f"{alt} {told}")
    return Said(head, alt)


def trials(table: pd.DataFrame, conditions: Sequence[str]) -> Said:
    """Whether errors shrink from the first half of the trials to the second."""
    recorded = table[(table["estimator"] == "recorded") & table["position_error_mm"].notna()]
    people = recorded["participant"].nunique()
    head = f"Selection error trial by trial, a panel a participant (n = {counted(people, 'participant')}"
    head += f", {counted(len(recorded), 'selection')})."
    told = _halves(recorded, conditions)
    return Said(f"{head} {told}".strip(), f"Selection error by trial, a panel a participant. {told}".strip())


def _halves(recorded: pd.DataFrame, conditions: Sequence[str]) -> str:
    parts = []
    for condition in conditions:
        rows = recorded[recorded["condition"] == condition]
        middle = rows.groupby("participant")["trial"].transform("median") if len(rows) else rows["trial"]
        early, late = rows.loc[rows["trial"] <= middle], rows.loc[rows["trial"] > middle]
        if len(early) and len(late):
            means = [part["position_error_mm"].mean() for part in (early, late)]
            parts.append(f"{condition} {number(means[0], 1)} to {number(means[1], 1)} mm")
    return f"Mean error from the first half of the trials to the second: {_listed(parts)}." if parts else ""


# Sensors ----------------------------------------------------------------------------------------------------------


def _span(excerpts: pd.DataFrame) -> str:
    time = finite(excerpts["time_s"])
    where = f"session {excerpts['session'].iloc[0]}, axis {excerpts['axis'].iloc[0]}"
    return f"{where}, {number(time.min(), 1)} to {number(time.max(), 1)} s, where the tracker moves most"


def streams(excerpts: pd.DataFrame) -> Said:
    """How far the frames are from the reference when they arrive, and how many there are of each."""
    counts = excerpts["kind"].value_counts()
    felt, frames = int(counts.get("acceleration", 0)), excerpts[excerpts["kind"] == "tracker"]
    told = f"{counted(len(frames), 'frame')} of the tracker"
    told += f" against {counted(felt, 'acceleration')}" if felt else ""
    reference = excerpts[excerpts["kind"] == "reference"]
    if len(reference) > 1 and len(frames):
        at = np.interp(frames["time_s"], reference["time_s"], reference["value"], left=np.nan, right=np.nan)
        error = finite(frames["value"].to_numpy(np.float64) - at)
        if len(error):
            told += f"; on arrival a frame is {number(float(np.sqrt(np.mean(error**2))), 1)} mm (RMS) off the reference"
    return Said(
        f"What the sensors delivered ({_span(excerpts)}): {told}.",
        f"Tracker positions over time{', accelerations below' if felt else ''}: {told}.",
    )


def estimates(excerpts: pd.DataFrame) -> Said:
    """Each estimator's error in the stretch and how often it is within the stated band."""
    names = list(dict.fromkeys(excerpts.loc[excerpts["kind"] == "estimate", "name"]))
    parts = []
    for name in names:
        _, error, sd = errors_in(excerpts, name)
        known = np.isfinite(error)
        if known.any():
            rms = float(np.sqrt(np.mean(error[known] ** 2)))
            inside = float(np.mean(np.abs(error[known]) <= 2 * sd[known]))
            parts.append((rms, f"{name} {number(rms, 1)} mm, {percent(inside, 0)} within ± 2 SD"))
    told = f" Error (RMS) here, least first: {_listed(text for _, text in sorted(parts))}." if parts else ""
    return Said(
        f"What each estimator makes of them ({_span(excerpts)}): its mean and two stated SDs"
        f"{', and beside it its error in the band it states' if parts else ''}.{told}",
        f"One panel an estimator ({_listed(names, ', ')}) with mean, band and tracker frames.{told}",
    )


def lead(lead_curves: pd.DataFrame) -> Said:
    """Where each curve peaks."""
    parts = []
    for name, rows in lead_curves.groupby("estimator", sort=False):
        peak = peak_s(rows)
        parts.append(f"{name} has no peak within half a second" if peak is None else f"{name} {seconds(peak)} ms")
    told = f"Peaks: {_listed(parts)}."
    where = lead_curves["session"].iloc[0]
    return Said(
        f"How far each estimator is ahead of the tracker as it arrived, by the paper's method (session {where})."
        f" {told} Flat tops make a peak fragile.",
        f"Cross-correlation with the tracker against lead. {told}",
    )


def noise(residuals: pd.DataFrame, units: pd.Series) -> Said:
    """Each sensor's SD, and how much of it is further out than a normal's."""
    parts = []
    for stream, unit in units.items():
        values = finite(residuals.loc[residuals["stream"] == stream, "residual"])
        sd = float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
        outside = f", {percent(float(np.mean(np.abs(values) > 3 * sd)), 1)} beyond 3 SD" if sd > 0 else ""
        parts.append(f"{stream}: SD {number(sd, 1)} {unit}, n = {len(values)}{outside}")
    told = _listed(parts)
    return Said(
        f"Readings in still stretches, slow drift taken off, with the Gaussian of the same SD ({told}; a normal has"
        " 0.3 % beyond 3 SD). A hand is never quite still, so this is an upper bound of the sensor's own noise.",
        f"Histograms with Gaussian curves. {told}.",
    )


# Accuracy ---------------------------------------------------------------------------------------------------------


def errors(accuracy: pd.DataFrame) -> Said:
    """Which estimator errs least and most, and which is nearest to no lag."""
    n = counted(accuracy["session"].nunique(), "session")
    rmse = accuracy.groupby("estimator", sort=False)["rmse_mm"].mean().dropna().sort_values(kind="stable")
    lag = accuracy.groupby("estimator", sort=False)["lag_s"].mean().dropna()
    told = ""
    if len(rmse):
        told = f"Least RMSE: {rmse.index[0]}, {number(rmse.iloc[0])} mm"
        told += f"; most: {rmse.index[-1]}, {number(rmse.iloc[-1])} mm." if len(rmse) > 1 else "."
    if len(lag):
        nearest = int(np.argmin(np.abs(lag.to_numpy(np.float64))))
        told += f" Least lag: {lag.index[nearest]}, {seconds(float(lag.iloc[nearest]))} ms."
    return Said(
        f"Error (left) and lag (right) of each estimator over {n}: small marks are sessions, large ones their mean with"
        f" its 95 % interval. {told}",
        f"Dot plot of RMSE and lag by estimator over {n}. {told}",
    )


def lag_and_error(accuracy: pd.DataFrame) -> Said:
    """Which estimators no other beats in both."""
    known = accuracy[accuracy["lag_s"].notna() & accuracy["rmse_mm"].notna()]
    means = known.groupby("estimator", sort=False)[["rmse_mm", "lag_s"]].mean()
    cost = means.assign(lag_s=means["lag_s"].abs()).to_numpy(np.float64)
    beaten = [bool(np.any(np.all(cost <= one, axis=1) & np.any(cost < one, axis=1))) for one in cost]
    best = [str(name) for name, worse in zip(means.index, beaten, strict=True) if not worse]
    told = f"No other has both less error and less lag than {listing(best)}." if best else ""
    n = counted(known["session"].nunique(), "session")
    return Said(
        f"What less lag costs in error: means over {n} with 95 % intervals, small marks are sessions. To the left and"
        f" near zero is better. {told}",
        f"Scatter plot of lag against RMSE by estimator, {n}. {told}",
    )


def calibration(table: pd.DataFrame) -> Said:
    """How much is within 1.96 SD, where a normal has 95 %."""
    parts = []
    for name, rows in table.groupby("estimator", sort=False):
        k, share = shares(rows)
        at = int(np.argmin(np.abs(k - 1.96)))
        parts.append(f"{name} {percent(float(share[at]), 0)}")
    told = f"Within {1.96} SD, where a normal has 95 %: {_listed(parts, ', ')}."
    sessions = table["session"].nunique()
    n = counted(sessions, "session")
    single = "band: nine of ten sessions" if sessions > LINES_MAX else "thin lines single sessions"
    return Said(
        f"Is the stated SD honest? The share of errors within k stated SDs over {n} (pooled; {single}), beside the"
        f" normal's (dashed). Below it errors are larger than stated, above it smaller. {told}",
        f"Share of errors within k stated SDs by estimator, {n}. {told}",
    )


# The canvas -------------------------------------------------------------------------------------------------------


def task_layout(task: Task) -> Said:
    """How large the canvas is, how many targets it has, and what part the window shows."""
    size = [high - low for low, high in (task.canvas_x_mm, task.canvas_y_mm)]
    places = targets_of(task)
    diameters = sorted({diameter for _, _, diameter in places})
    told = f"a canvas of {size[0]:g} × {size[1]:g} mm with {counted(len(places), 'target')}"
    told += f" of {listing([f'{one:g}' for one in diameters])} mm" if diameters else ""
    if task.window_mm is not None:
        share = task.window_mm[0] * task.window_mm[1] / (size[0] * size[1])
        told += (
            f"; the window of {task.window_mm[0]:g} × {task.window_mm[1]:g} mm shows {percent(share, 1)} of it at once"
        )
    return Said(f"The task: {told}.", f"Layout of {told}.")


def _span_of(points: FloatArray) -> tuple[float, float]:
    known = points[np.isfinite(points).all(axis=1)]
    across, up = np.ptp(known, axis=0) if len(known) else (0.0, 0.0)
    return float(across), float(up)


def _extent(points: FloatArray) -> str:
    across, up = _span_of(points)
    return f"{number(across, 0)} × {number(up, 0)} mm"


def path(
    tracks: pd.DataFrame, positions: pd.DataFrame, events: pd.DataFrame, lines: Sequence[str], plane: Plane = XY
) -> Said:
    """What each line spans, and how many targets and selections there are."""
    sessions = [*tracks["session"].iloc[:1], *positions["session"].iloc[:1]]
    where = f" in session {sessions[0]}" if sessions else ""
    spans = _listed((f"{line} {_extent(way(tracks, positions, line, plane))}" for line in lines), ", ")
    told = f"Extent of each line: {spans}; {counted(int((events['type'] == 'selection').sum()), 'selection')}."
    return Said(
        f"The hand's way{where}, {plane[0]} against {plane[1]}; it begins at the arrow. {told} Look where lines leave"
        " each other and how much each trembles.",
        f"Lines of the hand's path in the plane{where}. {told}",
    )


def paths(
    tracks: pd.DataFrame,
    positions: pd.DataFrame,
    events: pd.DataFrame,
    sessions: pd.DataFrame,
    shown: Mapping[str, str],
    plane: Plane = XY,
) -> Said:
    """How many ways there are of each condition, and which reaches furthest."""
    told = sessions[["participant", "condition", "session"]].drop_duplicates().dropna()
    counts, furthest = [], ("", 0.0, "")
    for condition, line in shown.items():
        mine = list(told.loc[told["condition"] == condition, "session"])
        if mine:
            counts.append(f"{condition} ({line}), n = {len(mine)}")
        for one in mine:
            points = way(tracks[tracks["session"] == one], positions[positions["session"] == one], line, plane)
            reach = float(np.hypot(*_span_of(points)))
            if reach > furthest[1]:
                furthest = (str(one), reach, _extent(points))
    summary = f"{_listed(counts)}."
    summary += f" The widest is session {furthest[0]}, {furthest[2]}." if furthest[0] else ""
    people = counted(told["participant"].nunique(), "participant")
    return Said(
        f"The way of each session in the plane, a panel a participant ({people}): {summary} Look for ways"
        " that leave the others.",
        f"Paths of {people} in the plane: {summary}",
    )


def selection_errors(
    selections: pd.DataFrame, conditions: Sequence[str], plane: Plane = XY, px_per_mm: float | None = None
) -> Said:
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
        found = ellipse_95(offsets)
        size = (
            "" if found is None else f", ellipse {number(found.lengths[0], 1)} × {number(found.lengths[1], 1)} {unit}"
        )
        people = counted(rows["participant"].nunique(), "participant")
        parts.append(f"{condition}: n = {len(offsets)}, {people}, mean ({number(x, 1)}, {number(y, 1)}) {unit}{size}")
    told = f"{_listed(parts)}."
    return Said(
        "Where selections fell about their target, which is at zero; the cross is the mean, and the ellipse would hold"
        f" 95 % of further selections if they were normal and independent. {told}",
        f"Scatter of selection errors in {plane[0]} and {plane[1]} by condition. {told}",
    )


def timeline(stream_rates: pd.DataFrame, events: pd.DataFrame, exclusions: pd.DataFrame) -> Said:
    """How many silences there are, the longest of them, and how many sessions were set aside."""
    sessions, found = stream_rates["session"].nunique(), silences(stream_rates)
    told = f"{counted(sessions, 'session')}, {counted(len(found), 'stretch', 'stretches')} with a silence"
    if len(found):
        worst = found.iloc[int(np.argmax(found["gap_max_s"].to_numpy(np.float64)))]
        told += f", the longest {number(float(worst['gap_max_s']), 2)} s ({worst['session']}, {worst['stream']})"
    aside = len(set_aside(exclusions))
    told += f"; {counted(aside, 'session')} set aside." if aside else "; none set aside."
    return Said(
        f"What arrived when, a row a stream of each session: {told} The paler a stretch, the fewer"
        " messages arrived; a cross marks a silence of five usual steps or longer, 50 ms at least.",
        f"Timeline of every session's streams. {told}",
    )
