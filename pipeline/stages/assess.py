"""One session's facts: accuracy against the reference, agreement with the display, sensor noise, trials, movements."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from fusion_core import FloatArray, Samples, accuracy, noise
from pipeline import movements, recording, tables
from pipeline.estimators import sensors
from pipeline.phone import described
from pipeline.recording import Recording
from pipeline.stage import Outcome, Work
from pipeline.study import Study
from pipeline.trials import coordinates, selections_by_trial, told, with_movements

_UNITS = {"position": "mm", "velocity": "mm/s", "acceleration": "mm/s²", "linear": "its own"}
_SETTLED_S = 1.0  # after the first frame's arrival: the grid of accuracy begins there
Row = dict[str, Any]


def run(work: Work) -> Outcome:
    """One session's accuracy, replay_agreement, sensor_noise, noise_residuals, trials and movements."""
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
    tables.write("movements", _movements(work, loaded, events), work.out)
    return Outcome()


def _mean_and_sd(rows: pd.DataFrame, axes: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    mean = rows[[f"{axis}_mm" for axis in axes]].to_numpy(np.float64)
    return mean, rows[[f"sd_{axis}_mm" for axis in axes]].to_numpy(np.float64)


def accuracy_row(
    work: Work, loaded: Recording, named: tuple[str, Samples] | None, estimator: str, rows: pd.DataFrame
) -> Row | None:
    """The estimator's row of `accuracy`; None without a reference on its grid."""
    study, tracker = work.study, work.study.tracker
    if named is None or tracker is None or len(loaded.samples[tracker]) == 0:
        return None
    name, reference = named
    time = (rows["time_ns"].to_numpy(np.int64) - loaded.origin_ns) * tables.NANOSECONDS
    truth = accuracy.interpolate(reference, time)
    on_grid = (time >= loaded.samples[tracker].arrival[0] + _SETTLED_S) & np.isfinite(truth).all(axis=1)
    if not on_grid.any():
        return None
    mean, sd = _mean_and_sd(rows, study.axes)
    time, mean, sd, truth = time[on_grid], mean[on_grid], sd[on_grid], truth[on_grid]
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


def trial_rows(work: Work, events: pd.DataFrame, tracks: dict[str, pd.DataFrame]) -> Iterator[Row]:
    """Each trial as recorded, and what each estimator would have shown when the participant selected."""
    starts, selections = selections_by_trial(events)
    start: Any
    for index, start in enumerate(starts.itertuples()):
        after = selections[selections["start"] == index]
        trial = {
            **work.session.ids,
            "trial": index + 1 if pd.isna(start.trial) else int(start.trial),
        }
        if after.empty:
            yield trial | {"estimator": "recorded"}
            continue
        selection = after.iloc[0]
        target = {axis: _first(selection[f"target_{axis}_mm"], getattr(start, f"target_{axis}_mm")) for axis in "xyz"}
        axes = [axis for axis in "xyz" if target[axis] is not None]
        duration_s = float(selection["time_ns"] - start.time_ns) * tables.NANOSECONDS
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


def _movements(work: Work, loaded: Recording, events: pd.DataFrame) -> pd.DataFrame:
    """The session's movements from target to target, and the hand's path of each as far as it is known."""
    trials = told(events, loaded.origin_ns)
    if trials.empty:
        return tables.frame("movements", [])
    trials = with_movements(trials)
    hand = _hand(work.study, loaded)
    paths = [] if hand is None else movements.smoothed(hand.time, hand.value)
    targets = coordinates(trials, "target")
    rows = []
    for index, (start_s, selection_s) in enumerate(zip(trials["start_s"], trials["selection_s"], strict=True)):
        path = movements.between(paths, start_s, selection_s)
        before = targets[index - 1] if index else np.full(3, np.nan)
        rows.append({} if path is None else _of_path(work.study, path, before, targets[index]))
    of_paths = pd.DataFrame(rows, index=trials.index)
    return tables.as_table("movements", pd.concat([trials.assign(session=work.session.id), of_paths], axis=1))


def _hand(study: Study, loaded: Recording) -> Samples | None:
    """The best that is known of where the hand was: the reference, else what was displayed, else the tracker."""
    tracked = loaded.samples[study.tracker] if study.tracker is not None else None
    return next((one for one in (loaded.reference, loaded.display, tracked) if one is not None and len(one)), None)


def _of_path(study: Study, path: movements.Path, before: FloatArray, target: FloatArray) -> Row:
    """What a trial's path says: the straight way is from where the hand was, the task's way from target to target."""
    line = np.array(study.task.path_mm if study.task is not None else ())
    place = dict(zip("xyz", zip(before, target, strict=True), strict=True))
    axes: list[str] = [axis for axis in study.axes if np.isfinite(place[axis][1])]
    on_line = len(line) > 0 and {"x", "y"} <= set(axes)
    if on_line:
        axes = ["x", "y"]
    hand = path.position_mm[:, [study.axes.index(axis) for axis in axes]]
    begin, aim = (np.array([place[axis][end] for axis in axes]) for end in (0, 1))
    begin = begin if np.isfinite(begin).all() else hand[0]
    way = movements.route(line, begin, aim) if on_line else np.vstack([begin, aim])
    return {
        "path_length_mm": movements.length_mm(path.position_mm),
        "shortest_mm": movements.length_mm(way if on_line else path.position_mm[[0, -1]]),
        "overshoot_mm": movements.overshoot_mm(hand, way),
        "corrections": movements.corrections(path),
    }
