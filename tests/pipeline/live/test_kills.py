"""A recorder that is killed loses at most a second, and the next one knows where the study stands."""

from __future__ import annotations

import os
import random
import select
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline.live import plan
from pipeline.live.bots import Players, as_simulated
from pipeline.live.events import Event
from pipeline.live.journal import PART, Journal
from pipeline.live.setup import Setup
from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from pipeline.study.settings import Study
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.live.studies import BRIEF, STUDY, shown_alone, study_in

EPOCH_NS = 1_764_350_000_000_000_000
_EVERY_NS = 20_000_000
_FIRST_TASK_S = {STUDY: 11.9, BRIEF: 4.1}  # and a little longer
_MOST_S = {STUDY: 15.0, BRIEF: 6.0}  # in it the first task ends and the second begins
_A_MOMENT_S = 0.005  # of the wall clock, in which some tens of readings are played


def play_and_say(folder: Path, text: str, ready: int, said: int) -> None:
    """Play a study, and write the time that it is in the study to `said` again and again."""
    study, setup = study_in(folder, text)
    journal = Journal(folder, study)
    journal.hold()
    players = Players(as_simulated(setup), folder, journal, setup.empty_plan(), EPOCH_NS)
    before, last, begun = players.happens, [0], [False]

    def happens(event: Event) -> None:
        before(event)
        if not begun[0] and players.participant is not None:
            begun[0] = True
            os.write(ready, b"1")
        if players.now_ns - last[0] > _EVERY_NS:
            last[0] = players.now_ns
            os.write(said, players.now_ns.to_bytes(8, "big"))

    players.happens = happens  # type: ignore[method-assign]
    players.play(1)


@pytest.fixture(scope="module", autouse=True)
def warm(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Everything is compiled and loaded before processes are forked that are killed within a second."""
    folder = tmp_path_factory.mktemp("warm")
    study, setup = study_in(folder, BRIEF)
    journal = Journal(folder, study)
    journal.hold()
    Players(as_simulated(setup), folder, journal, setup.empty_plan(), EPOCH_NS).play(1)
    journal.release()


@dataclass
class Player:
    """A process that plays a study; how far it has come it says in `said_in`."""

    pid: int
    said_in: int
    began_ns: int
    now_ns: int

    def plays(self, seconds: float, moment_s: float) -> None:
        """Waits until so much of the study is played since it was first said, however fast this machine plays it.

        After a moment more by the wall clock the player may be at any step.
        """
        while self.now_ns - self.began_ns < seconds * 1e9 and self._hears():
            pass
        time.sleep(moment_s)

    def stops(self, how: signal.Signals) -> None:
        """Stop it where it is, for good or for a while, and hear all that it has said until then."""
        os.kill(self.pid, how)
        os.waitid(os.P_PID, self.pid, os.WEXITED | os.WSTOPPED | os.WNOWAIT)
        while select.select([self.said_in], [], [], 0)[0] and self._hears():
            pass

    def goes_on(self) -> None:
        os.kill(self.pid, signal.SIGCONT)

    def _hears(self) -> bool:
        told = os.read(self.said_in, 8)
        self.now_ns = int.from_bytes(told, "big") if told else self.now_ns
        return bool(told)


@contextmanager
def playing(folder: Path, text: str = STUDY) -> Iterator[Player]:
    """Play in a process, which is killed at the end."""
    (ready_in, ready), (said_in, said) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        try:
            play_and_say(folder, text, ready, said)
        finally:
            os._exit(0)
    os.close(ready)
    os.close(said)
    assert os.read(ready_in, 1) == b"1"
    began_ns = int.from_bytes(os.read(said_in, 8), "big")
    try:
        yield Player(child, said_in, began_ns, began_ns)
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(ready_in)
        os.close(said_in)


def state_after(folder: Path, study: Study, setup: Setup, first_task_s: float, came_to_ns: int) -> str:
    """What a recorder finds that begins after another was killed; returns the state of the first task."""
    journal = Journal(folder, study)
    journal.hold()  # the lock of a process that is dead holds nobody
    known = setup.empty_plan()
    for record in journal.records():
        known = plan.after(known, record)
    known = plan.with_logs(known, journal.found_logs())
    journal.release()
    for path in sorted((folder / "data").glob(f"*{PART}")):
        topics = [
            Wanted(stream.topic, "position") for stream in study.streams.values() if stream.kind != "acceleration"
        ]
        log = mcap.read(path, topics)
        newest = max(int(one.arrival_ns.max()) for one in log.topics.values())
        assert came_to_ns - newest <= 1_000_000_000
    assert not list((folder / "data").glob("*.new"))
    state = known.persons[0].tasks[0].state if known.persons else "todo"
    if 1.0 < (came_to_ns - EPOCH_NS) / 1e9 < first_task_s:  # else a log that holds nothing would be no loss
        assert state == "cut"
    return state


def test_a_recorder_killed_at_any_moment_loses_a_second_at_most(tmp_path: Path) -> None:
    chance, states = random.Random(4), []  # noqa: S311
    for number in range(4):
        folder = tmp_path / str(number)
        with playing(folder) as player:
            player.plays(chance.uniform(0, _MOST_S[STUDY]), chance.uniform(0, _A_MOMENT_S))
            player.stops(signal.SIGKILL)
        states.append(state_after(folder, *study_in(folder), _FIRST_TASK_S[STUDY], player.now_ns))
    assert "cut" in states
    assert set(states) <= {"todo", "cut", "done"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(7))
def test_so_it_would_be_at_every_one_of_many_moments(seed: int, tmp_path: Path) -> None:
    """Each time the player is halted and its files are copied: a kill would have left these, for it writes no more."""
    chance, found = random.Random(seed), []  # noqa: S311
    folder = tmp_path / "played"
    with playing(folder, BRIEF) as player:
        for number, seconds in enumerate(sorted(chance.uniform(0, _MOST_S[BRIEF]) for _ in range(28))):
            player.plays(seconds, chance.uniform(0, _A_MOMENT_S))
            player.stops(signal.SIGSTOP)
            left = shutil.copytree(folder, tmp_path / str(number))
            found.append((left, player.now_ns))
            player.goes_on()
    study, setup = study_in(folder, BRIEF)
    states = [state_after(left, study, setup, _FIRST_TASK_S[BRIEF], came_to_ns) for left, came_to_ns in found]
    assert "cut" in states
    assert set(states) <= {"todo", "cut", "done"}


def test_what_is_left_of_a_cut_session_is_read_by_the_report(tmp_path: Path, steadyhand: Steadyhand) -> None:
    with playing(tmp_path) as player:
        player.plays(3.0, 0.0)
    text = STUDY.replace("comparisons: [{measure: completion_time_s, test: t_paired}]\n", "")
    study, _ = study_in(tmp_path, shown_alone(text))
    journal = Journal(tmp_path, study)
    journal.hold()
    (found,) = [log for log in journal.found_logs() if not log.whole]
    journal.resolve(found.participant, found.condition, set_aside=False)
    journal.tables(({"participant": found.participant, "sequence": "kinect-fusion"},), ())
    journal.release()
    (tmp_path / "questionnaires.csv").write_text(
        "participant,condition,questionnaire,scale,rating\nP01,kinect,nasa_tlx,mental,50\n", encoding="utf-8"
    )
    ran = steadyhand("compare", tmp_path)
    assert ran.code == 1, ran.err  # read in part, and said so
    assert "ends without its summary" in ran.err
    assert all(row["max_mm"] <= 1e-9 for row in steadyhand.results()["replay_agreement"])
