"""What-if: a study's simulated participants with other trackers and other estimators, whole small studies at a time."""

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
from pipeline.simulation.what_pays import Tracker
from pipeline.study.settings import Study
from pipeline.tables.table import Row


@dataclass(frozen=True)
class Grid:
    """What is swept: every tracker with every estimator, and how many people try each."""

    latencies_s: tuple[float, ...]
    noise_sds_mm: tuple[float, ...]
    rates_hz: tuple[float, ...]
    estimators: tuple[str, ...]
    participants: int
    repeats: int

    @property
    def trackers(self) -> list[Tracker]:
        """Every combination."""
        return [Tracker(*one) for one in product(self.latencies_s, self.noise_sds_mm, self.rates_hz)]

    def nearest(self, tracker: Tracker) -> Tracker:
        """The one of the grid that is most like a tracker, in each respect for itself."""
        swept = (self.latencies_s, self.noise_sds_mm, self.rates_hz)
        near = [min(values, key=lambda one: abs(one - own)) for values, own in zip(swept, tracker, strict=True)]
        return Tracker(*near)


def stated(setting: Setting) -> Tracker:
    """The tracker that study.yaml states. PipelineError where it has none."""
    tracker = setting.streams[1]
    return Tracker(
        tracker.latency_s, tracker.noise_sd_mm, tracker.rate_hz or setting.simulation.instruments.tracker_rate_hz
    )


def shown_estimators(study: Study) -> tuple[str, ...]:
    """Those that the study's conditions display, in the conditions' order."""
    return tuple(dict.fromkeys(study.shown[one] for one in study.conditions if one in study.shown))


def with_tracker(setting: Setting, tracker: Tracker, estimators: Sequence[str], people: int) -> Setting:
    """The study with another tracker, stated as such, and a display by the name of each estimator.

    `rate_hz` is stated where study.yaml states it.
    """
    study, settings, (name, stream, _, _) = setting.study, setting.simulation, setting.streams
    other: dict[str, Any] = {"latency_s": tracker.latency_s, "noise_sd_mm": tracker.noise_sd_mm}
    if stream.rate_hz is not None:
        other["rate_hz"] = tracker.rate_hz
    instruments = settings.instruments.model_copy(update={"tracker_rate_hz": tracker.rate_hz})
    simulation = settings.model_copy(update={"instruments": instruments, "participants": people})
    changed = {
        "streams": {**study.streams, name: stream.model_copy(update=other)},
        "shown": {one: one for one in estimators},
        "simulation": simulation,
    }
    return Setting(study.model_copy(update=changed), setting.where)


def explore(
    setting: Setting, grid: Grid, executor: Executor, begin: Callable[[int], None], done: Callable[[], None]
) -> list[Row]:
    """Rows of `explore_people`: trackers, then estimators, repeats and participants.

    They do not depend on the executor. PipelineError where study.yaml lacks what a simulation needs, or a setting of
    the grid does not suit an estimator.
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
                f"explore: a process was lost ({lost}); run it again, perhaps with fewer --jobs"
            ) from None
        done()
    placed = [(tracker, estimator) for tracker, estimator in points for _ in range(grid.repeats)]
    return [
        {**tracker._asdict(), "estimator": estimator, **row}
        for (tracker, estimator), future in zip(placed, futures, strict=True)
        for row in future.result()
    ]


def _check(setting: Setting, grid: Grid, points: Sequence[tuple[Tracker, str]]) -> None:
    """PipelineError for what would only be found in a worker."""
    _ = setting.layout
    for estimator in grid.estimators:
        if estimator not in setting.study.estimators:
            known = did_you_mean(estimator, setting.study.estimators)
            raise PipelineError(f'--estimators: {setting.where} has no estimator "{estimator}"{known}')
    for tracker, estimator in points:
        with_tracker(setting, tracker, (estimator,), grid.participants).shown(estimator)


def small_study(setting: Setting, estimator: str, number: int) -> list[Row]:
    """One repeat with one estimator: a row a participant. Runs in a worker.

    A repeat's people are the same with every tracker and estimator, and with every tracker have the same luck. With
    another estimator their luck is another, as that of two sessions of one person is: were it the same, differences
    would scatter less than a study's, and too few participants would seem enough.
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
