"""One simulated session: a participant, a task and an estimator in one loop, with all that a log would hold."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from fusion_core import Estimator, Samples, Sensor, accuracy
from fusion_core.live import Readings, live
from fusion_core.phone.orientation import rotate, rotations
from pipeline.errors import PipelineError
from pipeline.sessions.estimators import build_estimator, sensors
from pipeline.sessions.recording import seeded
from pipeline.simulation import layout as layouts
from pipeline.simulation import loop_steps, people, sensing
from pipeline.simulation.hand_steps import DONE, PHASE, PLANS, STEP, STEP_S, Hand, IntArray, Layout, Sway, hand_at
from pipeline.simulation.loop_steps import TAP_S, TAP_X, TAP_Y, Sensing, Session
from pipeline.simulation.motion import minimum_jerk
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.study.simulation import SelectionSimulation
from pipeline.study.streams import AccelerationStream, PositionStream
from pipeline.tables.columns import S_PER_NS

# Most sessions are done by then; a longer one is run again from its begin with more room.
_USUAL_S = 120.0
_USUAL_S_A_TARGET = 15.0
_MOMENT_S = 1.0
_TREMOR_HZ, _TREMOR_DAMPING = 8.0, 0.1
_DRIFT_HZ, _DRIFT_DAMPING = 0.3, 0.7


@dataclass(frozen=True)
class Setting:
    """What every session of a study shares. PipelineError, beginning with `where`, for what it lacks."""

    study: Study
    where: str

    @cached_property
    def simulation(self) -> SelectionSimulation:
        """The block of study.yaml."""
        assert isinstance(self.study.simulation, SelectionSimulation)  # noqa: S101 - tells the type checker
        return self.study.simulation

    @cached_property
    def layout(self) -> Layout:
        """The task in the form that the compiled participant takes."""
        if self.study.task is None:
            raise PipelineError(f"{self.where}: simulation: selection needs a task: with targets")
        return layouts.layout(self.study.task, self.where)

    @cached_property
    def streams(self) -> tuple[str, PositionStream, str, AccelerationStream]:
        """The tracker and the phone, with their names."""
        study = self.study
        named = {"position": study.tracker, "acceleration": study.stream_of_kind("acceleration")}
        found: dict[str, str] = {}
        for kind, name in named.items():
            if name is None:
                raise PipelineError(f"{self.where}: simulation: streams lacks one of kind {kind}")
            found[kind] = name
        tracker, imu = study.streams[found["position"]], study.streams[found["acceleration"]]
        assert isinstance(tracker, PositionStream)  # noqa: S101
        assert isinstance(imu, AccelerationStream)  # noqa: S101
        if len(study.sensor_streams) > 2:
            raise PipelineError(f"{self.where}: simulation: takes one tracker and one phone, but streams has more")
        if imu.calibrate_s or any(imu.lever_arm_mm) or any(imu.mounting_xyzw[:3]):
            raise PipelineError(
                f"{self.where}: simulation: the tracker sees the simulated phone's accelerometer itself; remove"
                " mounting_xyzw, lever_arm_mm and calibrate_s"
            )
        if study.axes not in (("x", "y"), ("x", "y", "z")):
            raise PipelineError(f"{self.where}: simulation: selection needs axes: [x, y], found {list(study.axes)}")
        return found["position"], tracker, found["acceleration"], imu

    def shown(self, condition: str) -> Estimator:
        """The estimator that a condition displays."""
        name = self.study.shown.get(condition)
        if name is None:
            raise PipelineError(
                f'{self.where}: simulation: shown has no estimator for "{condition}"; add the one it displays'
            )
        return build_estimator(self.study, name)

    def lag_s(self, condition: str) -> float:
        """How late the condition's display is behind the participant's own motion, in s."""
        if self.streams[1].rate_hz is None:  # a filter's lag depends only on the rates of its readings
            rates = self.simulation.instruments.tracker_rate_hz, self.simulation.instruments.imu_rate_hz
        else:
            rates = self.streams[1].rate_hz, self.streams[3].rate_hz or self.simulation.instruments.imu_rate_hz
        return effective_lag_s(self.study.model_dump_json(include=_LAG_DEPENDS_ON), self.study.shown[condition], rates)


_LAG_DEPENDS_ON = {"title", "conditions", "axes", "streams", "estimators", "sessions"}


@lru_cache(maxsize=256)
def effective_lag_s(settings: str, name: str, rates_hz: tuple[float, float]) -> float:
    """How late an estimator is, in s, on minimum-jerk reaches without noise; 0 if it is ahead.

    `settings` are the study's settings in JSON that its estimators depend on; `rates_hz` are those of tracker and IMU.
    """
    study = Study.model_validate_json(settings)
    estimator, length_s, reach_s = build_estimator(study, name), 12.0, 0.9
    known = sensors(study)

    def hand(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        share, bend = np.zeros_like(time), np.zeros_like(time)
        for number in range(int(length_s / 2 / reach_s)):
            reach_share, reach_bend = minimum_jerk(time, 1.0 + 2 * reach_s * number, reach_s)
            sign = 1.0 if number % 2 == 0 else -1.0
            share, bend = share + sign * reach_share, bend + sign * reach_bend
        return 150.0 * share, 150.0 * bend

    def samples(sensor: Sensor, rate_hz: float) -> Samples:
        time = np.arange(0.0, length_s, 1.0 / rate_hz)
        value = np.zeros((len(time), sensor.dimension))
        value[:, 0] = hand(time)[1 if sensor.order else 0]
        return Samples(time, time + sensor.latency_s, value)

    read = {
        name: samples(sensor, rates_hz[1 if sensor.order else 0])
        for name, sensor in known.items()
        if sensor.order in (0, 2)
    }
    times = np.arange(1.0, length_s, 1.0 / rates_hz[1])
    track = estimator.replay(read, times)
    fine = np.arange(0.0, length_s, 0.002)
    truth = np.zeros((len(fine), track.mean.shape[1]))
    truth[:, 0] = hand(fine)[0]
    lag_s = accuracy.lag(times, track.mean, Samples(fine, fine, truth), np.random.default_rng(0)).value
    return float(np.nan_to_num(max(lag_s, 0.0)))


@dataclass(frozen=True)
class Outcome:
    """The record of a simulated session. Times are s since its begin; positions in mm, in the tracker's frame.

    `taps` (k, 5) holds per target when it was selected, the displayed and the true position, NaN where it was not;
    `trace` (steps, 4) the true hand `STEP_S` apart; `shown` (i, d) what was displayed at `instant_ns`.
    """

    begins_s: float
    ends_s: float
    targets_mm: FloatArray
    taps: FloatArray
    plans: int
    trace: FloatArray
    shown: FloatArray
    frames: sensing.Frames
    frame_mm: FloatArray
    phone: sensing.Phone
    force_mm_s2: FloatArray
    instant_ns: IntArray

    @property
    def errors_mm(self) -> FloatArray:
        """Displayed less target position of each selection (k, 2)."""
        errors: FloatArray = self.taps[:, [TAP_X, TAP_Y]] - self.targets_mm
        return errors

    @property
    def completion_time_s(self) -> float:
        """From the begin to the last selection; NaN without one."""
        return float(np.nanmax(self.taps[:, TAP_S]) - self.begins_s) if self.selected else np.nan

    @property
    def selected(self) -> int:
        """How many targets were selected."""
        return int(np.isfinite(self.taps[:, TAP_S]).sum())

    @property
    def selection_mse_mm2(self) -> float:
        """The mean squared error over the selections."""
        return float(np.nanmean(np.sum(self.errors_mm**2, axis=1))) if self.selected else np.nan

    @property
    def corrections_per_target(self) -> float:
        """How often a movement was planned anew; 0 in a model that does not plan."""
        return self.plans / max(self.selected, 1)


def simulate(setting: Setting, participant: str, condition: str, *, compiled: bool = True) -> Outcome:
    """One session, independent of all other sessions. `compiled=False`: by the plain loop."""
    longest_s = setting.simulation.longest_s
    length_s = min(_USUAL_S, _USUAL_S_A_TARGET * len(setting.layout.targets_mm), longest_s)
    while True:
        outcome, done = _attempt(setting, prepare(setting, participant, condition, length_s), condition, compiled)
        if done or length_s >= longest_s:
            return outcome
        length_s = min(2 * length_s, longest_s)


def compile_loop(setting: Setting) -> None:
    """Run a moment of a session in each condition, of which nothing but the machine code is kept.

    Its participant knows no lag, since finding the lags takes other machine code.
    """
    for condition in setting.study.conditions:
        _attempt(setting, prepare(setting, "", condition, _MOMENT_S, lag_s=0.0), condition, compiled=True)


def find_lags(setting: Setting) -> None:
    """Find every condition's lag, of which the machine code is kept too."""
    for condition in setting.study.conditions:
        setting.lag_s(condition)


