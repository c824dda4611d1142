"""One session's figures: accuracy, agreement with the display, sensor noise, trials and movements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa

from fusion_core import Samples, accuracy
from fusion_core.accuracy import noise
from pipeline.engine.stage import Outcome, Work
from pipeline.sessions import excerpts, movements, recording
from pipeline.sessions.estimators import sensors
from pipeline.sessions.fusion_checks import fusion_check_rows
from pipeline.sessions.growing import Growing
from pipeline.sessions.judged import judged
from pipeline.sessions.phone import described
from pipeline.sessions.recording import Recording, Tracked
from pipeline.sessions.sensors_found import sensors_found_rows
from pipeline.sessions.target_widths import widths_mm
from pipeline.sessions.tracks import newest_at, tracks_of
from pipeline.sessions.trials import coordinates, selections_by_trial, trial_table, with_movements
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.columns import S_PER_NS
from pipeline.tables.table import Row

_UNITS = {"position": "mm", "velocity": "mm/s", "acceleration": "mm/s²", "linear": "its own"}
_PERCENT_OF_SD = (*range(25, 200, 25), 196, *range(200, 401, 50))  # at which errors are counted


def run(work: Work) -> Outcome:
    """Write one session's accuracy, agreement, noise, trials, selections and movements, and its figures' tables."""
    study, session = work.study, work.session
    ingested = work.entry("ingest")
    loaded = recording.load(study, ingested, may_be_long=True)
    tracks = tracks_of(study, work.entry("fuse"))
    reference = recording.reference(study, loaded)
    rows = [accuracy_row(work, loaded, reference, name, rows) for name, rows in tracks.items()]
    known = [row for row in rows if row]
    tables.write("accuracy", tables.of_rows("accuracy", known), work.out)
    checked = fusion_check_rows(study, session.id, loaded, reference, tracks)
    tables.write("checks", tables.of_rows("checks", checked), work.out)
    tables.write("replay_agreement", tables.of_rows("replay_agreement", agreement(work, loaded)), work.out)
    phones = [{"session": session.id, "stream": name, **described(found)} for name, found in loaded.phones.items()]
    tables.write("phones", tables.of_rows("phones", phones), work.out)
    measured, residuals = _noise(study, session.id, loaded)
    tables.write("sensor_noise", tables.of_rows("sensor_noise", measured), work.out)
    tables.write("noise_residuals", residuals, work.out)
    sensors_found = list(sensors_found_rows(study, session.id, loaded))
    tables.write("sensors_found", tables.of_rows("sensors_found", sensors_found), work.out)
    events = tables.read_arrow("events", ingested).to_pylist()
    tables.write("trials", tables.of_rows("trials", list(trial_rows(work, events, tracks))), work.out)
    tables.write("selections", tables.of_rows("selections", list(selection_rows(work, events))), work.out)
    tables.write("movements", _movements(work, loaded, events), work.out)
    counted = list(calibration_rows(study, session.id, loaded, reference, tracks))
    tables.write("calibration", tables.of_rows("calibration", counted), work.out)
    tables.write("excerpts", excerpts.excerpt(study, session.id, loaded, tracks), work.out)
    tables.write("lead_curves", excerpts.lead_curves(study, session.id, loaded, tracks), work.out)
    tables.write("stream_rates", tables.of_rows("stream_rates", list(excerpts.rates(ingested))), work.out)
    instants = len(loaded.times)
    del loaded, tracks
    tables.give_back(instants)
    return Outcome()


def accuracy_row(
    work: Work, loaded: Recording, named: tuple[str, Samples] | None, estimator: str, tracked: Tracked
) -> Row | None:
    """The estimator's row of `accuracy`; None without a reference on its grid."""
    study, tracker = work.study, work.study.tracker
    if named is None or tracker is None:
        return None
    name, reference = named
    time, mean = Growing(np.float64), Growing(np.float64, len(study.axes))
    squared, variance, covered = Growing(np.float64), Growing(np.float64), Growing(np.bool_, len(study.axes))
    for part in judged(study, loaded, named, tracked):
        time.add(part.time)
        mean.add(part.mean)
        squared.add(accuracy.squared_distances(part.mean, part.truth))
        variance.add(np.sum(part.sd**2, axis=1))
        covered.add(accuracy.covered_95(part.mean, part.sd, part.truth))
    if not len(time):
        return None
    row: Row = {
        "study": work.study_name,
        "session": work.session.id,
        "estimator": estimator,
        "reference": name,
        "rmse_mm": float(np.sqrt(np.mean(squared.whole()))),
        "sd_mm": float(np.sqrt(np.mean(variance.whole()))),
        "coverage_95": float(np.mean(covered.whole())),
    }
    del squared, variance, covered
    tables.give_back(len(time))
    random = recording.seeded(work.session.id, estimator)
    lag = accuracy.lag(time.whole(), mean.whole(), reference, random)
    return row | {
        "lag_s": lag.value,
        "lag_low_s": lag.low,
        "lag_high_s": lag.high,
        "lead_xcorr_s": accuracy.lead_by_cross_correlation(time.whole(), mean.whole(), loaded.samples[tracker]),
        "jitter_mm": accuracy.jitter(time.whole(), mean.whole(), reference),
    }


