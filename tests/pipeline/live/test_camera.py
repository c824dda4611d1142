"""A camera as sender: faults with their messages, and a task with a webcam as tracker. It gives drawn pictures."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from pipeline.errors import PipelineError
from pipeline.live import cameras, senders
from pipeline.live.adapters.camera import TWICE, UNSEEN
from pipeline.live.events import Link, Reading
from pipeline.live.lens import of_field_of_view
from pipeline.live.setup import Setup
from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from tests.pipeline.helpers import exit_code
from tests.pipeline.live.frames import FACING, frame
from tests.pipeline.live.running import Running, agreed, at_once, free_port, hears, press_through, says, served
from tests.pipeline.live.studies import STUDY, study_in

SIZE = (640, 360)
CAMERA = "camera: {size: [640, 360], field_of_view_deg: 60, late_ms: 20}"
SENDERS = "senders: {tracker: {demo: {}}, imu: {demo: {}}}"
AT_MM = (-100.0, -60.0, 600.0)
_S_PER_FRAME = 0.005


def picture(*numbers: int) -> np.ndarray:
    """A frame, in colour, with markers beside each other, the first of them at `AT_MM`."""
    places = {number: (np.add(AT_MM, (150.0 * at, 0, 0)), FACING) for at, number in enumerate(numbers)}
    grey = frame(SIZE, of_field_of_view(60, SIZE), places, np.random.default_rng(1), noise=1.0)
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


SEEN, EMPTY = picture(7), picture()
BOTH = np.vstack([SEEN[:180], SEEN[:180]])


class Video:
    """What `cv2.VideoCapture` is: `shows` gives a frame, None of a camera that is unplugged."""

    shows: Callable[[], np.ndarray | None] = staticmethod(lambda: SEEN)
    there = True
    released = 0

    def __init__(self, _device: int) -> None:
        self._frame: np.ndarray | None = None

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        return Video.there

    def set(self, _what: int, _value: float) -> bool:
        return True

    def grab(self) -> bool:
        time.sleep(_S_PER_FRAME)
        self._frame = Video.shows()
        return self._frame is not None

    def retrieve(self) -> tuple[bool, np.ndarray]:
        assert self._frame is not None
        return True, self._frame

    def release(self) -> None:
        Video.released += 1


@pytest.fixture(autouse=True)
def video(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "VideoCapture", Video)
    monkeypatch.setattr(Video, "shows", staticmethod(lambda: SEEN))
    monkeypatch.setattr(Video, "there", True)
    monkeypatch.setattr("pipeline.live.adapters.camera.AGAIN_S", 0.02)


def with_camera(camera: str = CAMERA, more: str = "") -> str:
    return STUDY.replace(SENDERS, f"senders: {{tracker: {{{camera}{more}}}, imu: {{udp_json: {{port: PORT}}}}}}")


def camera_alone() -> str:
    """A study that has nothing but a camera."""
    lines = [
        line for line in STUDY.splitlines() if not line.lstrip().startswith(("imu:", "window:", "fusion:", "adap"))
    ]
    text = "\n".join(lines).replace("fusion: fusion}", "fusion: raw}")
    return text.replace(SENDERS, f"senders: {{tracker: {{{CAMERA}, axes: [x, -y, z], translation_mm: [0, 500, 0]}}}}")


def setup_in(folder: Path, text: str) -> Setup:
    return study_in(folder, text.replace("PORT", "9700"))[1]


def watched(folder: Path, until: Callable[[list[Any]], bool]) -> tuple[list[Any], Counter[str]]:
    """What a webcam says until something is so."""
    said: list[Any] = []

    async def watch() -> Counter[str]:
        setup = setup_in(folder, with_camera())
        [webcam] = cameras.webcams(setup, folder, said.append, time.time_ns)
        await webcam.begin()
        try:
            async with asyncio.timeout(20):
                while not until(said):
                    await asyncio.sleep(0.005)
        finally:
            await asyncio.to_thread(webcam.close)
        return webcam.refused

    refused = asyncio.run(watch())
    return said, refused


def shown_then(monkeypatch: pytest.MonkeyPatch, *frames: tuple[np.ndarray | None, int]) -> None:
    """Frames one after the other, each so many times, the last for ever."""
    coming = [one for one, times in frames for _ in range(times)]
    monkeypatch.setattr(Video, "shows", staticmethod(lambda: coming.pop(0) if len(coming) > 1 else coming[0]))


def links(said: list[Any]) -> list[str]:
    return [one.problem for one in said if isinstance(one, Link)]


def readings(said: list[Any]) -> list[Reading]:
    return [one for one in said if isinstance(one, Reading)]


def test_a_marker_s_place_is_a_reading_in_metres_stamped_before_it_arrived(tmp_path: Path) -> None:
    said, refused = watched(tmp_path, lambda said: len(readings(said)) >= 5)
    for reading in readings(said):
        assert reading.stream == "tracker"
        assert reading.values == pytest.approx([part / 1e3 for part in AT_MM], abs=3e-3)
        assert reading.stamp_ns is not None
        assert reading.arrival_ns - reading.stamp_ns >= 20_000_000  # late_ms
    assert not any(links(said)) and not refused


def test_a_marker_that_is_not_seen_is_counted_and_said_until_it_is_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.live.adapters.camera.UNSEEN_NS", 100_000_000)
    shown_then(monkeypatch, (EMPTY, 60), (SEEN, 1))
    said, refused = watched(tmp_path, lambda said: bool(readings(said)))
    assert links(said)[-2:] == ["tracker: camera 0 does not see marker 7; hold it flat, in view, in the light.", ""]
    assert refused[f"tracker: {UNSEEN}"] > 30


def test_two_markers_of_one_number_are_no_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown_then(monkeypatch, (BOTH, 10), (SEEN, 1))
    said, refused = watched(tmp_path, lambda said: bool(readings(said)))
    assert links(said) == ["tracker: camera 0 sees marker 7 twice; cover one, or print another --id.", ""]
    assert refused[f"tracker: {TWICE}"] == 9  # the first frame is looked at for its size


def test_a_camera_that_is_unplugged_is_opened_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown_then(monkeypatch, (SEEN, 5), (None, 1), (SEEN, 1))
    released = Video.released
    said, _ = watched(tmp_path, lambda said: "" in links(said)[1:])
    gone = "tracker: camera 0 gives no pictures any more; see whether it is plugged in. Trying again."
    assert links(said) == ["", gone, ""]
    assert Video.released == released + 2  # when it was gone, and in the end


def test_a_camera_that_comes_back_with_another_size_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown_then(monkeypatch, (SEEN, 3), (cv2.resize(SEEN, (320, 180)), 1))
    said, _ = watched(tmp_path, lambda said: len(links(said)) > 1)
    assert links(said)[1] == (
        "tracker: camera 0 gives 320 × 180 and not 640 × 360; write size: [320, 180]. Trying again."
    )


@pytest.mark.parametrize(
    ("there", "shows", "message"),
    [
        (False, SEEN, "camera 0 is not there, or another program uses it; plug it in"),
        (True, None, "camera 0 gives no picture; end other programs that use it"),
        (True, EMPTY[:240, :320], "camera 0 gives 320 × 240 and not 640 × 360; write size: [320, 240]"),
    ],
)
def test_a_camera_that_cannot_be_used_ends_the_start(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    there: bool,
    shows: np.ndarray | None,
    message: str,
) -> None:
    monkeypatch.setattr(Video, "there", there)
    monkeypatch.setattr(Video, "shows", staticmethod(lambda: shows))
    monkeypatch.setattr("pipeline.live.setup.warm_up", lambda _: None)
    study_in(tmp_path, with_camera().replace("PORT", str(free_port())))
    assert exit_code(monkeypatch, "record", tmp_path, "--port", str(free_port())) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("senders_", "message"),
    [
        (f"tracker: {{{CAMERA}, unit: m}}, imu: {{demo: {{}}}}", "senders.tracker: unit: a camera measures in"),
        (f"tracker: {{demo: {{}}}}, imu: {{{CAMERA}}}", "senders.imu: a camera sees positions, and imu is of kind"),
        ("tracker: {camera: {calibration: no.yaml}}, imu: {demo: {}}", "no.yaml: the camera's calibration cannot be"),
    ],
)
def test_what_a_camera_can_never_do_is_said_before(tmp_path: Path, senders_: str, message: str) -> None:
    setup = setup_in(tmp_path, STUDY.replace(SENDERS, f"senders: {{{senders_}}}"))
    with pytest.raises(PipelineError) as refused:
        senders.check(setup, str(tmp_path / "study.yaml"))
    assert message in str(refused.value)


def test_without_opencv_it_is_said_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cameras, "find_spec", lambda _: None)
    study_in(tmp_path, with_camera().replace("PORT", "9700"))
    assert exit_code(monkeypatch, "record", tmp_path) == 2
    assert 'senders.tracker: a camera needs a further package: pip install "steadyhand[camera]"' in (
        capsys.readouterr().err
    )


def test_a_lens_is_said_once(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match="calibration and field_of_view_deg both say what the lens does; keep one"):
        setup_in(tmp_path, with_camera("camera: {calibration: a.yaml, field_of_view_deg: 60}"))


def test_one_camera_sees_the_markers_of_two_streams(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    both = picture(7, 3)
    monkeypatch.setattr(Video, "shows", staticmethod(lambda: both))
    reference = "streams:\n  truth: {topic: /truth, kind: reference}\n"
    text = with_camera(more="}, truth: {camera: {size: [640, 360], field_of_view_deg: 60, late_ms: 20, marker: 3}")
    setup = setup_in(tmp_path, text.replace("streams:\n", reference))
    senders.check(setup, str(tmp_path / "study.yaml"))
    said: list[Any] = []

    async def watch() -> None:
        [webcam] = cameras.webcams(setup, tmp_path, said.append, time.time_ns)
        await webcam.begin()
        while len(readings(said)) < 2:
            await asyncio.sleep(0.005)
        await asyncio.to_thread(webcam.close)

    asyncio.run(watch())
    x_m = {one.stream: one.values[0] for one in readings(said)}
    assert x_m == {"tracker": pytest.approx(-0.1, abs=3e-3), "truth": pytest.approx(0.05, abs=3e-3)}


def test_a_task_with_a_webcam_as_tracker_gives_a_log_that_replays(tmp_path: Path) -> None:
    async def play(running: Running) -> None:
        async with running.page("operator") as operator, running.page("phone") as phone:
            await says(phone, type="hello", page="phone", version=1, agent="a test", wake_lock=True)
            while (await hears(operator, "lights"))["lights"]["tracker"]["light"] != "green":
                pass
            await says(operator, type="do", what="start", text="nobody moves the marker", id="d1")
            await hears(operator, "done", id="d1")
            await press_through(phone, drawn=20)
            assert (await agreed(operator))["mm"] <= 1e-9

    served(tmp_path, play, at_once(camera_alone()))
    log = mcap.read(tmp_path / "data/P01_kinect.mcap", [Wanted("/tracker/position", "position")])
    assert log.faults == ()
    values = log.topics["/tracker/position"].values
    assert len(values) > 20
    assert values == pytest.approx(np.tile([-0.1, 0.56, 0.6], (len(values), 1)), abs=3e-3)
