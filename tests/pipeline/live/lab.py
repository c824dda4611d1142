"""A study that is run by hand, without sockets, clocks or files: what happens, and what was wanted done."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.live import run_state, study_run
from pipeline.live.events import (
    Action,
    Event,
    Examined,
    Joined,
    Reading,
    Said,
    Tell,
    Tick,
    Write,
)
from pipeline.live.messages import Do
from pipeline.live.outgoing import Refused
from pipeline.live.run_state import StudyRun
from pipeline.live.watch import Light
from tests.pipeline.live.studies import STUDY, study_in

EPOCH_NS = 1_764_350_000_000_000_000
MS = 1_000_000
OPERATOR, PHONE = 1, 2


class Lab:
    """A study that is run by hand: what happens, and what was wanted done."""

    def __init__(self, folder: Path, text: str = STUDY) -> None:
        self.study, setup = study_in(folder, text)
        self.run: StudyRun = run_state.begin(setup, setup.empty_plan())
        self.actions: list[Action] = []
        self.at_ms = 0.0
        self.happens(Joined("operator", OPERATOR, EPOCH_NS))
        self.happens(Joined("phone", PHONE, EPOCH_NS))
        done = tuple(Light(name, "green", "Done.") for name in setup.guided)
        self.happens(Examined(done, (), EPOCH_NS))

    @property
    def now(self) -> int:
        return EPOCH_NS + round(self.at_ms * MS)

    def happens(self, event: Event) -> list[Action]:
        self.run, actions = study_run.step(self.run, event)
        self.actions += actions
        return list(actions)

    def goes_on(self, seconds: float, tracker: bool = True, imu: bool = True) -> list[Action]:
        """Time passes, and sensors send."""
        found: list[Action] = []
        for _ in range(round(seconds * 100)):
            self.at_ms += 10
            if imu:
                values = (0.0, 9.80665, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
                found += self.happens(Reading("imu", self.now, self.now, values))
            if tracker and round(self.at_ms) % 30 == 0:
                found += self.happens(Reading("tracker", self.now - 100 * MS, self.now, (0.0, 0.5, 1.0)))
            found += self.happens(Tick(self.now))
        return found

    def does(self, what: str, text: str = "") -> list[Action]:
        return self.happens(Said("operator", OPERATOR, Do(what, text, "d"), self.now))


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return Lab(tmp_path)


def refusals(actions: list[Action]) -> list[str]:
    return [one.message.why for one in actions if isinstance(one, Tell) and isinstance(one.message, Refused)]


def notes(actions: list[Action]) -> list[str]:
    written = (one.message for one in actions if isinstance(one, Write))
    return [str(one.event["type"]) for one in written if one.topic == "/recorder/notes" and one.event]
