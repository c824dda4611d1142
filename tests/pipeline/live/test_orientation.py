"""A phone's orientation as a running study finds it: whatever signs and axes the browser has, from the data alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.live import desk, orientation, panel, run_state, study_run
from pipeline.live.clerk import agreement
from pipeline.live.events import Joined, Reading, Said, Show, Tick, Values, Write
from pipeline.live.messages import Do, Drawn, Exchange, Motion, Orientation, Ping
from pipeline.live.orientation import Aligner, PhoneMotion
from pipeline.live.setup import Setup
from pipeline.sessions.logs.mcap import Message, write
from pipeline.study.settings import Study
from tests.pipeline.live.studies import STUDY, study_in
from tests.pipeline.sessions.test_phone import GRAVITY, IMU, TRACKER, swaying, turns

EPOCH_NS = 1_764_350_000_000_000_000
ALIGNER = Aligner(TRACKER, IMU, (0.0, -9806.65, 0.0))
LEVEL = Rotation.from_rotvec([np.pi / 2, 0, 0])  # from the tracker's frame, y up, to one whose z points up


def ns(seconds: float) -> int:
    return EPOCH_NS + round(seconds * 1e9)


def place_m(time: float) -> tuple[float, float, float]:
    """Where that swaying hand is."""
    x, y, z = -np.sin(5 * time) / 25, -0.4 * np.cos(7 * time) / 49, -0.3 * np.sin(4 * time) / 16
    return 1.5 * x, 1.5 * y, 1.5 * z


def held_still(seconds: float, rate_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Readings of a phone at rest, as the swaying hand holds it at the time 0."""
    time = np.arange(-seconds, 0.0, 1 / rate_hz)
    force = np.tile(turns(np.zeros(1)).inv().apply(-GRAVITY), (len(time), 1))
    return time, np.zeros((len(time), 3)), force


