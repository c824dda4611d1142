"""What-if: small studies of a study's simulated participants with other trackers and other estimators."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from pipeline.errors import PipelineError, WorkerLostError, did_you_mean
from pipeline.simulation.session import Outcome, Setting, simulate
from pipeline.simulation.study_files import participants, with_other_people
from pipeline.simulation.tracker import Tracker
from pipeline.study.settings import Study
from pipeline.tables.table import Row


@dataclass(frozen=True)
class Grid:
    """What is explored: every tracker with every estimator, and how many people try each combination, how often."""

    latencies_s: tuple[float, ...]
    noise_sds_mm: tuple[float, ...]
    rates_hz: tuple[float, ...]
    estimators: tuple[str, ...]
    participants: int
    repeats: int

    @property
    def trackers(self) -> list[Tracker]:
        """Every combination of latency, noise and rate."""
        return [Tracker(*values) for values in product(self.latencies_s, self.noise_sds_mm, self.rates_hz)]

    def nearest(self, tracker: Tracker) -> Tracker:
        """The tracker of the grid with the nearest latency, noise and rate."""
        swept = (self.latencies_s, self.noise_sds_mm, self.rates_hz)
        near = [min(values, key=lambda value: abs(value - own)) for values, own in zip(swept, tracker, strict=True)]
        return Tracker(*near)


def stated(setting: Setting) -> Tracker:
    """The tracker that study.yaml states. Raises PipelineError if it has none."""
    tracker = setting.streams[1]
    return Tracker(
        tracker.latency_s, tracker.noise_sd_mm, tracker.rate_hz or setting.simulation.instruments.tracker_rate_hz
    )


def shown_estimators(study: Study) -> tuple[str, ...]:
    """The estimators that the study's conditions display, in the conditions' order."""
    return tuple(dict.fromkeys(study.shown[condition] for condition in study.conditions if condition in study.shown))


def with_tracker(setting: Setting, tracker: Tracker, estimators: Sequence[str], people: int) -> Setting:
    """The study with another tracker, also stated in its settings, and one condition per estimator, which displays it.

    `rate_hz` is stated only where study.yaml states it.
    """
    study, settings, (name, stream, _, _) = setting.study, setting.simulation, setting.streams
    other: dict[str, Any] = {"latency_s": tracker.latency_s, "noise_sd_mm": tracker.noise_sd_mm}
    if stream.rate_hz is not None:
        other["rate_hz"] = tracker.rate_hz
    instruments = settings.instruments.model_copy(update={"tracker_rate_hz": tracker.rate_hz})
    simulation = settings.model_copy(update={"instruments": instruments, "participants": people})
    changed = {
        "streams": {**study.streams, name: stream.model_copy(update=other)},
        "shown": {estimator: estimator for estimator in estimators},
        "simulation": simulation,
    }
    return Setting(study.model_copy(update=changed), setting.where)


def explore(
    setting: Setting, grid: Grid, executor: Executor, begin: Callable[[int], None], done: Callable[[], None]
) -> list[Row]:
    """Rows of `explore_people`, in order of trackers, estimators, repeats and participants.

    They do not depend on the executor. Raises PipelineError where study.yaml lacks what a simulation needs, or where a
    setting of the grid does not suit an estimator.
    """
    points = [(tracker, estimator) for tracker in grid.trackers for estimator in grid.estimators]
    _check(setting, grid, points)
    begin(len(points) * grid.repeats)
    futures = [
        executor.submit(small_study, with_tracker(setting, tracker, grid.estimators, grid.participants), one, number)
        for tracker, one in points
        for number in range(grid.repeats)
    ]
    for future in as_completed(futures):
        try:
            future.result()
        except WorkerLostError as lost:
            raise PipelineError(
                f"explore: a process died ({lost}), possibly out of memory; run it again, perhaps with fewer --jobs"
            ) from None
        done()
    repeated = [(tracker, estimator) for tracker, estimator in points for _ in range(grid.repeats)]
    return [
        {**tracker._asdict(), "estimator": estimator, **row}
        for (tracker, estimator), future in zip(repeated, futures, strict=True)
        for row in future.result()
    ]


def _check(setting: Setting, grid: Grid, points: Sequence[tuple[Tracker, str]]) -> None:
    """Raise PipelineError now for what would otherwise only fail in a worker."""
    _ = setting.layout
    for estimator in grid.estimators:
        if estimator not in setting.study.estimators:
            known = did_you_mean(estimator, setting.study.estimators)
            raise PipelineError(f'--estimators: {setting.where} has no estimator "{estimator}"{known}')
    for tracker, estimator in points:
        with_tracker(setting, tracker, (estimator,), grid.participants).shown(estimator)


def small_study(setting: Setting, estimator: str, number: int) -> list[Row]:
    """One repeat with one estimator, one row per participant. Runs in a worker.

    A repeat has the same people with every tracker and estimator, and with every tracker the same random draws. With
    another estimator the draws differ, as they do between two sessions of one person: with the same draws, differences
    would scatter less than in a study, and too few participants would seem enough.
    """
    again = with_other_people(setting, number)
    rows = []
    for participant in participants(again.simulation):
        outcome = simulate(again, participant, estimator)
        rows.append({"repeat": number + 1, "participant": participant, **_measured(outcome, again)})
    return rows


def _measured(outcome: Outcome, setting: Setting) -> Row:
    apart = np.hypot(*outcome.errors_mm.T)
    return {
        "completion_time_s": outcome.completion_time_s,
        "selection_mse_mm2": outcome.selection_mse_mm2,
        "selections": outcome.selected,
        "misses": int(np.sum(apart > setting.layout.radius_mm)),  # NaN, where nothing was selected, is not above
        "not_selected": len(apart) - outcome.selected,
    }
