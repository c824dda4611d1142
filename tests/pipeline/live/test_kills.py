"""A recorder that is killed loses at most a second, and the next one knows where the study stands."""

from __future__ import annotations

import os
import random
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.live import plan
from pipeline.live.bots import Players, as_simulated
from pipeline.live.events import Event
from pipeline.live.journal import PART, Journal
from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.live.studies import STUDY, study_in

EPOCH_NS = 1_764_350_000_000_000_000
_EVERY_NS = 20_000_000
_MOST_S = 15.0  # of a study of 22 s: in it the first task ends and the second begins
_A_MOMENT_S = 0.005  # of the wall clock, in which some tens of readings are played


def play_and_say(folder: Path, ready: int, said: int) -> None:
    """Play a study, and write the time that it is in the study to `said` again and again."""
    study, setup = study_in(folder)
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
    study, setup = study_in(folder)
    journal = Journal(folder, study)
    journal.hold()
    Players(as_simulated(setup), folder, journal, setup.empty_plan(), EPOCH_NS).play(1)
    journal.release()


def in_the_study(seconds: float, moment_s: float = 0.0) -> Callable[[int], bytes]:
    """Waits until so much of the study is played since it was first said, however fast this machine plays it.

    After a moment more by the wall clock the player may be at any step.
    """

    def wait(said_in: int) -> bytes:
        told = os.read(said_in, 8)
        began = int.from_bytes(told, "big")
        while int.from_bytes(told[-8:], "big") - began < seconds * 1e9 and (part := os.read(said_in, 8)):
            told += part
        time.sleep(moment_s)
        return told

    return wait


def killed(folder: Path, wait: Callable[[int], bytes]) -> int:
    """Play in a process that is killed after a wait; returns the time in the study that it had come to, in ns."""
    (ready_in, ready), (said_in, said) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        try:
            play_and_say(folder, ready, said)
        finally:
            os._exit(0)
    os.close(ready)
    os.close(said)
    assert os.read(ready_in, 1) == b"1"
    told = wait(said_in)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while part := os.read(said_in, 65536):
        told += part
    os.close(ready_in)
    os.close(said_in)
    return int.from_bytes(told[-8:], "big") if told else EPOCH_NS


def survives(folder: Path, played_s: float, moment_s: float) -> str:
    """Kill a study, and look at what is left of it; returns the state of its first task."""
    came_to = killed(folder, in_the_study(played_s, moment_s))
    study, setup = study_in(folder)
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
        assert came_to - newest <= 1_000_000_000
    assert not list((folder / "data").glob("*.new"))
    return known.persons[0].tasks[0].state if known.persons else "todo"


@pytest.mark.parametrize("kills", [pytest.param(4, id="a few"), pytest.param(196, id="many", marks=pytest.mark.slow)])
def test_a_recorder_killed_at_any_moment_loses_a_second_at_most(kills: int, tmp_path: Path) -> None:
    chance, states = random.Random(kills), []  # noqa: S311
    for number in range(kills):
        played_s, moment_s = chance.uniform(0, _MOST_S), chance.uniform(0, _A_MOMENT_S)
        states.append(survives(tmp_path / str(number), played_s, moment_s))
    assert "cut" in states
    assert set(states) <= {"todo", "cut", "done"}


def test_what_is_left_of_a_cut_session_is_read_by_the_report(tmp_path: Path, steadyhand: Steadyhand) -> None:
    killed(tmp_path, in_the_study(3.0))
    study, _ = study_in(tmp_path, STUDY.replace("comparisons: [{measure: completion_time_s, test: t_paired}]\n", ""))
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
