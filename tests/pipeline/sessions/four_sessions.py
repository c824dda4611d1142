"""A study of two participants and two conditions, whose logs tests change before it is compared."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.sessions.logs.mcap import Message
from tests.conftest import EPOCH_NS, STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand, exit_code
from tests.pipeline.made_once import made_once

Folder = Callable[..., Path]
SETTINGS = (
    """
title: T
conditions: [a, b]
sessions: data/{participant}_{condition}.mcap
display: {px_per_mm: 10, unit: px}
estimators:
  raw: {type: raw}
  fusion: {type: fusion_kalman}
comparisons: [{measure: selection_mse_mm2, test: wilcoxon}]
"""
    + STREAMS
)


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Two participants in two conditions, of which b errs 4 mm more, and the cache of their comparison."""

    def make(folder: Path) -> None:
        study = folder / "study"
        study.mkdir()
        (study / "study.yaml").write_text(SETTINGS, encoding="utf-8")
        for participant in ("P1", "P2"):
            for condition, bias_mm in (("a", 0.0), ("b", 4.0)):
                path = study / "data" / f"{participant}_{condition}.mcap"
                messages = session_messages(bias_mm=bias_mm)
                write_session(path, messages, participant=participant, condition=condition)
        with pytest.MonkeyPatch.context() as patched:
            words = ("--out", folder / "out", "--cache", folder / "cache", "--jobs", "1")
            assert exit_code(patched, "compare", study, *words) == 0

    yield from made_once(tmp_path_factory, "sessions", make)


@pytest.fixture
def study(compared: Path, tmp_path: Path, steadyhand: Steadyhand) -> Path:
    """A copy of that study; sessions that a test does not change are in its cache."""
    shutil.copytree(compared / "cache", steadyhand.cache)
    return shutil.copytree(compared / "study", tmp_path / "study")


def moved(messages: list[Message], topic: str, change: Callable[[int, Message], Message | None]) -> list[Message]:
    """Messages with those of one topic changed, or left out where the change gives None."""
    result = []
    for index, message in enumerate(messages):
        new = change(index, message) if message.topic == topic else message
        if new is not None:
            result.append(new)
    return result


def set_back(messages: list[Message]) -> list[Message]:
    """The phone's clock goes back by half a second in mid-session."""
    middle = EPOCH_NS + 2_000_000_000
    return moved(
        messages,
        "/phone/imu",
        lambda _, m: replace(m, stamp_ns=m.stamp_ns - 500_000_000) if m.stamp_ns > middle else m,
    )


def with_values(value: float, every: int) -> Callable[[list[Message]], list[Message]]:
    return lambda messages: moved(
        messages,
        "/tracker/position",
        lambda index, m: replace(m, values=np.array([value, 0, 0])) if index % every == 0 else m,
    )


def without(topic: str) -> Callable[[list[Message]], list[Message]]:
    return lambda messages: moved(messages, topic, lambda _, m: None)


def listed(steadyhand: Steadyhand, what: str) -> list[tuple[str | None, str]]:
    return [(row["session"], row["reason"]) for row in steadyhand.results()["exclusions"] if row["what"] == what]
