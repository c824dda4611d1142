"""Plays a whole study faster than it would take: simulated participants, sensors and an operator who only goes on.

The core is that of a real study; only time is simulated, and files are written at once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.live import plan, run_state, study_run
from pipeline.live.adapters.demo import Participant
from pipeline.live.clerk import Clerk, FileAction
from pipeline.live.events import Action, Event, Joined, Open, Said, Show, Tell, Tick
from pipeline.live.journal import Journal
from pipeline.live.messages import Answer, Do, Drawn, Exchange, Hello, Ping, Select, Submit
from pipeline.live.outgoing import Form, Outgoing
from pipeline.live.run_state import StudyRun
from pipeline.live.setup import Setup
from pipeline.sessions.recording import seeded
from pipeline.simulation.session import Setting
from pipeline.simulation.workload import ratings
from pipeline.study.settings import Study
from pipeline.study.simulation import SelectionSimulation

SIMULATED = "simulated by Steadyhand: a demo, played through the live study"
OPERATOR, PHONE, FORMS = 1, 2, 3
_STEP_NS = 100_000_000
_FLUSH_NS = 500_000_000
_SETS_OFF_S = 0.5  # after the countdown
_NS_PER_MS = 1e6
_HELLO = Hello("phone", 1, "a simulated phone", (854.0, 480.0, 2.0), "granted", True, True)


def simulated(study: Study, seed: int = 0) -> Study:
    """The study with simulated people, who set off when the countdown is over, and without practice."""
    assert study.recording is not None  # noqa: S101 - checked by `set_up`
    given = study.simulation
    people = given if isinstance(given, SelectionSimulation) else None
    if people is None:
        people = SelectionSimulation(kind="selection", seed=seed, participants=1)
    still = study.recording.countdown_s + _SETS_OFF_S
    none = study.recording.practice.model_copy(update={"targets": 0})
    recording = study.recording.model_copy(update={"practice": none})
    longest = study.recording.abort_after_s + still
    people = people.model_copy(update={"still_before_s": max(still, 1.0), "longest_s": longest})
    return study.model_copy(update={"simulation": people, "recording": recording})


class Players:
    """An operator, a phone and a form that play `participants` participants through a study."""

    def __init__(self, setup: Setup, folder: Path, journal: Journal, known: plan.Plan, now_ns: int) -> None:
        self.setting = Setting(setup.study, str(folder / "study.yaml"))
        self.run: StudyRun = run_state.begin(setup, known)
        self.clerk, self.now_ns = Clerk(journal), now_ns
        self.participant: Participant | None = None
        self.played: dict[tuple[str, str], Participant] = {}
        self.pending: deque[Event] = deque()
        self.told: list[tuple[int, Outgoing]] = []
        self._last_n, self._drawn_at, self._flushed_ns = 0, now_ns, now_ns
        self._form: Form | None = None

    def play(self, participants: int, done: Callable[[str], None] = lambda file: None) -> None:
        """Play until so many participants have done all their tasks."""
        for role, client in (("operator", OPERATOR), ("phone", PHONE), ("questionnaire", FORMS)):
            self.happens(Joined(role, client, self.now_ns))  # type: ignore[arg-type]
        self.says("phone", PHONE, _HELLO)
        self._ping()
        while self._finished() < participants:
            file = None if self.run.closed is None else self.run.closed.file
            self._task()
            closed = self.run.closed
            if closed is not None and closed.file != file:
                done(closed.file)

    def _finished(self) -> int:
        known = self.run.plan
        return sum(
            all(task.state == "done" and plan.open_questionnaire(known, task) is None for task in person.tasks)
            for person in known.persons
        )

    def _task(self) -> None:
        if self.run.phase == "questionnaire":
            self._fill_in()
            return
        self.says("operator", OPERATOR, Do("start", "simulated", str(self.now_ns)))
        while self.run.phase == "session" and self.participant is not None:
            self._move(self.participant)

    def _move(self, participant: Participant) -> None:
        """One reading, the presses before it, and what the phone draws of it."""
        at = participant.next_ns
        if at is None:
            self.now_ns += _STEP_NS
            self.happens(Tick(self.now_ns))
            return
        taps, reading = participant.move()
        for tap in taps:
            self.now_ns = max(self.now_ns, tap.at_ns)
            self.says("phone", PHONE, Select(self._last_n, tap.at_ns / _NS_PER_MS))
        self.now_ns = max(self.now_ns, at)
        if self.now_ns - self._flushed_ns >= _FLUSH_NS:
            self._flushed_ns = self.now_ns
            self.happens(self.clerk.flush(lambda: self.now_ns))
        self.happens(Tick(self.now_ns))
        self.happens(reading)

    def _ping(self) -> None:
        """Pings without any delay: this phone's clock is the recorder's."""
        at = self.now_ns / _NS_PER_MS
        self.says("phone", PHONE, Ping(at, Exchange(at, at, at, at)))

    def _fill_in(self) -> None:
        form = self._form
        assert form is not None  # noqa: S101 - told when the log was closed
        now = self.run.now
        assert now is not None  # noqa: S101
        given = self._ratings(now[0].id, now[0].tasks[now[1]].condition)
        for item in form.items:
            steps = int(str(item["steps"]))
            share = given.get(str(item["id"]), 50.0) / 100.0
            value = min(max(round(share * steps), 0), steps)
            answer = Answer(form.questionnaire, str(item["id"]), value, f"{self.now_ns}-{item['id']}"[:32])
            self.says("questionnaire", FORMS, answer)
        for pair in form.pairs:  # what was rated higher counts more
            first, second = (given.get(str(pair[side]), 50.0) for side in ("first", "second"))
            answer = Answer(
                form.questionnaire, str(pair["id"]), int(second > first), f"{self.now_ns}-{pair['id']}"[:32]
            )
            self.says("questionnaire", FORMS, answer)
        self.says("questionnaire", FORMS, Submit(form.questionnaire, str(self.now_ns)))
        self.now_ns += _STEP_NS

    def _ratings(self, participant: str, condition: str) -> Mapping[str, float]:
        """Ratings out of 100, by the study's own model where it has one."""
        settings, played = self.setting.simulation, self.played.get((participant, condition))
        if settings.workload is None or played is None:
            random = seeded(str(settings.seed), participant, condition, "ratings")
            names = [item.id for one in self.run.setup.recording.questionnaires for item in one.items]
            return {name: float(random.integers(0, 101)) for name in names}
        taps = played.taps
        error = np.hypot(taps[:, 1] - self._targets[:, 0], taps[:, 2] - self._targets[:, 1])
        measured = {
            "completion_time_s": float(np.nanmax(taps[:, 0])) - settings.still_before_s,
            "selection_rmse_mm": float(np.sqrt(np.nanmean(error**2))),
            "corrections_per_target": float(played.plans) / len(taps),
        }
        return ratings(settings.workload, settings.seed, participant, condition, measured)

    @property
    def _targets(self) -> np.ndarray:
        return np.array(self.run.setup.targets_mm)

    def says(self, role: str, client: int, message: object) -> None:
        """A page sends a message."""
        self.happens(Said(role, client, message, self.now_ns))  # type: ignore[arg-type]

    def happens(self, event: Event) -> None:
        """An event, and everything that follows from it."""
        self.pending.append(event)
        while self.pending:
            self.run, actions = study_run.step(self.run, self.pending.popleft())
            for action in actions:
                self._carry_out(action)

    def _carry_out(self, action: Action) -> None:
        if isinstance(action, Show):
            shown = action.message
            self._drawn_at = max(self._drawn_at, action.made_ns) + 1
            self._last_n = shown.n  # type: ignore[union-attr]
            if self.participant is not None:
                self.participant.sees((shown.x, shown.y))  # type: ignore[union-attr]
            drawn = Drawn(self._last_n, self._drawn_at / _NS_PER_MS)
            self.pending.append(Said("phone", PHONE, drawn, self._drawn_at))
        elif isinstance(action, Tell):
            self.told.append((action.client, action.message))
            if action.client == FORMS:
                self._form = action.message if isinstance(action.message, Form) else None
        elif isinstance(action, FileAction):
            if isinstance(action, Open):
                self._begin(action)
            self.pending.extend(self.clerk.perform([action], lambda: self.now_ns))

    def _begin(self, opened: Open) -> None:
        """A new task: the participant takes their place."""
        longest = self.setting.simulation.longest_s + 1.0
        self.participant = Participant(self.setting, opened.participant, opened.condition, self.now_ns, longest)
        self.played[opened.participant, opened.condition] = self.participant


def as_simulated(setup: Setup) -> Setup:
    """The setup with simulated people in its study."""
    study = simulated(setup.study)
    assert study.recording is not None  # noqa: S101
    return replace(setup, study=study, recording=study.recording, simulated=SIMULATED)
