"""What goes wrong in a laboratory, and what must happen then. Other faults are in the tests of what they concern."""

from __future__ import annotations

import asyncio
import errno
import json
from pathlib import Path
from typing import cast

import pytest
import yaml
from starlette.websockets import WebSocket, WebSocketDisconnect

from pipeline.errors import PipelineError
from pipeline.live import clocks, desk, panel, run_state, study_run
from pipeline.live.adapters import websocket
from pipeline.live.clerk import Clerk
from pipeline.live.events import (
    Action,
    Close,
    Closed,
    Disk,
    Dropped,
    Left,
    Open,
    Reading,
    Said,
    Save,
    Saved,
    Show,
    Tell,
    WallClock,
    Woke,
    Write,
)
from pipeline.live.journal import PART, Journal
from pipeline.live.loop import Clock, Outbox
from pipeline.live.messages import Drawn, Exchange, Ping
from pipeline.live.outgoing import Say, Shown, Whole
from pipeline.sessions.logs.mcap import Message
from tests.pipeline.live.lab import EPOCH_NS, MS, OPERATOR, PHONE, Lab, lab, notes, refusals
from tests.pipeline.live.studies import study_in

__all__ = ["lab"]  # a fixture


def test_a_task_does_not_begin_without_its_sensors_unless_the_operator_says_why(lab: Lab) -> None:
    lab.goes_on(0.5, imu=False)
    assert refusals(lab.does("start")) == []  # the first condition's estimator uses the tracker alone
    lab.does("abort")
    lab.happens(Closed("data/set-aside/P01_kinect.1.mcap", lab.now))
    lab.goes_on(1.0, tracker=False)
    (why,) = refusals(lab.does("start"))
    assert why.startswith("tracker is silent")
    opened = [one for one in lab.does("start", "it is being repaired") if isinstance(one, Open)]
    assert opened[0].facts["started_although"] == "it is being repaired"
    assert opened[0].facts["attempt"] == "2"