def calibration_rows(
    study: Study,
    session: str,
    loaded: Recording,
    reference: tuple[str, Samples] | None,
    tracks: Mapping[str, Tracked],
) -> Iterator[Row]:
    """How many errors are within k stated SDs, where accuracy is judged; no rows for an estimator that states no SD."""
    for name, tracked in tracks.items():
        within, count = dict.fromkeys(_PERCENT_OF_SD, 0), 0
        for _, mean, sd, truth in judged(study, loaded, reference, tracked):
            error, known = np.abs(mean - truth), sd > 0
            count += int(known.sum())
            for percent in _PERCENT_OF_SD if known.any() else ():
                within[percent] += int(np.sum(error[known] <= percent / 100 * sd[known]))
        for percent in _PERCENT_OF_SD if count else ():
            yield {
                "session": session,
                "estimator": name,
                "percent_of_sd": percent,
                "within": within[percent],
                "n": count,
            }


def selection_rows(work: Work, events: Sequence[Row]) -> Iterator[Row]:
    """The first selection of each trial, with its target."""
    for number, _, selected, target in _trials(events):
        if selected is not None:
            yield {
                **work.session.ids,
                "trial": number,
                **{f"target_{axis}_mm": value for axis, value in target.items()},
                **{f"{axis}_mm": selected[f"{axis}_mm"] for axis in "xyz"},
            }


def agreement(work: Work, loaded: Recording) -> list[Row]:
    """How far the logged display is from the replay of the estimator that the condition displays."""
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
        if stretch is None:
            continue
        left = noise.residuals(recording.within(study, name, loaded, *stretch), *stretch)
        if len(left) == 0:
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
    """The longest stretch (begin, end) in s in which the hand is still, by the reference, else by the accelerations."""
    if loaded.reference is not None:
        return noise.longest(accuracy.slow_stretches(loaded.reference, shortest_s=1.0))
    name = study.stream_of_kind("acceleration")
    samples: Samples | None = loaded.samples.get(name) if name else None
    return noise.still_by_acceleration(samples) if samples is not None else None


class _Trial(NamedTuple):
    """A trial: its number, its start and its first selection as events, and its target by axis in mm."""

    number: int
    start: Row
    selected: Row | None
    target: dict[str, float | None]


def _trials(events: Sequence[Row]) -> Iterator[_Trial]:
    """Each trial; its target is that of the selection, or of the start where the selection has none."""
    starts, selections = selections_by_trial(events)
    first: dict[int, Row] = {}
    for selection, place in selections:
        first.setdefault(place, dict(selection))
    for index, start in enumerate(starts):
        number = index + 1 if start["trial"] is None else start["trial"]
        selected = first.get(index)
        target = {}
        for axis in "xyz":
            key = f"target_{axis}_mm"
            target[axis] = start[key] if selected is None or selected[key] is None else selected[key]
        yield _Trial(number, dict(start), selected, target)


def trial_rows(work: Work, events: Sequence[Row], tracks: Mapping[str, Tracked]) -> Iterator[Row]:
    """Each trial as recorded, and what each estimator would have shown when the participant selected."""
    trials = list(_trials(events))
    selected_ns = np.array([trial.selected["time_ns"] for trial in trials if trial.selected is not None], np.int64)
    known = {
        name: dict(zip(selected_ns.tolist(), newest_at(track, selected_ns), strict=True))
        for name, track in tracks.items()
    }
    for number, start, selected, target in trials:
        trial = {**work.session.ids, "trial": number}
        if selected is None:
            yield trial | {"estimator": "recorded"}
            continue
        duration_s = float(selected["time_ns"] - start["time_ns"]) * S_PER_NS
        shown: dict[str, Row] = {"recorded": {axis: selected[f"{axis}_mm"] for axis in "xyz"}}
        for name, places in known.items():
            place = places[selected["time_ns"]]
            if place is not None:
                shown[name] = dict(zip(work.study.axes, place.tolist(), strict=True))
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


def _movements(work: Work, loaded: Recording, events: Sequence[Row]) -> pd.DataFrame:
    """The session's movements from target to target, and the hand's path of each as far as it is known."""
    trials = trial_table(events, loaded.origin_ns)
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
    trials = trials.assign(
        **work.session.ids, order=np.arange(1, len(trials) + 1), width_mm=widths_mm(work.study.task, targets)
    )
    return tables.as_table("movements", pd.concat([trials, of_paths], axis=1))


def _hand(study: Study, loaded: Recording) -> Samples | None:
    """Where the hand was, as far as is known: the reference, else what was displayed, else the tracker."""
    tracked = loaded.samples[study.tracker] if study.tracker is not None else None
    candidates = (loaded.reference, loaded.display, tracked)
    return next((samples for samples in candidates if samples is not None and len(samples)), None)


def _of_path(study: Study, path: movements.Path, before: FloatArray, target: FloatArray) -> Row:
    """The figures of a trial's path. The shortest way starts where the hand was, or along the task's path at the
    previous target.
    """
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
