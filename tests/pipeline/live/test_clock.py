"""The clock of a sender, from pings over a path with delays, and from arrivals alone."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.live.clock import Clock, OneWay, arrived, exchanged
from pipeline.live.messages import Exchange

EPOCH_MS = 1_764_350_000_000.0


def pings(offset_ms: float, drift: float, seconds: float, delay: str, seed: int) -> Clock:
    """A clock that is `offset_ms` behind and runs at 1 + `drift`, after pings over a path of that kind."""
    random, clock = np.random.default_rng(seed), Clock()
    at = 0.0
    while at < seconds * 1000:
        there, back = delays(delay, random)
        sent = EPOCH_MS + at
        received = sent + there
        exchange = Exchange(
            theirs(sent, offset_ms, drift), received, received + 0.1, theirs(received + 0.1 + back, offset_ms, drift)
        )
        clock = exchanged(clock, exchange)
        at += 50.0 if at < 2000 else 250.0
    return clock


def theirs(recorder_ms: float, offset_ms: float, drift: float) -> float:
    """What the sender's clock says at a time of the recorder."""
    return recorder_ms + (recorder_ms - EPOCH_MS) * drift - offset_ms


def delays(kind: str, random: np.random.Generator) -> tuple[float, float]:
    """How long a ping takes there and back, in ms, on a quiet, a bursty or a power-saving network."""
    there, back = random.exponential(1.0, 2) + 1.0
    if kind == "bursty" and random.random() < 0.3:
        there += random.exponential(60.0)
    if kind == "power-saving":
        back += random.uniform(0, 100)
    return float(there), float(back)


@pytest.mark.parametrize("kind", ["quiet", "bursty", "power-saving"])
@pytest.mark.parametrize("drift", [0.0, 40e-6, -100e-6])
def test_a_clock_is_known_within_the_least_round_trip(kind: str, drift: float) -> None:
    for seed in range(3):
        clock = pings(123_456.789, drift, 30.0, kind, seed)
        assert clock.mapping is not None
        now = EPOCH_MS + 30_000
        off_ms = clock.mapping.to_ns(theirs(now, 123_456.789, drift)) / 1e6 - now
        assert abs(off_ms) < max(2.0, 2 * clock.mapping.uncertainty_ms)
        assert clock.steps == 0


def test_a_clock_that_is_set_is_followed_after_a_second() -> None:
    clock = pings(0.0, 0.0, 10.0, "quiet", 1)
    for number in range(10):
        at = EPOCH_MS + 10_000 + 250 * number
        clock = exchanged(clock, Exchange(at - 3_600_000, at + 1, at + 1.1, at - 3_600_000 + 2.1))
    assert clock.steps == 1
    assert clock.mapping is not None
    assert clock.mapping.offset_ms == pytest.approx(3_600_000, abs=1)


def test_one_late_ping_is_no_step_and_an_impossible_one_is_nothing() -> None:
    clock = pings(0.0, 0.0, 10.0, "quiet", 1)
    at = EPOCH_MS + 10_000
    assert exchanged(clock, Exchange(at, at + 900, at + 900.1, at + 901)).steps == 0
    assert exchanged(clock, Exchange(at, at + 1, at + 1.1, at - 5)) is clock
    assert exchanged(clock, Exchange(at, at + 1, at + 0.5, at + 5)) is clock


def test_a_page_that_answers_late_while_it_loads_has_no_clock_that_was_set() -> None:
    clock, at = Clock(), EPOCH_MS
    for late in (280.0, 150.0):  # all of it on the way back: the offset is half of it off, and no stamp tells
        clock = exchanged(clock, Exchange(at, at + 1, at + 1.1, at + 1.1 + late))
        at += 300.0
    for _ in range(40):
        clock = exchanged(clock, Exchange(at, at + 2, at + 2.1, at + 4.1))
        at += 250.0
    assert clock.steps == 0
    assert clock.mapping is not None
    assert clock.mapping.offset_ms == pytest.approx(0, abs=1)


def test_without_a_channel_back_the_fastest_arrival_tells() -> None:
    random, clock = np.random.default_rng(3), OneWay()
    for number in range(900):
        sent = EPOCH_MS + number * 33.0
        clock = arrived(clock, sent - 5_000_000.0, sent + 4.0 + random.exponential(10.0))
    assert clock.mapping is not None
    assert clock.mapping.offset_ms == pytest.approx(5_000_004.0, abs=0.5)
    assert len(clock.least_ms) <= 41  # it does not grow


def test_without_a_channel_back_a_clock_that_is_set_is_noticed_either_way() -> None:
    for step_ms in (3_600_000.0, -3_600_000.0):
        clock = OneWay()
        for number in range(200):
            sent = EPOCH_MS + number * 33.0
            theirs_ms = sent + (step_ms if number >= 100 else 0.0)
            clock = arrived(clock, theirs_ms, sent + 4.0)
        assert clock.steps == 1
        assert clock.mapping is not None
        assert clock.mapping.offset_ms == pytest.approx(4.0 - step_ms)