@dataclass
class Found:
    """Orientations that were found of the swaying hand, and when."""

    at: list[float] = field(default_factory=list)
    xyzw: list[Values] = field(default_factory=list)

    def add(self, at: float, values: Values) -> None:
        self.at.append(at)
        self.xyzw.append(values[6:])

    def rms_deg_after(self, since: float) -> float:
        """How far they are from the true ones, from a time on."""
        off = Rotation.from_quat(self.xyzw) * turns(np.maximum(self.at, 0.0)).inv()
        return float(np.sqrt(np.mean(np.degrees(np.asarray(off.magnitude())[np.array(self.at) > since]) ** 2)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("heading_deg", [0.0, 130.0])
def test_with_the_browser_s_orientation_sign_and_heading_are_found(sign: float, heading_deg: float) -> None:
    earth = Rotation.from_euler("z", heading_deg, degrees=True) * LEVEL  # from the tracker's frame to the browser's
    still, moving = held_still(2.0, 60.0), swaying(20.0, 60.0, np.random.default_rng(1))
    time, turning, force = (np.concatenate(both) for both in zip(still, moving, strict=True))
    state, frames, found = PhoneMotion(), np.arange(-2.0, 20.0, 1 / 30), Found()
    said = (earth * turns(np.maximum(time - 0.004, 0.0))).as_quat()  # of the browser
    upcoming = 0
    for row, at in enumerate(time.tolist()):
        while upcoming < len(frames) and frames[upcoming] + 0.1 <= at:
            seen_at = float(frames[upcoming])
            where = place_m(max(seen_at, 0.0))
            state = orientation.seen(ALIGNER, state, ns(seen_at), ns(seen_at + 0.1), where)
            upcoming += 1
        if row % 2 == 0:  # orientations come half as often, and a little earlier
            q = tuple(said[row].tolist())
            state = orientation.oriented(state, Orientation(row, 0.0, q, False), ns(at - 0.004))
        a = tuple((sign * force[row] / 1000).tolist())
        r = tuple(np.degrees(turning[row]).tolist())
        state, values = orientation.moved(ALIGNER, state, Motion(row, 0.0, a, None, r, 16.0), ns(at), ns(at + 0.003))
        assert values is not None
        if np.isfinite(values[6:]).all():
            assert values[:3] == pytest.approx(tuple((force[row] / 1000).tolist()))
            found.add(at, values)
    assert state.sign == sign
    assert found.at[0] < 5.0
    assert found.rms_deg_after(10) < 5.0


def test_without_one_tilt_comes_from_the_gyroscope() -> None:
    time, turning, force = swaying(40.0, 60.0, np.random.default_rng(2))
    state, frames, found, upcoming = PhoneMotion(), np.arange(0.0, 40.0, 1 / 30), Found(), 0
    for row, at in enumerate(time.tolist()):
        while upcoming < len(frames) and frames[upcoming] + 0.1 <= at:
            seen_at = float(frames[upcoming])
            state = orientation.seen(ALIGNER, state, ns(seen_at), ns(seen_at + 0.1), place_m(seen_at))
            upcoming += 1
        a, r = tuple((force[row] / 1000).tolist()), tuple(np.degrees(turning[row]).tolist())
        state, values = orientation.moved(ALIGNER, state, Motion(row, 0.0, a, None, r, 16.0), ns(at), ns(at))
        if values is not None and np.isfinite(values[6:]).all():
            found.add(at, values)
    assert state.source == "gyroscope"
    assert found.rms_deg_after(20) < 5.0


def test_a_reading_that_lacks_something_or_comes_late_is_none() -> None:
    state, values = orientation.moved(ALIGNER, PhoneMotion(), Motion(0, 0.0, None, None, (1, 2, 3), 16.0), 0, 0)
    assert values is None and state == PhoneMotion()
    state, values = orientation.moved(ALIGNER, state, Motion(0, 0.0, (0, 9.8, 0), None, (1, 2, 3), 16.0), 10**9, 10**9)
    assert values is not None and np.isnan(values[6:]).all()
    assert (
        orientation.moved(ALIGNER, state, Motion(1, 0.0, (0, 9.8, 0), None, (1, 2, 3), 16.0), 10**9 - 5, 10**9)[1]
        is None
    )


def _require_replayed(study: Study, folder: Path, messages: list[Message]) -> None:
    """What was logged, written as P01's log, replays to what was shown."""
    path = folder / "data/P01_kinect.mcap"
    path.parent.mkdir()
    write(path, {"participant": "P01", "condition": "kinect"}, messages)
    agreed = agreement(study, folder, path, "P01", "kinect")
    assert agreed is not None
    assert agreed[0] <= 1e-9
    assert agreed[1] > 200


class _Played:
    """A study's run whose phone draws at once what it is sent, and all that was logged."""

    def __init__(self, setup: Setup) -> None:
        self.run, self.messages = run_state.begin(setup, setup.empty_plan()), list[Message]()

    def happens(self, event: object) -> None:
        self.run, actions = study_run.step(self.run, event)  # type: ignore[arg-type]
        self.messages += (action.message for action in actions if isinstance(action, Write))
        for action in actions:
            if isinstance(action, Show):
                at = action.made_ns
                self.happens(Said("phone", 2, Drawn(action.message.n, at / 1e6), at))  # type: ignore[union-attr]


def test_a_session_by_a_phone_s_own_motion_replays_to_what_was_shown(tmp_path: Path) -> None:
    text = STUDY.replace(
        "senders: {tracker: {demo: {}}, imu: {demo: {}}}", "senders: {tracker: {demo: {}}, imu: {phone: motion}}"
    )
    text = text.replace("{kinect: kinect, fusion: fusion}", "{kinect: fusion, fusion: fusion}")
    study, setup = study_in(tmp_path, text)
    played = _Played(setup)
    happens, messages = played.happens, played.messages
    happens(Joined("operator", 1, ns(-1)))
    happens(Joined("phone", 2, ns(-1)))
    behind_ms = 3_600_000.0  # the phone's clock is an hour behind
    time, turning, force = swaying(12.0, 60.0, np.random.default_rng(3))
    for row, at in enumerate(time.tolist()):
        if row % 10 == 0:
            now = ns(at) / 1e6
            happens(
                Said(
                    "phone",
                    2,
                    Ping(now, Exchange(now - behind_ms, now + 2, now + 2, now - behind_ms + 4)),
                    ns(at + 0.004),
                )
            )
        if row % 2 == 0:
            happens(Reading("tracker", None, ns(at + 0.001), place_m(max(at - 0.1, 0.0))))
        a, r = tuple((force[row] / 1000).tolist()), tuple(np.degrees(turning[row]).tolist())
        happens(Said("phone", 2, Motion(row, ns(at) / 1e6 - behind_ms, a, None, r, 16.0), ns(at + 0.005)))
        if row == 400:
            happens(Said("operator", 1, Do("start", "nobody presses the button", "d"), ns(at + 0.006)))
            assert played.run.phase == "session"
        happens(Tick(ns(at + 0.007)))
    logged = [one for one in messages if one.topic == "/phone/imu"]
    assert len(logged) > 200
    stamps = np.array([one.stamp_ns for one in logged])
    assert np.abs(np.interp(stamps, [ns(float(at)) for at in time], np.arange(len(time))) % 1).max() < 0.5
    late_ms = np.median([one.arrival_ns - one.stamp_ns for one in logged]) / 1e6
    assert late_ms == pytest.approx(5.0, abs=0.1)  # the clock was found from the pings
    _require_replayed(study, tmp_path, messages)
    assert sum(one.topic == study_run.RAW for one in messages) >= len(logged)


def test_of_a_sender_that_brings_no_orientation_it_is_found_too_and_the_log_replays(tmp_path: Path) -> None:
    text = STUDY.replace("imu: {demo: {}}}", "imu: {udp_json: {port: 9700}}}")
    study, setup = study_in(
        tmp_path, text.replace("{kinect: kinect, fusion: fusion}", "{kinect: fusion, fusion: fusion}")
    )
    played = _Played(setup)
    happens, messages = played.happens, played.messages
    happens(Joined("operator", 1, ns(-1)))
    happens(Joined("phone", 2, ns(-1)))
    time, turning, force = swaying(12.0, 60.0, np.random.default_rng(3))
    for row, at in enumerate(time.tolist()):
        if row % 2 == 0:
            happens(Reading("tracker", None, ns(at + 0.001), place_m(max(at - 0.1, 0.0))))
        values = (*(force[row] / 1000).tolist(), *turning[row].tolist(), *[np.nan] * 4)
        happens(Reading("imu", None, ns(at + 0.005), values, row + 1, ns(at) / 1e6))
        if row == 10:
            light = panel.lights(played.run, ns(at + 0.006)).content["lights"]["imu"]  # type: ignore[index]
            assert (light["light"], "orientation is not known yet" in light["text"]) == ("amber", True)
            assert any("orientation is not known yet" in one for one in desk.red_lights(played.run, ns(at + 0.006)))
        if row == 400:
            assert not any("orientation" in one for one in desk.red_lights(played.run, ns(at + 0.006)))
            happens(Said("operator", 1, Do("start", "nobody presses the button", "d"), ns(at + 0.006)))
        happens(Tick(ns(at + 0.007)))
    logged = [one.values for one in messages if one.topic == "/phone/imu" and one.values is not None]
    assert len(logged) > 200
    assert all(np.isfinite(values).all() for values in logged)
    _require_replayed(study, tmp_path, messages)


def test_what_a_sender_says_of_its_orientation_is_taken_as_it_is(tmp_path: Path) -> None:
    _, setup = study_in(tmp_path, STUDY.replace("imu: {demo: {}}}", "imu: {udp_json: {port: 9700}}}"))
    run = run_state.begin(setup, setup.empty_plan())
    without, within = (0.0, 9.8, 0.0, 0.0, 0.0, 0.0, *[np.nan] * 4), (0.0, 9.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    run, _ = study_run.step(run, Reading("imu", None, ns(0.0), within))
    assert not run.finds_orientation
    run, _ = study_run.step(run, Reading("imu", None, ns(0.1), without))
    assert run.finds_orientation
    run, _ = study_run.step(run, Reading("imu", None, ns(0.2), within))
    assert not run.finds_orientation
    assert [row.turned_xyzw for row in run.watched.streams["imu"].newest] == [within[6:], None, within[6:]]
