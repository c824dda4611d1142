"""A study as its run needs it: checked once, estimators built and warmed up, and each attempt's settings made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from fusion_core import Estimator, Sample, Samples, Sensor
from pipeline.engine.cache import digest_of
from pipeline.errors import PipelineError
from pipeline.live import checks, watch
from pipeline.live.orientation import Aligner
from pipeline.live.outgoing import Welcome
from pipeline.live.plan import Plan
from pipeline.live.session_state import Attempt
from pipeline.live.streams import LiveStream, live_streams, required
from pipeline.sessions.estimators import build_estimator, sensor, sensors_used
from pipeline.simulation.layout import targets
from pipeline.study.recording import Recording
from pipeline.study.settings import Study
from pipeline.study.simulation import Task
from pipeline.study.streams import AccelerationStream
from pipeline.study.units import G_MM_S2

_NS_PER_S = 1e9
_WARM_UP_STEPS = 50
TEXTS = Path(__file__).parent / "pages" / "texts"
_RECORDED_BY = {"conditions", "axes", "streams", "events", "display", "estimators", "shown", "task", "recording"}


@dataclass(frozen=True)
class Setup:
    """What does not change while a study is run.

    `simulated` says so where readings are, `mouse` that a pointer is the hand. `links` are the addresses, by role, that
    phones and questionnaires join at. `motion_stream` is the stream of the phone's own motion, if it is used,
    `turned_stream` that one, or another sender's accelerations, and `aligner` finds the orientation of its readings
    that bring none. `guided` are the checks before a task, and `corners_mm` what one of them wants
    reached; there are none where sensors are simulated.
    """

    study: Study
    recording: Recording
    task: Task
    streams: Mapping[str, LiveStream]
    estimators: Mapping[str, Estimator]
    targets_mm: tuple[tuple[float, float], ...]
    topics: Mapping[str, str]
    digest: str
    version: str
    mouse: bool = False
    simulated: str = ""
    links: tuple[tuple[str, str], ...] = ()
    aligner: Aligner | None = None
    motion_stream: str | None = None
    turned_stream: str | None = None
    guided: tuple[str, ...] = ()
    corners_mm: tuple[tuple[float, ...], ...] = ()

    @cached_property
    def tracker(self) -> str | None:
        """The tracker's stream, which is asked for with every reading."""
        return self.study.tracker

    def estimator(self, condition: str) -> Estimator:
        """The estimator that a condition shows."""
        return self.estimators[self.study.shown[condition]]

    def uses(self, condition: str) -> frozenset[str]:
        """The streams that change what a condition shows."""
        armed = self._armed(condition)
        return sensors_used(self.study, self.study.shown[condition]) | ({armed} if armed else set())

    def _armed(self, condition: str) -> str | None:
        """The phone whose lever arm a condition's estimator takes into account, as a report does (`recording.show`)."""
        armed = (name for name, one in self.streams.items() if one.arm_mm.any())
        return next((name for name in armed if name in self.estimator(condition).sensors), None)

    def attempt(self, participant: str, condition: str) -> Attempt:
        """The settings of an attempt."""
        recording, armed = self.recording, self._armed(condition)
        return Attempt(
            participant,
            condition,
            self.estimator(condition),
            self.uses(condition),
            self.streams,
            self.study.axes,
            self.targets_mm,
            self.topics["display"],
            self.topics["events"],
            min(recording.practice.targets, len(self.targets_mm)),
            round(recording.countdown_s * _NS_PER_S),
            round(recording.abort_after_s * _NS_PER_S),
            round(recording.selection.confirm_ms * 1e6),
            armed,
        )

    def welcome(self, task_number: int) -> Welcome:
        """The task for the phone, which never learns the condition."""
        task, selection = self.task, self.recording.selection
        return Welcome(
            task=f"Task {task_number}",
            of=len(self.study.conditions),
            px_per_mm=self.study.display.px_per_mm if self.study.display else 1.0,
            window_mm=task.window_mm,
            canvas_x_mm=task.canvas_x_mm,
            canvas_y_mm=task.canvas_y_mm,
            path_mm=task.path_mm,
            targets_mm=self.targets_mm,
            target_diameter_mm=task.target_diameter_mm,
            button={"side": selection.button, "mm": selection.mm},
            confirm_ms=selection.confirm_ms,
            window=self.recording.phone.window,
            mouse=self.mouse,
        )

    def empty_plan(self) -> Plan:
        """A plan with nobody in it."""
        questionnaires = {one.id: tuple(item.id for item in one.items) for one in self.recording.questionnaires}
        pairs = {one.id: one.pairs for one in self.recording.questionnaires if one.pairs}
        return Plan(self.study.conditions, questionnaires, pairs=pairs)