@dataclass(frozen=True)
class Prepared:
    """A session that has not begun: its sensors' times and noise, the arrays that a loop fills in, and the participant.

    `walking` is what `loop_steps.walk` and `run` take first. Times in `readings` and `instants` are s since the first
    arrival.
    """

    names: tuple[str, str]
    frames: sensing.Frames
    phone: sensing.Phone
    readings: Readings
    rotation: FloatArray
    instant_ns: IntArray
    instants: FloatArray
    walking: tuple[Any, ...]

    @property
    def hand(self) -> Hand:
        """The participant's hand."""
        hand: Hand = self.walking[4]
        return hand

    @property
    def session(self) -> Session:
        """The record that the loop writes."""
        session: Session = self.walking[8]
        return session


def prepare(
    setting: Setting, participant: str, condition: str, length_s: float, lag_s: float | None = None
) -> Prepared:
    """A session of at most `length_s`, ready to run; people are used to `lag_s`, or else to the display's own."""
    settings, (names, tracker, imu_name, imu) = setting.simulation, setting.streams
    draws = partial(seeded, str(settings.seed), participant, condition)
    frames = sensing.frames(tracker, settings.instruments, length_s, draws)
    phone = sensing.phone(imu, settings.instruments, length_s, draws)
    origin_ns = int(min([*frames.arrival_ns[:1], *phone.arrival_ns[:1], *reference_ns(setting, length_s)[:1]]))
    turn, offset, rotation = _in_tracker_frame(phone, np.array(imu.gravity_mm_s2), len(setting.study.axes))
    dimension = len(setting.study.axes)
    readings = Readings(
        frame_time=_since(frames.arrival_ns - round(tracker.latency_s / S_PER_NS), origin_ns),
        frame_arrival=_since(frames.arrival_ns, origin_ns),
        frame_mm=np.zeros((len(frames.time_ns), dimension)),
        force_time=_since(phone.arrival_ns - round(imu.latency_s / S_PER_NS), origin_ns),
        force_arrival=_since(phone.arrival_ns, origin_ns),
        force_mm_s2=np.zeros((len(phone.time_ns), dimension)),
    )
    instant_ns = np.unique(phone.arrival_ns)
    steps = int(instant_ns[-1] // loop_steps.STEP_NS) + 2 if len(instant_ns) else 1
    session = Session(
        np.zeros((steps + 1, 4)),
        np.full((len(instant_ns), dimension), np.nan),
        np.full((len(setting.layout.targets_mm), 5), np.nan),
        np.zeros(3, np.int64),
    )
    sensed = Sensing(
        frames.time_ns, np.ascontiguousarray(frames.noise_mm[:, :dimension]), phone.time_ns, turn, offset, instant_ns
    )
    lag_s = setting.lag_s(condition) if lag_s is None else lag_s
    person = people.used_to_lag(people.person(settings, participant), lag_s)
    begin = layouts.start(setting.layout)
    session.trace[0, :2] = begin
    hand = hand_at(begin, settings.still_before_s)
    walking = (person, setting.layout, *_sways(settings), hand, draws("hand"), sensed, readings, session)
    instants = _since(instant_ns, origin_ns)
    return Prepared((names, imu_name), frames, phone, readings, rotation, instant_ns, instants, walking)


def _attempt(setting: Setting, ready: Prepared, condition: str, compiled: bool) -> tuple[Outcome, bool]:
    """What comes of a session, and whether its task was done by its end."""
    estimator, gravity_mm_s2 = setting.shown(condition), np.array(setting.streams[3].gravity_mm_s2)
    shows = live(estimator, ready.names, ready.readings, ready.rotation, ready.instants) if compiled else None
    if shows is not None:
        loop_steps.run(*ready.walking, shows, ready.instants)  # type: ignore[call-arg]
    else:
        held = ready.phone, ready.rotation, gravity_mm_s2
        _run_uncompiled(estimator, ready.names, held, ready.instants, ready.walking)
    hand, session, readings = ready.hand, ready.session, ready.readings
    step, shown_until = int(hand.progress[STEP]), int(session.next[2])
    outcome = Outcome(
        setting.simulation.still_before_s,
        step * STEP_S,
        setting.layout.targets_mm,
        session.taps,
        int(hand.progress[PLANS]),
        session.trace[: step + 1],
        session.shown[:shown_until],
        _first(ready.frames, int(session.next[0])),
        readings.frame_mm[: session.next[0]],
        _first(ready.phone, int(session.next[1])),
        readings.force_mm_s2[: session.next[1]],
        ready.instant_ns[:shown_until],
    )
    return outcome, bool(hand.progress[PHASE] == DONE)


def _run_uncompiled(
    estimator: Estimator,
    names: tuple[str, str],
    held: tuple[sensing.Phone, FloatArray, FloatArray],
    instants: FloatArray,
    walking: tuple[Any, ...],
) -> None:
    """The loop by the estimator's own `update` and `predict`, for any estimator; the compiled loop gives the same."""
    from fusion_core import Sample

    hand, sensed, readings, session = walking[4], walking[6], walking[7], walking[8]
    phone, rotation, gravity_mm_s2 = held
    order = np.argsort(np.concatenate([readings.frame_arrival, readings.force_arrival]), kind="stable")
    state, upcoming, count = estimator.start(), 0, len(readings.frame_arrival)
    for index, now in enumerate(instants):
        until = max(-(-int(sensed.instant_ns[index]) // loop_steps.STEP_NS), 1)
        loop_steps.walk(*walking, until)  # type: ignore[call-arg]
        if hand.progress[PHASE] == DONE:
            return
        while upcoming < len(order):
            row = int(order[upcoming])
            is_frame, row = row < count, row if row < count else row - count
            arrival = (readings.frame_arrival if is_frame else readings.force_arrival)[row]
            if arrival > now:
                break
            if is_frame:
                sample = Sample(readings.frame_time[row], arrival, readings.frame_mm[row].copy())
            else:
                force = felt(phone, gravity_mm_s2, session.trace, row)
                value = readings.force_mm_s2[row].copy()
                sample = Sample(readings.force_time[row], arrival, value, rotation[row], force)
            state = estimator.update(state, names[0 if is_frame else 1], sample)
            upcoming += 1
        session.shown[index] = estimator.predict(state, float(now))[0]
        session.next[2] = index + 1


def felt(phone: sensing.Phone, gravity_mm_s2: FloatArray, trace: FloatArray, row: int) -> FloatArray:
    """The specific force of a reading (3,), in the phone's frame, as the log will have it."""
    time_ns = int(phone.time_ns[row])
    step = max(-(-time_ns // loop_steps.STEP_NS), 1)
    share = 1.0 - (step * loop_steps.STEP_NS - time_ns) / loop_steps.STEP_NS
    acceleration = np.zeros(3)
    acceleration[:2] = trace[step - 1, 2:4] + share * (trace[step, 2:4] - trace[step - 1, 2:4])
    force: FloatArray = phone.to_body[row] @ (acceleration - gravity_mm_s2) + phone.error_mm_s2[row]
    return force


def _first(readings: Any, count: int) -> Any:
    """The first `count` readings of a sensor."""
    return type(readings)(*(getattr(readings, name)[:count] for name in readings.__dataclass_fields__))


def _since(time_ns: IntArray, origin_ns: int) -> FloatArray:
    """Times in s, computed as the pipeline does when it reads a log, so that they are the same to the last bit."""
    seconds: FloatArray = np.asarray((time_ns - origin_ns) * S_PER_NS, dtype=np.float64)
    return seconds


def reference_ns(setting: Setting, length_s: float) -> IntArray:
    """When the reference records the true position (n,), in ns."""
    rate_hz = setting.simulation.instruments.reference_rate_hz
    return np.rint(np.arange(0.0, length_s, 1.0 / rate_hz) / S_PER_NS).astype(np.int64)


def _sways(settings: SelectionSimulation) -> tuple[Sway, Sway]:
    """Tremor and drift."""
    traits = settings.traits
    return (
        people.sway(_TREMOR_HZ, _TREMOR_DAMPING, traits.tremor_mm.mean),
        people.sway(_DRIFT_HZ, _DRIFT_DAMPING, traits.drift_mm.mean),
    )


def _in_tracker_frame(
    phone: sensing.Phone, gravity_mm_s2: FloatArray, dimension: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The rotation (n, d, 2) and offset (n, d) that turn the hand's acceleration into the one read from the log.

    The phone measures `to_body (a − gravity) + error`; the pipeline rotates that by the logged orientation and adds
    gravity. The third result is the logged orientation as a rotation (n, d, 3).
    """
    believed = rotations(phone.logged_xyzw)
    turn = believed @ phone.to_body
    offset = rotate(phone.logged_xyzw, phone.error_mm_s2) - turn @ gravity_mm_s2 + gravity_mm_s2
    return (
        np.ascontiguousarray(turn[:, :dimension, :2]),
        np.ascontiguousarray(offset[:, :dimension]),
        np.ascontiguousarray(believed[:, :dimension]),
    )
