"""A reference's frame and clock, found from the movement that it and the tracker recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusion_core.samples import Samples
from pipeline.sessions.frames import Frame, frame_of
from pipeline.sessions.logs.mcap import Message
from tests.benchmarks.departures import simulated
from tests.conftest import EPOCH_NS, write_session
from tests.pipeline.helpers import run

TURN = Rotation.from_euler("zyx", [25.0, -10.0, 5.0], degrees=True)
SHIFT_MM = np.array([300.0, -120.0, 40.0])


def _seen(seconds: float = 40.0, noise_sd_mm: float = 8.0, late_s: float = 0.0) -> tuple[Samples, Samples]:
    """A tracker of 30 Hz, and a reference whose positions must be turned and moved to lie in its frame."""
    true, random = simulated(seconds).reference, np.random.default_rng(1)
    time, value = true.time[::3], true.value[::3]
    tracker = Samples(time + late_s, time + 0.1, value + random.normal(0, noise_sd_mm, value.shape))
    return tracker, replace(true, value=TURN.inv().apply(true.value - SHIFT_MM))


def _found(sessions: dict[str, tuple[Samples, Samples]]) -> Frame:
    frame = frame_of(sessions)
    assert frame is not None
    return frame


def _off_deg(frame: Frame) -> float:
    return float(np.degrees((Rotation.from_matrix(frame.rotation) * TURN.inv()).magnitude()))


@settings(max_examples=10)
@given(late_s=st.floats(-0.2, 0.2))
def test_frame_and_clock_are_found_within_their_intervals(late_s: float) -> None:
    frame = _found({"P01": _seen(late_s=late_s)})
    assert frame.told
    assert _off_deg(frame) < 1.5 * frame.turn_half_deg < 1.5
    middle = frame.applied(frame.middle_mm[None])[0] - (TURN.apply(frame.middle_mm) + SHIFT_MM)
    assert np.linalg.norm(middle) < 1.5 * frame.shift_half_mm < 5.0
    assert abs(frame.lags_s["P01"].value - late_s) < 0.01
    assert frame.left_mm == pytest.approx(8 * np.sqrt(3), rel=0.1)  # the tracker's noise


def test_without_noise_it_is_exact() -> None:
    frame = _found({"P01": _seen(noise_sd_mm=0.0)})
    assert _off_deg(frame) < 0.05
    assert np.abs(frame.applied(np.zeros((1, 3)))[0] - SHIFT_MM).max() < 1.0


def test_strays_and_a_session_with_another_clock_do_not_bend_it() -> None:
    tracker, reference = _seen()
    strays = tracker.value.copy()
    strays[::20] += 500.0
    frame = _found({"P01": (replace(tracker, value=strays), reference), "P02": _seen(late_s=0.15)})
    assert _off_deg(frame) < 0.5
    assert frame.lags_s["P02"].value == pytest.approx(0.15, abs=0.01)


def test_a_movement_along_a_line_does_not_tell_the_turn_about_it() -> None:
    tracker, reference = _seen()
    along = tracker.value.copy()
    along[:, 1:] = np.random.default_rng(2).normal(0, 8, along[:, 1:].shape)
    on_line = TURN.inv().apply(TURN.apply(reference.value) * [1.0, 0.0, 0.0])
    frame = _found({"P01": (replace(tracker, value=along), replace(reference, value=on_line))})
    assert not frame.told


def test_two_movements_have_no_frame_in_common() -> None:
    tracker, reference = _seen()
    assert frame_of({"P01": (tracker, replace(reference, value=simulated(40.0, seed=9).reference.value))}) is None


STUDY = """
title: T
conditions: [a]
sessions: data/{participant}_{condition}.mcap
streams:
  tracker:   {topic: /tracker, kind: position, stamp: measurement, noise_sd_mm: 8}
  reference: {topic: /reference, kind: reference}
estimators:
  raw: {type: raw}
"""


def test_what_fit_proposes_is_taken_for_right_by_the_next_fit(
    folder: Callable[..., Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study, messages = folder(STUDY), []

    def fit() -> str:
        ran = run(capsys, monkeypatch, "fit", study, "--cache", study.parent / "cache", "--jobs", "1")
        assert ran.code == 0, ran.err
        return ran.out

    for topic, samples in zip(("/tracker", "/reference"), _seen(50.0), strict=True):
        for time, value in zip(samples.time, samples.value, strict=True):
            at = EPOCH_NS + round(time * 1e9)
            messages.append(Message(topic, "position", at, at, value / 1000))
    write_session(study / "data" / "P01_a.mcap", messages)
    first = fit()
    assert "which agrees with study.yaml" not in first
    proposed = yaml.safe_load(first[first.rindex("streams:\n  reference:") :])["streams"]["reference"]
    assert proposed["translation_mm"] == pytest.approx(SHIFT_MM, abs=10)
    settings = yaml.safe_load(STUDY)
    settings["streams"]["reference"] |= proposed
    (study / "study.yaml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    assert "which agrees with study.yaml" in fit()