def set_up(study: Study, folder: Path, *, mouse: bool = False, simulated: str = "") -> Setup:
    """The study, checked. Raises PipelineError for what a live study needs and study.yaml lacks."""
    from importlib.metadata import version

    where = str(folder / "study.yaml")
    topics = required(study, where)
    assert study.recording is not None and study.task is not None  # noqa: S101 - checked
    _knows_language(study.recording, where)
    motion = next((name for name, one in study.recording.senders.items() if one.phone is not None), None)
    streams = live_streams(study, where)
    turned = motion or _may_lack_orientation(study.recording, streams)
    shown = {study.shown[condition] for condition in study.conditions}
    targets_mm = tuple((float(x), float(y)) for x, y in targets(study.task))
    return Setup(
        study,
        study.recording,
        study.task,
        streams,
        {name: build_estimator(study, name) for name in shown},
        targets_mm,
        topics,
        digest_of(study.model_dump_json(include=_RECORDED_BY)),
        version("steadyhand"),
        mouse,
        simulated,
        aligner=None if turned is None else _aligner(study, turned),
        motion_stream=motion,
        turned_stream=turned,
        guided=() if simulated else checks.guided(study),
        corners_mm=tuple(watch.corners(study.task.path_mm, targets_mm)),
    )


def _knows_language(recording: Recording, where: str) -> None:
    """Raise PipelineError where the pages have no texts in the study's language."""
    known = sorted(path.stem for path in TEXTS.glob("*.yaml"))
    if recording.language not in (None, *known):
        raise PipelineError(
            f'{where}: recording: language: the pages have no texts in "{recording.language}"; use'
            f" {' or '.join(known)}, or leave it out for the language of each browser"
        )


def _may_lack_orientation(recording: Recording, streams: Mapping[str, LiveStream]) -> str | None:
    """The first stream of accelerations that are not simulated."""
    return next(
        (name for name, one in recording.senders.items() if one.demo is None and streams[name].content != "position"),
        None,
    )


def _aligner(study: Study, name: str) -> Aligner | None:
    """What finds the orientation of the phone whose stream that is; None without a tracker."""
    stream = study.streams[name]
    if study.tracker is None or not isinstance(stream, AccelerationStream):
        return None
    tracker, phone = (
        Sensor(one.operator, one.noise_sd, one.latency_s, 3, one.rate_hz)
        for one in (sensor(study, study.sensor_streams[of]) for of in (study.tracker, name))
    )
    return Aligner(tracker, phone, stream.gravity_mm_s2)


def warm_up(setup: Setup) -> None:
    """Step every estimator, so that none waits for the compiler when it counts (10 s when nothing is cached)."""
    for estimator in setup.estimators.values():
        state = estimator.start()
        for step in range(_WARM_UP_STEPS):
            for name, of_stream in estimator.sensors.items():
                time, rotation = step / 30, np.eye(3)[: of_stream.dimension]
                force = np.array([0.0, G_MM_S2, 0.0])
                reading = Sample(time, time + 0.01, np.zeros(of_stream.dimension), rotation, force)
                state = estimator.update(state, name, reading)
            estimator.predict(state, step / 30 + 0.02)
        _replay(estimator)
    if setup.aligner is not None:
        heading = setup.aligner.filter.position(setup.aligner.filter.start(), 0.0, 0.01, np.zeros(3))
        setup.aligner.filter.angle(setup.aligner.filter.acceleration(heading, 0.02, 0.02, np.zeros(3)))


def _replay(estimator: Estimator) -> None:
    """Replay readings of a hand at rest, as the log is replayed when a task is over."""
    times = np.arange(_WARM_UP_STEPS) / 30
    rows = {
        name: Samples(
            times,
            times + 0.01,
            np.zeros((len(times), one.dimension)),
            np.tile(np.eye(3)[: one.dimension], (len(times), 1, 1)),
            np.tile([0.0, G_MM_S2, 0.0], (len(times), 1)),
        )
        for name, one in estimator.sensors.items()
    }
    estimator.replay(rows, times + 0.02)
