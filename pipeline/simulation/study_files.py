"""Writes a simulated study's files: logs, participants, questionnaires and repeated studies; all of a run or none."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.engine.cache import digest_of
from pipeline.errors import PipelineError
from pipeline.simulation.log import write_log
from pipeline.simulation.session import Outcome, Setting, compile_loop, find_lags, simulate
from pipeline.simulation.up_to_date import MADE, files_made, made_from
from pipeline.simulation.workload import ratings
from pipeline.statistics.counterbalancing import assigned
from pipeline.study.folder import inside
from pipeline.study.settings import Study
from pipeline.study.simulation import SelectionSimulation

_BEING_MADE = ".being-simulated"
_PLACEHOLDERS = ("{participant}", "{condition}")
Begin = Callable[[int], None]
Done = Callable[[], None]


@dataclass(frozen=True)
class Session:
    """One session to simulate."""

    participant: str
    condition: str
    order: int
    file: str


def simulate_study(folder: Path, study: Study, executor: Executor, begin: Begin, done: Done) -> list[str]:
    """Write the study's files; returns the names of the logs.

    The files appear together once all are done: if a run is stopped, those of the previous run remain. Raises
    PipelineError where study.yaml lacks what a simulation needs.
    """
    where = str(folder / "study.yaml")
    setting = Setting(study, where)
    sessions, settings = _sessions(setting, folder), setting.simulation
    _check(setting)
    begin(len(sessions) + settings.repeats)
    beside = folder / _BEING_MADE
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir()
    try:
        # First, side by side, what every session needs: else each process would compile all of it for itself.
        for ready in [executor.submit(compile_loop, setting), executor.submit(find_lags, setting)]:
            ready.result()
        futures: dict[Any, Any] = {executor.submit(make, setting, one, beside): one for one in sessions}
        again: dict[Any, int] = {executor.submit(repeat, setting, n): n for n in range(settings.repeats)}
        measured, repeats = {}, {}
        for future in as_completed([*futures, *again]):
            if future in futures:
                measured[futures[future]] = future.result()
            else:
                repeats[again[future]] = future.result()
            done()
        files = [one.file for one in sessions] + _tables(setting, beside, measured, repeats)
        _publish(folder, beside, files, made_from(study))
    finally:
        shutil.rmtree(beside, ignore_errors=True)
    return [one.file for one in sessions]


def participants(settings: SelectionSimulation) -> list[str]:
    """The participants' ids."""
    return [f"P{number:02d}" for number in range(1, settings.participants + 1)]


def _sessions(setting: Setting, folder: Path) -> list[Session]:
    """Every participant in every condition, in counterbalanced order."""
    study, found = setting.study, []
    if study.sessions is None or not all(part in study.sessions for part in _PLACEHOLDERS):
        raise PipelineError(f"{setting.where}: sessions: needs {{participant}} and {{condition}} for the logs' names")
    names, conditions = participants(setting.simulation), study.conditions
    orders = assigned(len(conditions), len(names)) if len(conditions) > 1 else [(0,)] * len(names)
    for participant, order in zip(names, orders, strict=True):
        for place, index in enumerate(order, start=1):
            condition = conditions[index]
            file = study.sessions.format(participant=participant, condition=condition, session="")
            inside(folder, file, f"{setting.where}: sessions", must_exist=False)
            found.append(Session(participant, condition, place, file))
    return found


def _check(setting: Setting) -> None:
    """Raise PipelineError now for what would otherwise only fail in a worker."""
    study = setting.study
    _ = setting.layout, setting.streams
    for condition in study.conditions:
        setting.shown(condition)
    for field, wanted in (
        ("events", study.events is not None),
        ("participants", study.participants is not None),
        ("questionnaires", study.questionnaires is not None or setting.simulation.workload is None),
        ("repeats", study.repeats is not None or setting.simulation.repeats == 0),
    ):
        if not wanted:
            raise PipelineError(f"{setting.where}: {field}: is missing; name the file that the simulation is to write")
    if study.repeats is not None and setting.simulation.repeats == 0:
        raise PipelineError(f"{setting.where}: repeats: names a file, but simulation: repeats is 0; remove it")
    for published in setting.simulation.published:
        for condition in published.conditions:
            if condition not in study.conditions:
                raise PipelineError(f'{setting.where}: simulation: published: there is no condition "{condition}"')


