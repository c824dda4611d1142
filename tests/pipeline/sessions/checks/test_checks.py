"""Every fault is found and its cause named; nothing is found where nothing is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.sessions.checks import Finding, checked
from pipeline.sessions.checks.of_log import of_log
from pipeline.sessions.checks.recorded import Positions, Recorded, Times
from pipeline.sessions.checks.repeats import held
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Log, Readings
from pipeline.sessions.wanted import of_stream
from pipeline.study.folder import load_study
from pipeline.study.session_files import find_sessions
from pipeline.study.settings import Study
from tests.benchmarks.checks import drawn
from tests.conftest import real
from tests.pipeline.sessions.checks.hand import Hand, session
from tests.pipeline.sessions.checks.spoilt import EVENT_FAULTS, FAULTS, Fault
from tests.pipeline.sessions.checks.ways_to_spoil import (
    EVENTS,
    IMU,
    REFERENCE,
    TRACKER,
    change,
    from_other,
    later,
    values,
)


@cache
def simulated() -> tuple[Log, Study]:
    """A session without a fault."""
    return session(Hand())


@cache
def recordings(study_name: str) -> list[tuple[str, Log, Study]]:
    """The sessions of a study of real recordings: read once, since what spoils a log gives another one."""
    root = real(study_name)
    study = load_study(root)
    wanted = [of_stream(stream) for stream in study.streams.values()]
    return [(one.id, read_log(one.path, wanted), study) for one in find_sessions(root, study).sessions]


def alarms(log: Log, study: Study) -> list[Finding]:
    """What is not green."""
    return [one for one in checked(of_log(log, study)) if one.status != "green"]


@cache
def alarms_of(fault: Fault) -> list[Finding]:
    """What is not green of the simulated session with a fault; more than one test looks at it."""
    return alarms(*fault.spoil(*simulated()))


def names_the_cause(found: Sequence[Finding], fault: Fault) -> bool:
    """Is there an alarm of the right check whose message names the cause?"""
    return any(one.check.partition(":")[0] == fault.check and fault.says in one.message for one in found)


@pytest.mark.parametrize("fault", [*FAULTS, *EVENT_FAULTS], ids=lambda fault: fault.name)
def test_a_fault_is_found_and_its_cause_named(fault: Fault) -> None:
    found = alarms_of(fault)
    assert names_the_cause(found, fault), "\n".join(str(one) for one in found)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_is_found_in_a_real_recording(fault: Fault) -> None:
    for name, log, study in recordings("phone-in-hand"):
        if name != "P02_iphone4s":  # two phones are enough
            assert names_the_cause(alarms(*fault.spoil(log, study)), fault), name


@pytest.mark.parametrize(
    ("topic", "check"),
    [(TRACKER, "one movement"), (IMU, "one movement"), (REFERENCE, "one movement: reference"), (EVENTS, "selections")],
)
def test_a_stream_of_another_session_is_found(topic: str, check: str) -> None:
    other, _ = session(Hand(seed=9))
    found = alarms(*from_other(topic, other)(*simulated()))
    assert check in [one.check for one in found if one.status == "red"]
    assert check == "selections" or any("session" in one.message for one in found if one.check == check)


def test_targets_off_the_rings_of_the_task_are_found() -> None:
    log, study = simulated()
    ring = {"centre_mm": [100, 400], "diameter_mm": 400, "targets": 9}
    data = study.model_dump(exclude_none=True, exclude_defaults=True, mode="json")
    ringed = Study.model_validate(data | {"task": {"rings": [ring]}})
    (found,) = (one for one in alarms(log, ringed) if one.check == "targets")
    assert "where the task has none" in found.message

    def onto_ring(readings: Readings) -> Readings:
        angles = np.linspace(0, 7, len(readings.events))
        places = zip(readings.events, 0.1 + 0.2 * np.cos(angles), 0.4 + 0.2 * np.sin(angles), strict=True)
        return replace(
            readings,
            events=tuple(
                {**event, "target_x": float(x), "target_y": float(y)} if event.get("target_x") is not None else event
                for event, x, y in places
            ),
        )

    on_ring, _ = change(EVENTS, onto_ring)(log, ringed)
    assert not any(one.check == "targets" for one in alarms(on_ring, ringed))


def test_the_unit_alone_is_named_and_not_what_follows_from_it() -> None:
    for name in ("tracker in inches", "accelerometer in mm/s²"):
        fault = next(one for one in FAULTS if one.name == name)
        assert not any("noise" in one.check for one in alarms_of(fault)), name


def test_nothing_is_found_where_nothing_is_wrong() -> None:
    assert alarms(*simulated()) == []


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_found_in_sessions_of_any_sort(seed: int) -> None:
    assert alarms(*session(drawn(seed))) == []


@pytest.mark.parametrize("study_name", ["phone-in-hand", "broad-translation"])
def test_nothing_is_found_in_real_recordings(study_name: str) -> None:
    for name, log, study in recordings(study_name):
        assert alarms(log, study) == [], name


def test_every_finding_that_is_not_green_says_what_to_do() -> None:
    for fault in (*FAULTS, *EVENT_FAULTS):
        for one in alarms_of(fault):
            assert one.message
            assert one.found
            assert one.expected


def test_a_green_finding_says_what_was_found_and_no_more() -> None:
    assert all(one.found and one.expected and not one.message for one in checked(of_log(*simulated())))


@pytest.mark.parametrize("shift_s", [-0.2, -0.1, -0.05, 0.0, 0.05, 0.15])
def test_the_lag_is_found_within_its_interval(shift_s: float) -> None:
    log, study = change(IMU, lambda readings: later(readings, shift_s))(*session(Hand(seed=3, seconds=90.0)))
    motion = of_log(log, study).motion
    assert motion is not None
    assert abs(motion.lag_s.value - (0.1 - shift_s)) < 0.01
    assert motion.lag_s.low <= 0.1 - shift_s <= motion.lag_s.high


def test_the_lag_does_not_depend_on_the_frame_of_the_tracker() -> None:
    log, study = simulated()
    mirrored, _ = values(TRACKER, lambda value: -value[:, [2, 0, 1]])(log, study)
    first, second = of_log(log, study).motion, of_log(mirrored, study).motion
    assert first is not None
    assert second is not None
    assert np.isclose(first.lag_s.value, second.lag_s.value)
    assert np.isclose(first.explained, second.explained)


@pytest.mark.parametrize("factor", [0.1, 1.0, 25.4, 1000.0])
def test_the_size_of_the_movement_is_its_unit(factor: float) -> None:
    log, study = values(TRACKER, lambda value: value * factor)(*simulated())
    motion = of_log(log, study).motion
    assert motion is not None
    assert motion.scale.value == pytest.approx(factor, rel=0.15)


def test_without_an_orientation_the_lag_is_still_found() -> None:
    log, study = session(Hand(oriented=False))
    lag = next(one for one in checked(of_log(log, study)) if one.check == "lag")
    assert lag.status == "green"
    assert lag.found.endswith("]")


def test_a_hand_that_rests_tells_no_lag() -> None:
    log, study = session(Hand(span_mm=(0.0, 0.0, 0.0), turn_rad=0.0))
    lag = next(one for one in checked(of_log(log, study)) if one.check == "lag")
    assert (lag.status, lag.found) == ("green", "cannot be told from this movement")


@pytest.mark.parametrize("topic", [TRACKER, IMU])
def test_streams_that_are_empty_or_short_raise_nothing(topic: str) -> None:
    log, study = simulated()
    for count in (0, 1, 2, 5, 30):
        readings = log.topics[topic]
        short = replace(
            readings,
            stamp_ns=readings.stamp_ns[:count],
            arrival_ns=readings.arrival_ns[:count],
            values=readings.values[:count],
            claims=type(readings.claims)(),
        )
        alone = Log({}, {topic: short})
        assert alarms(alone, study) == []
        assert all(one.found for one in checked(of_log(Log({}, {**log.topics, topic: short}), study)))


def test_a_step_too_small_to_divide_by_is_no_grid() -> None:
    """A position of 5e-324 mm beside ones of decimetres: their ratio is larger than any number."""
    values = np.array([0.0, 5e-324, *range(1, 12)]) * np.array([1, 1, *[100.0] * 11])
    stamps = np.arange(len(values), dtype=np.int64) * 33_000_000
    positions = Positions("tracker", "position", Times(stamps, stamps, 0), np.tile(values[:, None], 3), 8.0)
    (found,) = held(Recorded(positions=(positions,)))
    assert found.status == "green"
