"""The checks before a task: what ten seconds of movement tell of phone and tracker, and what the readings claim.

Four are seen in passing, whenever the last 20 s hold enough of it: the phone at rest, turned, and swept to and fro in
view of the tracker; the hand at the corners of the task. The fifth is a press of the button. Beside them, every check
that a report makes of a log (`pipeline.sessions.checks`) is made of the last 20 s. Pure, but slow: some 0.1 s.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.live.watch import Colour, Light, Request, Row
from pipeline.sessions.checks import checked
from pipeline.sessions.checks.agreement import expected_lag_s, in_ms, lag_message, lag_text, see_one_movement
from pipeline.sessions.checks.clocks import TOGETHER
from pipeline.sessions.checks.of_log import of_log
from pipeline.sessions.checks.one_movement import ONE_MOVEMENT
from pipeline.sessions.checks.orientation import gyroscope, turning
from pipeline.sessions.checks.recorded import Imu, Recorded
from pipeline.sessions.logs.log import Log, Readings
from pipeline.sessions.wanted import of_stream
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.study.units import G_M_S2, RAD_PER_DEG
from pipeline.tables.columns import S_PER_NS

STILL, TURN, SWEEP, REACH, TAP, CLAIMS = "still", "turn", "sweep", "reach", "tap", "claims"
_SHORTEST_S = 10.0  # of a stream, before its claims are judged
_STILL_S = 2.0
_STEADY_RAD_S, _STEADY_M_S2 = 0.03, 0.15  # SD of a phone that lies or is held still
_SLOWEST_TURN_RAD_S = 0.15  # of a phone that is held still, its bias included
_GRAVITY_OFF_M_S2 = 0.3
_BIAS_RAD_S = 0.05
_TURNS_RAD_S = 0.2
_ALIKE = 0.95
_SWEPT_MM = 10.0  # SD of the movement between 0.3 and 4 Hz
_LAG_S = 0.04
_HEADING_DEG = 5.0
_LATE_TAP_MS, _TOO_LATE_TAP_MS = 50.0, 150.0
# Checks of a whole log: 20 s need not be common to all, and of an even sweep any beat fits any other.
_WHOLE_LOG = (TOGETHER, ONE_MOVEMENT)
_NOT_ONE = (
    "Tracker and phone are not seen to make one movement yet: sweep on, less evenly. If that does not help, it is"
    " another phone, or the axes of one are wrong."
)


def guided(study: Study) -> tuple[str, ...]:
    """The checks that a study's streams allow."""
    has_imu = any(stream.kind == "acceleration" for stream in study.sensor_streams.values())
    has_tracker = study.tracker is not None
    wanted = {STILL: has_imu, TURN: has_imu, SWEEP: has_imu and has_tracker, REACH: has_tracker, TAP: True}
    return tuple(name for name, is_wanted in wanted.items() if is_wanted)


def examined(study: Study, request: Request) -> tuple[tuple[Light, ...], tuple[Light, ...]]:
    """What the last readings say: of the checks that were seen in them, and of what they claim."""
    recorded = of_log(_log(study, request.rows), study)
    seen: list[Light] = []
    imu = recorded.imu
    if imu is not None:
        seen += _still(imu)
        seen += _turned(imu, request.rows[imu.name])
        seen += _swept(recorded, request.heading_sd_rad)
    long_enough = [name for name, rows in request.rows.items() if _seconds(rows) >= _SHORTEST_S]
    claims = of_log(_log(study, {name: request.rows[name] for name in long_enough}), study)
    return tuple(seen), tuple(_claims(claims))


def _seconds(rows: Sequence[Row]) -> float:
    return (rows[-1].arrival_ns - rows[0].arrival_ns) * S_PER_NS if rows else 0.0


def _log(study: Study, rows: Mapping[str, Sequence[Row]]) -> Log:
    """The readings as if they had been read from a log."""
    topics = {}
    for name, of_one in rows.items():
        if of_one:
            topics[of_stream(study.streams[name]).key] = Readings(
                np.array([row.stamp_ns for row in of_one], np.int64),
                np.array([row.arrival_ns for row in of_one], np.int64),
                np.array([row.values for row in of_one], np.float64),
            )
    return Log({}, topics)


# --- the phone at rest, turned, swept


def _still(imu: Imu) -> Iterator[Light]:
    """The newest two seconds at rest: gravity, noise, and what the gyroscope reads when nothing turns."""
    time = imu.times.arrival_s
    size = np.linalg.norm(imu.force_m_s2, axis=1)
    for end in np.arange(time[-1], time[0] + _STILL_S, -_STILL_S / 4):
        within = (time > end - _STILL_S) & (time <= end)
        if within.sum() < 20 or not _is_still(size[within], imu.gyroscope_rad_s[within]):
            continue
        gravity, bias = float(size[within].mean()), imu.gyroscope_rad_s[within].mean(axis=0)
        noise = float(np.sqrt(np.mean(np.var(imu.force_m_s2[within], axis=0))))
        figures = f"{gravity:.2f} m/s², noise {noise:.2f} m/s², gyroscope {np.linalg.norm(bias):.3f} rad/s."
        colour: Colour = "green"
        if abs(gravity - G_M_S2) > _GRAVITY_OFF_M_S2:
            colour = "red"
            figures += (
                f" At rest it should read {G_M_S2:.2f}: its unit is another (say so under recording: senders:"
                f" {imu.name}: unit), or gravity is not in it."
            )
        elif np.linalg.norm(bias) > _BIAS_RAD_S:
            colour = "amber"
            figures += " Lay the phone down for half a minute: many calibrate their gyroscope then."
        yield Light(STILL, colour, f"At rest {figures}")
        return