def make(setting: Setting, session: Session, folder: Path) -> dict[str, float]:
    """Simulate one session and write its log; returns the figures that ratings depend on. Runs in a worker."""
    outcome = simulate(setting, session.participant, session.condition)
    path = folder / session.file
    write_log(path, setting, session.participant, session.condition, session.order, outcome)
    return drivers(outcome)


def drivers(outcome: Outcome) -> dict[str, float]:
    """The figures of a session that ratings may depend on."""
    return {
        "completion_time_s": outcome.completion_time_s,
        "selection_rmse_mm": float(np.sqrt(outcome.selection_mse_mm2)),
        "corrections_per_target": outcome.corrections_per_target,
    }


def repeat(setting: Setting, number: int) -> dict[str, dict[str, float]]:
    """One more study with other people: each measure's mean over participants, by condition. Runs in a worker."""
    other, means = with_other_people(setting, number), {}
    for condition in setting.study.conditions:
        outcomes = [simulate(other, participant, condition) for participant in participants(other.simulation)]
        means[condition] = {
            "selection_mse_mm2": float(np.nanmean([outcome.selection_mse_mm2 for outcome in outcomes])),
            "completion_time_s": float(np.nanmean([outcome.completion_time_s for outcome in outcomes])),
        }
    return means


def with_other_people(setting: Setting, number: int) -> Setting:
    """The same study with the people of a repeat, numbered from 0."""
    settings = setting.simulation
    seed = int(digest_of([settings.seed, "repeat", number])[:12], 16)
    again = setting.study.model_copy(update={"simulation": settings.model_copy(update={"seed": seed})})
    return Setting(again, setting.where)


def _tables(
    setting: Setting, folder: Path, measured: dict[Session, dict[str, float]], repeats: dict[int, Any]
) -> list[str]:
    """Write the study's tables; returns their names."""
    study, settings, files = setting.study, setting.simulation, []
    names = participants(settings)
    order = {(one.participant, one.order): one.condition for one in measured}
    sequences = [
        [name, "-".join(order[name, place] for place in range(1, len(study.conditions) + 1))] for name in names
    ]
    assert study.participants is not None  # noqa: S101 - checked
    files.append(_write(folder, study.participants, ("participant", "sequence"), sequences))
    if settings.workload is not None and study.questionnaires is not None:
        rated = []
        for one in sorted(measured, key=lambda one: (one.participant, one.order)):
            given = ratings(settings.workload, settings.seed, one.participant, one.condition, measured[one])
            for scale, rating in given.items():
                rated.append([one.participant, one.condition, settings.workload.questionnaire, scale, f"{rating:g}"])
        header = ("participant", "condition", "questionnaire", "scale", "rating")
        files.append(_write(folder, study.questionnaires, header, rated))
    if settings.repeats and study.repeats is not None:
        rows = [
            [str(number + 1), condition, measure, repr(value)]
            for number in sorted(repeats)
            for condition, means in repeats[number].items()
            for measure, value in means.items()
        ]
        files.append(_write(folder, study.repeats, ("repeat", "condition", "measure", "value"), rows))
    return files


def _write(folder: Path, name: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
    return name


def _publish(folder: Path, beside: Path, files: Sequence[str], origin: str) -> None:
    """Move the finished files to their places, and remove files of an earlier run that this one did not write."""
    earlier = files_made(folder)
    (folder / MADE).unlink(missing_ok=True)
    for name in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (beside / name).replace(folder / name)
    for name in set(earlier) - set(files):
        inside(folder, name, str(folder / MADE), must_exist=False).unlink(missing_ok=True)
    whole = {"from": origin, "files": list(files)}
    (beside / MADE).write_text(json.dumps(whole, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    (beside / MADE).replace(folder / MADE)