def test_without_a_phone_nothing_begins(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.run, _ = study_run.step(lab.run, Left("phone", PHONE, lab.now))
    lab.goes_on(0.5)
    assert "No phone is connected" in refusals(lab.does("start", "anyway"))[0]


def test_a_tracker_that_falls_silent_is_said_and_noted(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(2.0)
    silent = lab.goes_on(2.5, tracker=False)
    assert [one.message.text for one in silent if isinstance(one, Tell) and isinstance(one.message, Say)] == [
        "Please wait."
    ]
    assert notes(silent) == ["sensor_silent", "sensor_lost"]
    lights = next(
        one.message.content["lights"]
        for one in reversed(silent)
        if isinstance(one, Tell) and isinstance(one.message, Whole) and one.message.type == "lights"
    )
    assert isinstance(lights, dict)
    assert lights["tracker"]["light"] == "red"
    assert notes(lab.goes_on(0.1)) == ["sensor_back"]
    assert lab.run.phase == "session"


def test_without_accelerations_the_estimator_goes_on_with_what_there_is(lab: Lab) -> None:
    while lab.run.now is not None and lab.run.now[0].tasks[lab.run.now[1]].condition != "fusion":
        lab.does("skip", "not this one")
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(2.0)
    silent = lab.goes_on(3.0, imu=False)
    assert notes(silent) == ["sensor_silent", "sensor_lost"]
    for made in [one for one in lab.actions if isinstance(one, Show)][-2:]:
        lab.happens(Said("phone", PHONE, Drawn(made.message.n, lab.at_ms), lab.now))  # type: ignore[union-attr]
    shown = [one for one in lab.goes_on(0.5, imu=False) if isinstance(one, Show)]
    assert shown
    assert lab.run.phase == "session"
    lights = panel.lights(lab.run, lab.now).content["lights"]
    assert lights["imu"]["light"] == "red"  # type: ignore[index]
    lab.does("abort", "the phone's motion is gone")
    lab.happens(Closed("data/set-aside/P01_fusion.1.mcap", lab.now))
    assert refusals(lab.does("start"))[0].startswith("imu is silent")


def test_a_phone_s_clock_that_is_set_is_followed_noted_and_amber(lab: Lab) -> None:
    def pings(seconds: float, off_ms: float) -> list[Action]:
        found: list[Action] = []
        for _ in range(round(seconds * 4)):
            lab.goes_on(0.25)
            now, theirs = lab.now / MS, lab.now / MS - off_ms
            exchange = Exchange(theirs - 2, now - 1, now - 1, theirs)
            found += lab.happens(Said("phone", PHONE, Ping(theirs, exchange), lab.now))
        return found

    pings(2.0, 0.0)
    lab.does("start")
    pings(1.5, 0.0)
    assert notes(pings(1.0, 0.0)) == []
    assert notes(pings(3.0, 60_000.0)) == ["clock_step"]
    light = panel.lights(lab.run, lab.now).content["lights"]["clock"]  # type: ignore[index]
    assert (light["light"], "was set once" in light["text"]) == ("amber", True)
    assert lab.run.phase == "session"
    theirs = lab.now / MS - 60_000.0
    assert clocks.phone_ns(lab.run, theirs, lab.now + 10 * MS) == pytest.approx(lab.now, abs=5 * MS)


def test_a_sender_s_own_times_can_be_had_back_and_its_clock_that_is_set_is_noted(lab: Lab) -> None:
    sent: dict[int, float] = {}

    def sends(seconds: float, ahead_ms: float) -> list[Action]:
        found: list[Action] = []
        for number in range(round(seconds * 100)):
            found += lab.goes_on(0.01, imu=False)
            own_ms = (lab.now - (5 + number % 3) * MS) / MS + ahead_ms
            sent[lab.now] = own_ms
            values = (0.001 * number, 9.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
            found += lab.happens(Reading("imu", None, lab.now, values, None, own_ms))
        return found

    sends(1.0, 0.0)
    started = lab.does("start")
    actions = [*started, *sends(2.0, 0.0), *sends(3.0, -3_600_000.0)]
    assert notes(actions).count("clock_step") == 1
    light = panel.lights(lab.run, lab.now).content["lights"]["clock"]  # type: ignore[index]
    assert (light["light"], light["text"]) == ("amber", "The clock of the sender of imu was set; it is known anew.")
    offset_ms, checked = float("nan"), 0
    for one in (action.message for action in actions if isinstance(action, Write)):
        if one.topic == clocks.CLOCK and one.event and one.event["sender"] == "imu":
            offset_ms = float(str(one.event["offset_ms"]))
        elif one.topic == "/phone/imu" and one.arrival_ns in sent and one.stamp_ns < one.arrival_ns:
            assert one.stamp_ns / MS - offset_ms == pytest.approx(sent[one.arrival_ns], abs=1e-3)
            checked += 1
    assert checked > 100


def test_readings_that_come_in_batches_are_amber(lab: Lab) -> None:
    for batch in range(5):
        lab.at_ms += 1000
        for number in range(30):  # a second's, all at once
            stamp = lab.now - (1000 - 33 * number) * MS
            lab.happens(Reading("tracker", stamp, lab.now + number, (0.001 * batch, 0.5, 1.0)))
    light = panel.lights(lab.run, lab.now).content["lights"]["tracker"]  # type: ignore[index]
    assert light["light"] == "amber"
    assert light["text"].endswith("too late to be shown: have each reading sent at once, not in batches.")


def test_after_a_lost_tracker_the_task_may_be_done_again(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(2.0)
    lab.goes_on(2.5, tracker=False)
    lab.does("abort", "the tracker was lost")
    lab.happens(Closed("data/set-aside/P01_kinect.1.mcap", lab.now))
    lab.goes_on(0.5)
    (opened,) = (one for one in lab.does("start") if isinstance(one, Open))
    assert (opened.participant, opened.facts["attempt"]) == ("P01", "2")


def test_what_is_not_taken_is_said_for_ten_seconds_and_counted_for_good(lab: Lab) -> None:
    def light() -> dict[str, str]:
        return panel.lights(lab.run, lab.now).content["lights"]["senders"]  # type: ignore[index,no-any-return]

    assert light() == {"light": "off", "text": "Nothing was dropped."}
    lab.happens(Dropped({"wrong key": 3, "too long": 1}, lab.now))
    assert light() == {"light": "amber", "text": "Not taken: too long (1), wrong key (3)."}
    lab.goes_on(10.1)
    assert light() == {"light": "green", "text": "Not taken: too long (1), wrong key (3)."}


def test_a_folder_that_cannot_be_written_to_is_said_before_anything_begins(tmp_path: Path) -> None:
    study, _ = study_in(tmp_path)
    (tmp_path / "data").write_text("not a folder", encoding="utf-8")
    with pytest.raises(PipelineError, match=r"\.recorder: cannot be written to: .*; make the study's folder writable"):
        Journal(tmp_path, study).hold()


def test_a_suspended_computer_ends_the_attempt_and_a_wall_clock_that_is_set_does_not(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(2.0)
    assert notes(lab.happens(WallClock(3_600_000.0, True, lab.now))) == ["wall_clock"]
    assert lab.run.phase == "session"
    actions = lab.happens(Woke(30.0, lab.now))
    assert Close(set_aside=True) in actions
    assert lab.run.attempt is not None
    assert lab.run.attempt.ended_by == "the computer stood still for 30.0 s"


def test_recorder_time_goes_on_whatever_the_wall_clock_does() -> None:
    wall, steady, always = [EPOCH_NS], [5], [7]
    clock = Clock(lambda: wall[0], lambda: steady[0], lambda: always[0])
    assert clock() == EPOCH_NS
    for name in (wall, steady, always):
        name[0] += 10**10
    assert clock() == EPOCH_NS + 10**10
    assert (clock.wall_clock().was_set, clock.slept_s()) == (False, 0)
    wall[0] += 3_600 * 10**9
    assert clock() == EPOCH_NS + 10**10
    told = clock.wall_clock()
    assert (told.was_set, told.off_ms) == (True, 3_600_000)
    assert not clock.wall_clock().was_set
    wall[0] += 60 * 10**9
    always[0] += 60 * 10**9  # the monotonic clock stands while the computer is suspended
    assert clock.slept_s() == pytest.approx(60)


def test_a_full_disk_ends_the_attempt_and_keeps_what_is_on_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study, _ = study_in(tmp_path)
    journal = Journal(tmp_path, study)
    journal.hold()
    clerk = Clerk(journal, check=None)
    clerk.perform([Open("P01", "kinect", {"participant": "P01", "condition": "kinect"})], lambda: 1)
    clerk.perform([Write(Message("/recorder/notes", "anything", 1, 1, event={"type": "note"}))], lambda: 1)
    clerk.flush(lambda: 1)
    part = tmp_path / f"data/P01_kinect.mcap{PART}"
    before = part.read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("pipeline.live.journal.to_disk", full)
    told = clerk.flush(lambda: 2)
    assert told.fault is not None
    assert told.fault.startswith("No space left on device")
    events = clerk.perform([Close(set_aside=True), Save({"type": "note"}, "7")], lambda: 3)
    assert Closed("", 3) in events
    assert not any(isinstance(event, Saved) for event in events)  # nobody is told that it is saved
    assert part.read_bytes()[: len(before)] == before
    monkeypatch.undo()
    assert clerk.perform([Open("P01", "kinect", {})], lambda: 4) == []  # the next attempt goes on beside it
    assert (tmp_path / "data/set-aside/P01_kinect.1.mcap").read_bytes()[: len(before)] == before
    clerk.perform([Close()], lambda: 5)
    journal.release()


def test_a_fault_of_the_disk_stops_the_session_and_is_said(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(1.5)
    actions = lab.happens(Disk(lab.now, 0, fault="No space left on device."))
    assert Close(set_aside=True) in actions
    state = next(one.message for one in actions if isinstance(one, Tell) and isinstance(one.message, Whole))
    assert state.content["problems"] == ["No space left on device."]
    lab.happens(Closed("", lab.now))
    assert refusals(lab.does("start", "anyway")) == ["No space left on device."]
    lab.happens(Disk(lab.now, 150_000_000))
    assert "nearly full" in refusals(lab.does("start"))[0]


def test_a_log_that_is_removed_while_it_is_written_is_noticed(tmp_path: Path) -> None:
    study, _ = study_in(tmp_path)
    journal = Journal(tmp_path, study)
    journal.hold()
    clerk = Clerk(journal, check=None)
    clerk.perform([Open("P01", "kinect", {"participant": "P01", "condition": "kinect"})], lambda: 1)
    (tmp_path / f"data/P01_kinect.mcap{PART}").unlink()
    fault = clerk.flush(lambda: 2).fault
    assert fault is not None
    assert "not there any more" in fault
    journal.release()


def test_nothing_is_ever_overwritten(tmp_path: Path) -> None:
    study, _ = study_in(tmp_path)
    journal = Journal(tmp_path, study)
    journal.hold()
    for number in range(1, 4):
        journal.open("P01", "kinect", {"participant": "P01", "condition": "kinect"})
        path = journal.close(set_aside=True)
        assert path is not None
        assert path.name == f"P01_kinect.{number}.mcap"
    journal.open("P01", "kinect", {"participant": "P01", "condition": "kinect"})
    journal.close(set_aside=False)
    with pytest.raises(FileExistsError):
        journal.open("P01", "kinect", {})
    journal.release()


@pytest.mark.parametrize("kind", ["lights", "state"])
def test_a_page_that_does_not_read_gets_the_newest_and_holds_up_nobody(kind: str) -> None:
    outbox = Outbox()
    for number in range(1000):
        outbox.put(Whole(kind, {"number": number}))  # type: ignore[arg-type]
    assert not outbox.full
    assert outbox._waiting[0] == Whole(kind, {"number": 999})  # type: ignore[arg-type]
    for _ in range(300):
        outbox.put(Say(""))
    assert outbox.full  # and its connection is closed


def test_an_estimate_is_sent_at_once_unless_the_page_does_not_read_and_never_overtakes() -> None:
    class Socket:
        """Sends when the page reads, as uvicorn does: it waits before it writes anything."""

        def __init__(self) -> None:
            self.reads = asyncio.Event()
            self.sent: list[str] = []
            self.gone = False

        async def send_text(self, text: str) -> None:
            await self.reads.wait()
            if self.gone:
                raise WebSocketDisconnect(1006)
            message = json.loads(text)
            self.sent.append(message.get("n") or message["type"])

    async def run() -> None:
        socket, outbox = Socket(), Outbox()
        outbox.put(Say(""))
        sending = asyncio.create_task(websocket.send_waiting(cast(WebSocket, socket), outbox))
        await asyncio.sleep(0)  # the first message waits for the page now
        outbox.put(Shown(1, 0.0, 0.0, 1))
        socket.reads.set()
        outbox.put(Shown(2, 0.0, 0.0, 1))  # it could be sent, and does not overtake
        while len(socket.sent) < 3:
            await asyncio.sleep(0)
        await asyncio.sleep(0)
        outbox.put(Shown(3, 0.0, 0.0, 1))
        assert socket.sent == ["say", 1, 2, 3]  # no turn of the loop was needed
        socket.reads.clear()
        outbox.put(Shown(4, 0.0, 0.0, 1))
        outbox.put(Say(""))
        outbox.put(Shown(5, 0.0, 0.0, 1))
        await asyncio.sleep(0)
        assert len(socket.sent) == 4
        socket.reads.set()
        while len(socket.sent) < 7:
            await asyncio.sleep(0)
        assert socket.sent[4:] == [4, "say", 5]
        await asyncio.sleep(0)
        socket.gone = True
        outbox.put(Shown(6, 0.0, 0.0, 1))
        with pytest.raises(WebSocketDisconnect):
            await sending

    asyncio.run(run())


def test_a_participant_who_stops_is_replaced_and_the_log_says_why(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(1.5)
    actions = lab.does("drop", "felt dizzy")
    assert Close(set_aside=True) in actions
    saved = [one.record for one in actions if isinstance(one, Save)]
    assert [record["type"] for record in saved] == ["set_aside", "dropped"]
    assert saved[0]["reason"] == "dropped out: felt dizzy"
    lab.happens(Closed("data/set-aside/P01_kinect.1.mcap", lab.now))
    first, second = lab.run.plan.persons
    assert (first.dropped, second.order, lab.run.phase) == (True, first.order, "ready")
    assert desk.state(lab.run, OPERATOR).content["problems"] == []  # nothing of them counts


def test_whose_tasks_count_and_who_leaves_is_proposed_as_an_exclusion(lab: Lab) -> None:
    ids = {"participant": "P01", "condition": "kinect"}
    lab.run, _ = run_state.save(lab.run, {"type": "begun", **ids})
    lab.run, _ = run_state.save(lab.run, {"type": "finished", **ids, "trials": 3})
    lab.does("drop", 'said "no more"')
    problems = desk.state(lab.run, OPERATOR).content["problems"]
    assert isinstance(problems, list) and len(problems) == 1
    problem = str(problems[0])
    entry = yaml.safe_load(problem.split("of them: ")[1].removesuffix(" in study.yaml."))
    assert entry == {"exclusions": [{"participant": "P01", "reason": 'said "no more"'}]}
