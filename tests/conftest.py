"""Small studies and logs, made when a test needs them."""

from __future__ import annotations

import gc
import os

# Workers of the tests share the processors; threads of a numeric library on top of them wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from pipeline.sessions.logs.mcap import Message, in_order, write
from tests.pipeline.helpers import Steadyhand

# No test is timed: a busy machine, or the first use of a table of all characters, is no fault of what is tested.
settings.register_profile("steadyhand", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("steadyhand")

# The tests write some hundred thousand small files. In memory, where there is room, each takes a thirtieth of the time.
MEMORY = Path("/dev/shm")  # noqa: S108
_ROOM_BYTES = 4_000_000_000
if MEMORY.is_dir() and os.access(MEMORY, os.W_OK) and shutil.disk_usage(MEMORY).free > _ROOM_BYTES:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))

EPOCH_NS = 1_700_000_000_000_000_000
CLONE = Path(__file__).resolve().parents[1]

STREAMS = """
streams:
  tracker:   {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1, noise_sd_mm: 8}
  imu:       {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100}
  reference: {topic: /reference/position, kind: reference}
events: {topic: /events}
"""


def pytest_collection() -> None:
    """While modules are imported hardly anything becomes garbage: to look for it takes a quarter of that time."""
    gc.disable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whatever is not marked as slow is fast, so that `-m fast` chooses it; files with slow tests come first.

    Else one of the tests' processes would still be at a long test when the others have nothing left to do. Before them
    come tests that fork processes: beside each other, so that they come to one of the tests' processes, which alone
    starts the one that all are forked from. That one imports for 3 s.
    """
    slow_files = {item.path for item in items if item.get_closest_marker("slow") is not None}
    for item in items:
        if item.get_closest_marker("slow") is None:
            item.add_marker("fast")
    items.sort(key=lambda item: (item.get_closest_marker("forks") is None, item.path not in slow_files))


def pytest_collection_finish() -> None:
    """What is imported by now stays, so it need not be gone through for garbage: a tenth of the tests' time.

    Nor need what a test makes be gone through as often as in a program that must stay small: another tenth.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)
    gc.enable()
    if "tests.pipeline.forked" in sys.modules:  # here, so that it holds in this process alone
        sys.modules["tests.pipeline.forked"].keep_these()


def pytest_sessionfinish() -> None:
    """What is garbage by now is found here, and what is not is not gone through five times more, as pytest does."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def folder(tmp_path: Path) -> Callable[..., Path]:
    """Write a study folder: `folder(study_yaml, **{"trials.csv": text})`."""

    def make(settings: str, name: str = "study", **files: str) -> Path:
        root = tmp_path / name
        root.mkdir(exist_ok=True)
        (root / "study.yaml").write_text(textwrap.dedent(settings), encoding="utf-8")
        for file, text in files.items():
            (root / file.replace("__", ".")).write_text(textwrap.dedent(text).lstrip(), encoding="utf-8")
        return root

    return make


def hand_mm(time: np.ndarray) -> np.ndarray:
    """Where the simulated hand is at `time` (s): a slow sine on x, still on y and z."""
    return np.column_stack([100 * np.sin(2 * time), np.full_like(time, 500.0), np.zeros_like(time)])


def session_messages(seconds: float = 4.0, seed: int = 0, bias_mm: float = 0.0) -> list[Message]:
    """Tracker, IMU, reference and two trials of a session, ids of trials 1 and 2."""
    random = np.random.default_rng(seed)

    def stream(
        topic: str, content: str, rate_hz: float, values: Callable[[np.ndarray], np.ndarray], late_s: float
    ) -> Iterator[Message]:
        time = np.arange(0, seconds, 1 / rate_hz)
        for instant, value in zip(time, values(time), strict=True):
            arrival = EPOCH_NS + round((instant + late_s) * 1e9)
            yield Message(topic, content, arrival, arrival, value)  # type: ignore[arg-type]

    def imu(time: np.ndarray) -> np.ndarray:
        acceleration = np.column_stack([-0.4 * np.sin(2 * time), np.zeros((len(time), 2))])
        force = acceleration + np.array([0, 9.80665, 0]) + random.normal(0, 0.1, (len(time), 3))
        return np.hstack([force, np.zeros((len(time), 3)), np.tile([0, 0, 0, 1.0], (len(time), 1))])

    messages = list(stream("/reference/position", "position", 90, lambda t: hand_mm(t) / 1000, 0))
    messages += stream(
        "/tracker/position", "position", 30, lambda t: (hand_mm(t) + random.normal(0, 8, (len(t), 3))) / 1000, 0.1
    )
    messages += stream("/phone/imu", "acceleration", 90, imu, 0)
    events: list[tuple[float, dict[str, object]]] = [
        (0.5, {"type": "session_start"}),
        (1.0, {"type": "trial_start", "trial": 1, "target_x": 0.1, "target_y": 0.5}),
        (1.8, {"type": "selection", "trial": 1, "x": 0.1 + (3 + bias_mm) / 1000, "y": 0.504, "z": 0.9}),
        (2.0, {"type": "trial_start", "trial": 2, "target_x": -0.05, "target_y": 0.5}),
        (3.2, {"type": "selection", "trial": 2, "x": -0.05, "y": 0.5 - (12 + bias_mm) / 1000, "z": 0.9}),
        (3.4, {"type": "selection", "trial": 2, "x": 9.0, "y": 9.0}),
        (3.5, {"type": "session_end"}),
    ]
    for seconds_in, event in events:
        at = EPOCH_NS + round(seconds_in * 1e9)
        messages.append(Message("/events", "events", at, at, event=event))
    return messages


def write_session(path: Path, messages: list[Message] | None = None, **facts: str) -> Path:
    """A log of `messages` (those of `session_messages()` by default), in order of arrival."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, facts, in_order(session_messages() if messages is None else messages))
    return path


