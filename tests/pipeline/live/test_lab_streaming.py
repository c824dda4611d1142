"""Senders that are outlets of Lab Streaming Layer: how they are heard, and what is said when they go."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.live.adapters import lsl
from pipeline.live.adapters.feeds import Feed
from pipeline.live.events import ClockOffset, Reading
from pipeline.live.units import units
from pipeline.study.recording import Lsl, Sender
from tests.pipeline.helpers import exit_code
from tests.pipeline.live.asked import loaded_lsl, outlet, problems, readings
from tests.pipeline.live.studies import STUDY, study_in


@given(st.lists(st.integers(1, 5), min_size=1, max_size=6))
@settings(max_examples=25)
def test_how_lsl_hands_samples_over_makes_no_difference(cuts: list[int]) -> None:
    samples = [([0.0, number, 0.25, 3.0], number * 1000) for number in range(sum(cuts))]
    taken: list[Any] = []

    feed = Feed("tracker", "position", units(Sender(lsl=Lsl(name="Hand"), unit="m")))
    of = lsl.Outlet(feed, Lsl(name="Hand", channels=(1, 2, 3)), taken.append, lambda: 10**9)
    begin = 0
    for cut in cuts:
        of.take(samples[begin : begin + cut])
        begin += cut
    of.take([([0.0, float("nan"), 0.25, 3.0], 5), ([1.0], 6)])
    assert of.refused == {"tracker: not of the stream's kind": 2}
    assert taken == [Reading("tracker", at, 10**9, (float(v[1]), 0.25, 3.0)) for v, at in samples]


def test_an_outlet_that_is_not_there_comes_and_goes_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded_lsl()
    monkeypatch.setattr(lsl, "LOOK_S", 0.1)
    monkeypatch.setattr(lsl, "BACK_OFF_S", (0.02,))
    found: list[Any] = []

    async def listen() -> None:
        feed = Feed("tracker", "position", units(Sender(lsl=Lsl(name="SteadyhandGone"))))
        of = lsl.Outlet(feed, Lsl(name="SteadyhandGone"), found.append, time.time_ns)
        of.listen()
        try:
            async with asyncio.timeout(20):
                while not problems(found):
                    await asyncio.sleep(0.01)
                with outlet("SteadyhandGone", 3, (1.0, 2.0, 3.0), 50):
                    while len(readings(found)) < 5:
                        await asyncio.sleep(0.01)
                while len(problems(found)) < 3:
                    await asyncio.sleep(0.01)
        finally:
            of.close()

    asyncio.run(listen())
    said = problems(found)
    assert said[0].startswith('tracker: no LSL stream is named "SteadyhandGone"; ')
    assert said[1] == ""
    assert said[2].startswith('tracker: the LSL stream "SteadyhandGone" is gone (')
    first = readings(found)[0]
    assert first.values == (0.001, 0.002, 0.003)
    assert first.stamp_ns is not None and abs(first.stamp_ns - first.arrival_ns) < 10**9
    (measured, *_) = [one for one in found if isinstance(one, ClockOffset)]
    assert measured.sender == "tracker"


def test_without_pylsl_it_is_said_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path, STUDY.replace("senders: {tracker: {demo: {}}", "senders: {tracker: {lsl: {name: Hand}}"))
    monkeypatch.setitem(__import__("sys").modules, "pylsl", None)
    assert exit_code(monkeypatch, "record", tmp_path) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert 'recording: senders.tracker: lsl: needs a further package: pip install "steadyhand[lsl]"' in said
