"""One session's facts: accuracy against the reference, agreement with the display, sensor noise, trials."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from fusion_core import FloatArray, Samples, accuracy, noise
from pipeline import excerpts, recording, tables
from pipeline.estimators import sensors
from pipeline.phone import described
from pipeline.recording import Recording
from pipeline.stage import Outcome, Work
from pipeline.study import Study
from pipeline.trials import selections_by_trial

_UNITS = {"position": "mm", "velocity": "mm/s", "acceleration": "mm/s²", "linear": "its own"}
_SETTLED_S = 1.0  # after the first frame's arrival: the grid of accuracy begins there
_PERCENT_OF_SD = (*range(25, 200, 25), 196, *range(200, 401, 50))  # at which errors are counted
Row = dict[str, Any]


def run(work: Work) -> Outcome:
    """One session's accuracy, agreement, noise, trials and selections, and what figures of it show."""
    study, session = work.study, work.session
    ingested = work.entry("ingest")
    loaded = recording.load(study, ingested)
    tracks: dict[str, pd.DataFrame] = {}
    for name, part in tables.read("tracks", work.entry("fuse")).groupby("estimator", sort=False):
        tracks[str(name)] = part
    reference = recording.reference(study, loaded)
    rows = [accuracy_row(work, loaded, reference, name, rows) for name, rows in tracks.items()]
    tables.write("accuracy", tables.frame("accuracy", [row for row in rows if row]), work.out)
    tables.write("replay_agreement", tables.frame("replay_agreement", _agreement(work, loaded)), work.out)
    phones = [{"session": session.id, "stream": name, **described(found)} for name, found in loaded.phones.items()]
    tables.write("phones", tables.frame("phones", phones), work.out)
    measured, residuals = _noise(study, session.id, loaded)
    tables.write("sensor_noise", tables.frame("sensor_noise", measured), work.out)
    tables.write("noise_residuals", residuals, work.out)
    events = tables.read("events", ingested)
    tables.write("trials", tables.frame("trials", trial_rows(work, events, tracks)), work.out)
    tables.write("selections", tables.frame("selections", selection_rows(work, events)), work.out)
    counted = calibration_rows(study, session.id, loaded, reference, tracks)
    tables.write("calibration", tables.frame("calibration", counted), work.out)
    tables.write("excerpts", excerpts.excerpt(study, session.id, loaded, tracks), work.out)
    tables.write("lead_curves", excerpts.lead_curves(study, session.id, loaded, tracks), work.out)
    tables.write("stream_rates", tables.frame("stream_rates", excerpts.rates(ingested)), work.out)
    return Outcome()