def real(name: str) -> Path:
    """A folder of real recordings, or of others' test files; the test is skipped where it is not at hand."""
    studies = Path(os.environ.get("STEADYHAND_STUDIES", CLONE.parent / "shared" / "studies"))
    path = studies / name
    if not path.exists():
        pytest.skip(f"{name} is not in STEADYHAND_STUDIES ({studies})")
    return path


@pytest.fixture
def steadyhand(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Steadyhand:
    """The command, with its own cache and output folder."""
    return Steadyhand(capsys, monkeypatch, tmp_path)


@pytest.fixture(scope="module")
def cache_of_module(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for one cache."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def one_cache(steadyhand: Steadyhand, cache_of_module: Path) -> None:
    """For a whole file of tests whose studies are much alike: what one has computed, the others need not.

    Not for tests of what is computed, nor beside a test that changes how something is computed.
    """
    steadyhand.cache = cache_of_module


EMPTY_FIGURE = '<svg xmlns="http://www.w3.org/2000/svg" width="100" height="50" viewBox="0 0 100 50"></svg>'


@pytest.fixture
def blank_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a test of a report that looks at no figure: each is drawn, but matplotlib does not lay it out and write it.

    That is half of what a report costs. Files of figures are there, each with an empty picture.
    """
    from pipeline.report.figures import style

    monkeypatch.setattr(style, "label_ticks", lambda _figure: None)
    monkeypatch.setattr(style, "save", lambda _figure, path: path.write_text(EMPTY_FIGURE, encoding="utf-8"))


@pytest.fixture
def blank_print(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a test of a report that does not look at its PDF: what is printed is put together, but typst does not set it.

    That is a fifth of what a report costs whose figures are blank.
    """
    from pipeline.report.document import pdf

    class Typst:
        def compile(self, **_: object) -> bytes:
            return b"%PDF-1.7\n%%EOF\n"

    monkeypatch.setattr(pdf, "compiler_of", lambda *_, **__: Typst())


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a test of a report's words alone, or of many reports: the files of figures are there, and none is even drawn.

    Captions and descriptions are those of the figures; that they can be drawn is for tests with `blank_figures`.
    """
    from pipeline.report import figures

    monkeypatch.setattr(figures, "draw", lambda _figure, path, *_: path.write_text(EMPTY_FIGURE, encoding="utf-8"))
