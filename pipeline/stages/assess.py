"""One session's facts: accuracy against the reference, agreement with the display, sensor noise, trials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fusion_core import FloatArray, Samples, accuracy, noise
from pipeline import recording, tables
from pipeline.estimators import sensors
from pipeline.phone import described
from pipeline.recording import Recording, Shown
from pipeline.stage import Outcome, Work
from pipeline.study import Study
from pipeline.trials import selections_by_trial

_UNITS = {"position": "mm", "velocity": "mm/s", "acceleration": "mm/s²", "linear": "its own"}
_SETTLED_S = 1.0  # after the first frame's arrival: the grid of accuracy begins there
Row = dict[str, Any]


def run(work: Work) -> Outcome:
    """One session's accuracy, replay_agreement, sensor_noise, noise_residuals and trials."""
    study, session = work.study, work.session
    ingested = work.entry("ingest")
    loaded = recording.load(study, ingested)
    tracks = _tracks(study, tables.read_arrow("tracks", work.entry("fuse")))
    reference = recording.reference(study, loaded)
    rows = [accuracy_row(work, loaded, reference, name, rows) for name, rows in tracks.items()]
    tables.write("accuracy", tables.of_rows("accuracy", [row for row in rows if row]), work.out)
    tables.write("replay_agreement", tables.of_rows("replay_agreement", _agreement(work, loaded)), work.out)
    phones = [{"session": session.id, "stream": name, **described(found)} for name, found in loaded.phones.items()]
    tables.write("phones", tables.of_rows("phones", phones), work.out)
    measured, residuals = _noise(study, session.id, loaded)
    tables.write("sensor_noise", tables.of_rows("sensor_noise", measured), work.out)
    tables.write("noise_residuals", residuals, work.out)
    trials = list(trial_rows(work, tables.read_arrow("events", ingested).to_pylist(), tracks))
    tables.write("trials", tables.of_rows("trials", trials), work.out)
    return Outcome()


def _tracks(study: Study, table: pa.Table) -> dict[str, Shown]:
    """What each estimator would have shown."""
    found = {}
    for name in study.estimators:
        rows = table.filter(pc.equal(table["estimator"], name))
        if len(rows):
            mean, sd = (
                np.column_stack([rows[column.format(axis)].to_numpy() for axis in study.axes])
                for column in ("{}_mm", "sd_{}_mm")
            )
            found[name] = Shown(rows["time_ns"].to_numpy(), mean, sd)
    return found


def accuracy_row(
    work: Work, loaded: Recording, named: tuple[str, Samples] | None, estimator: str, shown: Shown
) -> Row | None:
    """The estimator's row of `accuracy`; None without a reference on its grid."""
    tracker = work.study.tracker
    if named is None or tracker is None or len(loaded.samples[tracker]) == 0:
        return None
    name, reference = named
    time: FloatArray = np.asarray(shown.time_ns - loaded.origin_ns, dtype=np.float64) * tables.NANOSECONDS
    truth = accuracy.interpolate(reference, time)
    on_grid = (time >= loaded.samples[tracker].arrival[0] + _SETTLED_S) & np.isfinite(truth).all(axis=1)
    if not on_grid.any():
        return None
    time, mean, sd, truth = time[on_grid], shown.mean[on_grid], shown.sd[on_grid], truth[on_grid]
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


def _noise(study: Study, session: str, loaded: Recording) -> tuple[list[Row], pa.Table]:
    """Each sensor's noise in the longest still stretch, and the residuals behind it."""
    rows: list[Row] = []
    residuals = [tables.of_rows("noise_residuals", [])]
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
            columns = {"session": session, "stream": name, "axis": axis, "residual": left[:, index]}
            residuals.append(tables.of_columns("noise_residuals", len(left), columns))
    return rows, pa.concat_tables(residuals).combine_chunks()


def _still(study: Study, loaded: Recording) -> tuple[float, float] | None:
    """The longest stretch in which the hand is still, by the reference; by the accelerations where there is none."""
    if loaded.reference is not None:
        return noise.longest(accuracy.slow_stretches(loaded.reference, shortest_s=1.0))
    name = study.stream_of_kind("acceleration")
    samples: Samples | None = loaded.samples.get(name) if name else None
    return noise.still_by_acceleration(samples) if samples is not None else None


def trial_rows(work: Work, events: Sequence[Row], tracks: Mapping[str, Shown]) -> Iterator[Row]:
    """Each trial as recorded, and what each estimator would have shown when the participant selected."""
    starts, selections = selections_by_trial(events)
    first: dict[int, Row] = {}
    for selection, place in selections:
        first.setdefault(place, dict(selection))
    for index, start in enumerate(starts):
        trial = {**work.session.ids, "trial": index + 1 if start["trial"] is None else start["trial"]}
        if index not in first:
            yield trial | {"estimator": "recorded"}
            continue
        selected = first[index]
        named = {axis: f"target_{axis}_mm" for axis in "xyz"}
        target = {axis: start[key] if selected[key] is None else selected[key] for axis, key in named.items()}
        duration_s = float(selected["time_ns"] - start["time_ns"]) * tables.NANOSECONDS
        shown: dict[str, Row] = {"recorded": {axis: selected[f"{axis}_mm"] for axis in "xyz"}}
        for name, track in tracks.items():
            at = int(np.searchsorted(track.time_ns, selected["time_ns"], side="right")) - 1
            if at >= 0:
                shown[name] = dict(zip(work.study.axes, track.mean[at].tolist(), strict=True))
        for name, where in shown.items():
            squared = _squared_error(where, target)
            error = None if squared is None else float(np.sqrt(squared))
            yield trial | {
                "estimator": name,
                "position_error_mm": error,
                "squared_error_mm2": squared,
                "duration_s": duration_s if name == "recorded" else None,
            }


def _squared_error(where: Row, target: Row) -> float | None:
    """Squared distance in mm² over the axes the target has; None if it has none or a coordinate is missing."""
    used = [axis for axis in where if target[axis] is not None]
    if not used or any(where[axis] is None for axis in used):
        return None
    return float(sum((where[axis] - target[axis]) ** 2 for axis in used))