def _mean_and_sd(rows: pd.DataFrame, axes: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    mean = rows[[f"{axis}_mm" for axis in axes]].to_numpy(np.float64)
    return mean, rows[[f"sd_{axis}_mm" for axis in axes]].to_numpy(np.float64)


def accuracy_row(
    work: Work, loaded: Recording, named: tuple[str, Samples] | None, estimator: str, rows: pd.DataFrame
) -> Row | None:
    """The estimator's row of `accuracy`; None without a reference on its grid."""
    study, tracker = work.study, work.study.tracker
    found = _on_grid(study, loaded, named, rows)
    if named is None or tracker is None or found is None:
        return None
    name, reference = named
    time, mean, sd, truth = found
    random = recording.seeded(work.session.id, estimator)
    lag = accuracy.lag(time, mean, reference, random)
    return {
        "study": work.study_name,
        "session": work.session.id,
        "estimator": estimator,
        "reference": name,
        "rmse_mm": accuracy.rmse(mean, truth),
        "sd_mm": accuracy.stated_sd(sd),
        "coverage_95": accuracy.coverage_95(mean, sd, truth),
        "lag_s": lag.value,
        "lag_low_s": lag.low,
        "lag_high_s": lag.high,
        "lead_xcorr_s": accuracy.lead_by_cross_correlation(time, mean, loaded.samples[tracker]),
        "jitter_mm": accuracy.jitter(time, mean, reference),
    }


def _on_grid(
    study: Study, loaded: Recording, named: tuple[str, Samples] | None, rows: pd.DataFrame
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None:
    """Time in s, mean, stated SD and reference (n, d) on the grid of accuracy; None where there is none."""
    tracker = study.tracker
    if named is None or tracker is None or len(loaded.samples[tracker]) == 0:
        return None
    time = recording.in_session_s(loaded, rows)
    truth = accuracy.interpolate(named[1], time)
    on_grid = (time >= loaded.samples[tracker].arrival[0] + _SETTLED_S) & np.isfinite(truth).all(axis=1)
    if not on_grid.any():
        return None
    mean, sd = _mean_and_sd(rows, study.axes)
    return time[on_grid], mean[on_grid], sd[on_grid], truth[on_grid]


def calibration_rows(
    study: Study,
    session: str,
    loaded: Recording,
    reference: tuple[str, Samples] | None,
    tracks: dict[str, pd.DataFrame],
) -> Iterator[Row]:
    """How many errors are within k stated SDs, on the grid of accuracy; nothing for one that states no SD."""
    for name, rows in tracks.items():
        found = _on_grid(study, loaded, reference, rows)
        if found is None:
            continue
        _, mean, sd, truth = found
        error, known = np.abs(mean - truth), sd > 0
        for percent in _PERCENT_OF_SD if known.any() else ():
            within = int(np.sum(error[known] <= percent / 100 * sd[known]))
            yield {
                "session": session,
                "estimator": name,
                "percent_of_sd": percent,
                "within": within,
                "n": int(known.sum()),
            }


def selection_rows(work: Work, events: pd.DataFrame) -> Iterator[Row]:
    """The first selection of each trial, with its target as the selection or, failing that, the start has it."""
    for start, selection in _trials(events):
        if selection is not None:
            yield {
                **work.session.ids,
                "trial": start.trial,
                **{f"target_{axis}_mm": value for axis, value in _target(start, selection).items()},
                **{f"{axis}_mm": _first(selection[f"{axis}_mm"]) for axis in "xyz"},
            }


def _agreement(work: Work, loaded: Recording) -> list[Row]:
    """How far what the log says was shown is from the replay of the estimator it says it showed."""
    shown = work.study.shown.get(work.session.condition or "")
    if shown is None or loaded.display is None:
        return []
    replayed = recording.show(work.study, shown, loaded, loaded.display.time)
    apart = np.linalg.norm(replayed.mean - loaded.display.value, axis=1)
    apart = apart[np.isfinite(apart)]
    row: Row = {"session": work.session.id, "estimator": shown, "n": len(apart)}
    if len(apart):
        row |= {"max_mm": float(apart.max()), "rms_mm": float(np.sqrt(np.mean(apart**2)))}
    return [row]


def _noise(study: Study, session: str, loaded: Recording) -> tuple[list[Row], pd.DataFrame]:
    """Each sensor's noise in the longest still stretch, and the residuals behind it."""
    rows: list[Row] = []
    residuals = []
    stretch = _still(study, loaded)
    for name, sensor in sensors(study).items():
        samples = loaded.samples[name]
        left = noise.residuals(samples, *stretch) if stretch else np.empty((0, sensor.dimension))
        if stretch is None or len(left) == 0:
            continue
        rows.append(
            {
                "session": session,
                "stream": name,
                "unit": _UNITS[study.sensor_streams[name].kind],
                "begin_s": stretch[0],
                "end_s": stretch[1],
                "n": len(left),
                "sd": float(np.sqrt(np.mean(left**2))),
                "stated_sd": sensor.noise_sd,
            }
        )
        for index, axis in enumerate(study.axes_of(name)):
            part = pd.DataFrame({"residual": left[:, index]}).assign(session=session, stream=name, axis=axis)
            residuals.append(tables.as_table("noise_residuals", part))
    return rows, pd.concat(residuals) if residuals else tables.frame("noise_residuals", [])


def _still(study: Study, loaded: Recording) -> tuple[float, float] | None:
    """The longest stretch in which the hand is still, by the reference; by the accelerations where there is none."""
    if loaded.reference is not None:
        return noise.longest(accuracy.slow_stretches(loaded.reference, shortest_s=1.0))
    name = study.stream_of_kind("acceleration")
    samples: Samples | None = loaded.samples.get(name) if name else None
    return noise.still_by_acceleration(samples) if samples is not None else None


class _Start(NamedTuple):
    """A trial's start: the number the trial goes by, and the event."""

    trial: int
    event: Any


def _trials(events: pd.DataFrame) -> Iterator[tuple[_Start, pd.Series | None]]:
    """Each trial with its first selection."""
    starts, selections = selections_by_trial(events)
    start: Any
    for index, start in enumerate(starts.itertuples()):
        after = selections[selections["start"] == index]
        named = _Start(index + 1 if pd.isna(start.trial) else int(start.trial), start)
        yield named, None if after.empty else after.iloc[0]


def _target(start: _Start, selection: pd.Series) -> dict[str, float | None]:
    """Where the target was, in mm, by axis."""
    return {axis: _first(selection[f"target_{axis}_mm"], getattr(start.event, f"target_{axis}_mm")) for axis in "xyz"}


def trial_rows(work: Work, events: pd.DataFrame, tracks: dict[str, pd.DataFrame]) -> Iterator[Row]:
    """Each trial as recorded, and what each estimator would have shown when the participant selected."""
    for start, selection in _trials(events):
        trial = {**work.session.ids, "trial": start.trial}
        if selection is None:
            yield trial | {"estimator": "recorded"}
            continue
        target = _target(start, selection)
        axes = [axis for axis in "xyz" if target[axis] is not None]
        duration_s = float(selection["time_ns"] - start.event.time_ns) * tables.NANOSECONDS
        shown: dict[str, pd.Series] = {"recorded": selection}
        for name, rows in tracks.items():
            before = rows[rows["time_ns"] <= selection["time_ns"]]
            if len(before):
                shown[name] = before.iloc[-1]
        for name, where in shown.items():
            squared = _squared_error(where, target, axes if name == "recorded" else list(work.study.axes))
            error = None if squared is None else float(np.sqrt(squared))
            yield trial | {
                "estimator": name,
                "position_error_mm": error,
                "squared_error_mm2": squared,
                "duration_s": duration_s if name == "recorded" else None,
            }


def _first(*values: Any) -> float | None:
    return next((float(value) for value in values if not pd.isna(value)), None)


def _squared_error(where: pd.Series, target: dict[str, float | None], axes: list[str]) -> float | None:
    """Squared distance in mm² over the axes the target has; None if it has none or a coordinate is missing."""
    used = [axis for axis in axes if target[axis] is not None]
    values = [where[f"{axis}_mm"] for axis in used]
    if not used or any(pd.isna(value) for value in values):
        return None
    return float(sum((value - target[axis]) ** 2 for axis, value in zip(used, values, strict=True)))