def _is_still(size: FloatArray, turning_rad_s: FloatArray) -> bool:
    steady = float(size.std()) < _STEADY_M_S2 and float(turning_rad_s.std(axis=0).max()) < _STEADY_RAD_S
    return steady and float(np.linalg.norm(turning_rad_s.mean(axis=0))) < _SLOWEST_TURN_RAD_S


def _turned(imu: Imu, rows: Sequence[Row]) -> Iterator[Light]:
    """The gyroscope against the orientation that the sender gave, or where it gives none, against gravity."""
    own = np.array([row.turned_xyzw or (np.nan,) * 4 for row in rows])
    if len(own) != len(imu.force_m_s2):
        return
    by_sender = replace(imu, orientation=own)
    finding = next(gyroscope(Recorded(imus=(by_sender,))), None)
    if finding is None:
        return
    turns = turning(by_sender) if by_sender.oriented.mean() > 0.5 else None
    if turns is None:  # no orientation came with it: gravity alone can be compared
        if float(np.sqrt(np.mean(np.sum(imu.gyroscope_rad_s**2, axis=1)))) > _TURNS_RAD_S:
            yield Light(TURN, finding.status, finding.message or "It turns as gravity does.")
        return
    rate, alike = turns
    if finding.status == "red":
        yield Light(TURN, "red", finding.message)
    elif rate > _TURNS_RAD_S:
        text = f"Gyroscope and orientation turn alike (correlation {alike:.3f})."
        if alike < _ALIKE or finding.status != "green":
            text = finding.message or f"Gyroscope and orientation hardly turn alike ({alike:.2f}); turn it more slowly."
        yield Light(TURN, "green" if alike >= _ALIKE and finding.status == "green" else "amber", text)


def _swept(recorded: Recorded, heading_sd_rad: float | None) -> Iterator[Light]:
    """Ten seconds of movement that both saw: the lag between them, and how well the heading is known."""
    tracker, imu, motion = recorded.tracker, recorded.imu, recorded.motion
    if tracker is None or imu is None or motion is None or motion.position_mm < _SWEPT_MM:
        return
    if not see_one_movement(motion) or motion.lag_beyond:
        yield Light(SWEEP, "amber", _NOT_ONE)
        return
    stated_s = expected_lag_s(tracker, imu)
    off_s = motion.lag_s.value - stated_s
    certain_s = max(motion.lag_s.low - stated_s, stated_s - motion.lag_s.high)
    text = f"The tracker is {lag_text(motion.lag_s)} later than the phone, {in_ms(stated_s)} by study.yaml."
    if abs(off_s) > _LAG_S and certain_s > 0:
        yield Light(SWEEP, "red", lag_message(tracker, imu, motion.lag_s.value, off_s))
        return
    if abs(off_s) > _LAG_S:
        yield Light(SWEEP, "amber", f"{text} Sweep on, less evenly, so that it is known better.")
        return
    if heading_sd_rad is not None:
        sd_deg = heading_sd_rad / RAD_PER_DEG
        if not sd_deg <= _HEADING_DEG:
            yield Light(SWEEP, "amber", f"{text} Its heading is not known to {_HEADING_DEG:.0f}° yet: sweep on.")
            return
        text += f" Heading ± {sd_deg:.1f}°."
    yield Light(SWEEP, "green", text)


# --- the task's corners, and a press


def reach(seen: int, of: int) -> Light:
    """How many of the task's corners the tracker has seen the hand at."""
    if seen == 0:
        return Light(REACH, "off", "Move to each corner of the picture.")
    if seen < of:
        return Light(REACH, "amber", f"The tracker has seen {seen} of {of} corners. Move to the others, in its view.")
    return Light(REACH, "green", "The tracker sees the whole task.")


def tap(late_ms: float, round_trip_ms: float | None) -> Light:
    """How long after a press the recorder knows of it."""
    trip = "" if round_trip_ms is None else f", round trip {round_trip_ms:.0f} ms"
    text = f"A press is known after {late_ms:.0f} ms{trip}."
    if late_ms <= _LATE_TAP_MS:
        return Light(TAP, "green", text)
    remedy = " The network is slow: bring the phone nearer to the access point, or use a USB cable."
    return Light(TAP, "red" if late_ms > _TOO_LATE_TAP_MS else "amber", text + remedy)


NOT_YET: Mapping[str, str] = {
    STILL: "Hold the phone still for two seconds.",
    TURN: "Turn the phone about all its axes for five seconds.",
    SWEEP: "Move the phone left and right for ten seconds, in view of the tracker.",
    TAP: "Press the button on the phone.",
}
"""What to do for a check of which nothing has been seen."""


# --- what the readings claim


def _claims(recorded: Recorded) -> Iterator[Light]:
    """A light for each claim that the readings contradict, and first one for all."""
    findings = [one for one in checked(recorded) if not one.check.startswith(_WHOLE_LOG)]
    if not findings:
        return
    wrong = [one for one in findings if one.status != "green"]
    if not wrong:
        yield Light(CLAIMS, "green", f"{len(findings)} checks of the last 20 s contradict nothing in study.yaml.")
    for one in wrong:
        yield Light(one.check, one.status, f"{one.message}.")
