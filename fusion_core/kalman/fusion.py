"""Multi-rate Kalman fusion of late positions with prompt accelerations, on their own time stamps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from fusion_core.checks import require_not_negative, require_one_of, require_positive
from fusion_core.estimator import require_reading, require_readings
from fusion_core.kalman.event_history import Model
from fusion_core.kalman.event_time import EventTime
from fusion_core.kalman.fixed_gain import FixedGain
from fusion_core.kalman.motion import Matern72, Prior, Wiener
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor, require_covered, require_fit

_BIASED = 2  # the order of derivative whose sensors have a bias: accelerometers


@dataclass(frozen=True)
class FusionKalman:
    """Position, velocity, acceleration and the accelerometer's bias, from every reading of every sensor.

    The motion's prior is a Wiener-process acceleration of `jerk_psd_mm2_s5` or, with `prior="matern72"`, a process of
    `signal_sd_mm` and `length_scale_s` about an unknown constant. The bias is a random walk of
    `bias_walk_mm_s2_per_sqrt_s`, in the phone's own frame where readings carry their rotation (there it is constant),
    or in the tracker's. A late reading is inserted in order of measurement and later readings are processed again;
    readings later than `history_s` are left out and counted in the state.

    A position further off than `gate_sd` standard deviations is left out, three in a row at most (0: no gate). With
    `adaptation` above 0, the noise of the accelerations grows where positions are further off than the filter expects,
    and the jerk follows what the accelerations show; 0 leaves both as stated.

    `path="fixed_gain"` is for a regular stream of one tracker and one accelerometer at their stated `rate_hz`: the
    gains that the filter settles to, without gate or adaptation, the bias in the tracker's frame.

    Raises ValueError for parameters out of range, sensors that do not fit together, or a sensor later than the
    history.
    """

    sensors: Mapping[str, Sensor]
    prior: Literal["wiener", "matern72"] = "wiener"
    jerk_psd_mm2_s5: float = 1e7
    signal_sd_mm: float = 240.0
    length_scale_s: float = 0.6
    bias_frame: Literal["body", "tracker"] = "body"
    bias_walk_mm_s2_per_sqrt_s: float = 30.0
    initial_bias_sd_mm_s2: float = 300.0
    initial_speed_sd_mm_s: float = 500.0
    initial_acceleration_sd_mm_s2: float = 5000.0
    gate_sd: float = 4.0
    adaptation: float = 0.05
    history_s: float = 0.5
    path: Literal["event_time", "fixed_gain"] = "event_time"

    def __post_init__(self) -> None:
        require_fit(self.sensors)
        require_positive(history_s=self.history_s)
        require_not_negative(
            bias_walk_mm_s2_per_sqrt_s=self.bias_walk_mm_s2_per_sqrt_s,
            initial_bias_sd_mm_s2=self.initial_bias_sd_mm_s2,
            gate_sd=self.gate_sd,
            adaptation=self.adaptation,
        )
        require_one_of("prior", self.prior, ("wiener", "matern72"))
        require_one_of("bias_frame", self.bias_frame, ("body", "tracker"))
        require_one_of("path", self.path, ("event_time", "fixed_gain"))
        require_covered(self.sensors, "history_s", self.history_s)
        _ = self.steps  # so that sensors or settings that do not fit are an error now, not at the first reading

    @property
    def _prior(self) -> Prior:
        if self.prior == "matern72":
            return Matern72(self.signal_sd_mm, self.length_scale_s)
        return Wiener(self.jerk_psd_mm2_s5, self.initial_speed_sd_mm_s, self.initial_acceleration_sd_mm_s2)

    @property
    def _dimension(self) -> int:
        return self.sensors[position_sensor(self.sensors)].dimension

    @cached_property
    def _model(self) -> Model:
        motion = self._prior.motion()
        sensors = list(self.sensors.values())
        tracker = self.sensors[position_sensor(self.sensors)]
        biases = self._dimension if self.bias_frame == "tracker" else 3
        observes = np.zeros((len(sensors), self._dimension), bool)
        for row, sensor in enumerate(sensors):
            observes[row, list(sensor.sees(self._dimension))] = True
        return Model(
            states=(0,) * motion.states,
            axes=(0,) * self._dimension,
            constants=(0,) * biases,
            motion=motion,
            initial_covariance=self._prior.initial_covariance(tracker.noise_sd**2),
            initial_constant_variance=np.full(biases, self.initial_bias_sd_mm_s2**2),
            constant_psd=np.full(biases, self.bias_walk_mm_s2_per_sqrt_s**2),
            operators=np.array([_operator(name, sensor, motion.states) for name, sensor in self.sensors.items()]),
            biased=np.array([sensor.order == _BIASED for sensor in sensors]),
            observes=observes,
            noise_variance=np.array([sensor.noise_sd**2 for sensor in sensors]),
            gates=np.array([_gate(self.gate_sd, sensor.dimension) for sensor in sensors]),
            adaptation=self.adaptation,
        )

    @property
    def event_time(self) -> EventTime:
        """The event-time path, whatever path was chosen."""
        return EventTime(self.sensors, self._model, self.bias_frame == "body", self.history_s)

    @cached_property
    def steps(self) -> EventTime | FixedGain:
        """What carries out the chosen path."""
        if self.path == "fixed_gain":
            for name, value, needed in (
                ("prior", self.prior, "wiener"),
                ("bias_frame", self.bias_frame, "tracker"),
                ("gate_sd", self.gate_sd, 0.0),
                ("adaptation", self.adaptation, 0.0),
            ):
                if value != needed:
                    raise ValueError(f"path fixed_gain needs {name} {needed}, got {value}; event_time takes any")
            bias_psd = self.bias_walk_mm_s2_per_sqrt_s**2
            return FixedGain(self.sensors, self.jerk_psd_mm2_s5, bias_psd, self.history_s)
        return self.event_time

    def start(self) -> Any:
        """The state before any reading."""
        return self.steps.start()

    def update(self, state: Any, sensor: str, sample: Sample) -> Any:
        """The state with the reading inserted in order of measurement; later readings are processed again."""
        if sensor not in self.sensors:
            return state
        require_reading(sensor, self.sensors[sensor], sample)
        return self.steps.update(state, sensor, sample)

    def predict(self, state: Any, time: float) -> tuple[FloatArray, FloatArray]:
        """Mean and SD (d,) of the position at `time`, predicted from the newest reading."""
        return self.steps.predict(state, time)

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """The same steps in one compiled loop."""
        require_readings(self.sensors, samples)
        return self.steps.replay(samples, times)

    @property
    def resumes(self) -> bool:
        """Not with fixed gains, which look for regular stamps in the whole recording."""
        return self.path == "event_time"

    def resume(self, state: Any, samples: Mapping[str, Samples], times: FloatArray) -> tuple[Track, Any]:
        """`replay` of one piece of a recording, from the state after the piece before."""
        require_readings(self.sensors, samples)
        return self.event_time.resume(state, samples, times)


def _operator(name: str, sensor: Sensor, states: int) -> FloatArray:
    """The weights (states,) of the sum of one axis's states that a sensor observes."""
    observed = np.zeros(states)
    for term in sensor.terms:
        if term.at_s != 0:
            raise ValueError(f"{name}: only window_gp takes an operator with a term at another time, at_s={term.at_s}")
        observed[term.derivative] += term.weight
    return observed


def _gate(gate_sd: float, dimension: int) -> float:
    """The squared innovation of `dimension` axes that is as rare as `gate_sd` standard deviations of one axis."""
    if gate_sd == 0:
        return float(np.inf)
    from scipy.special import chdtri, ndtr

    return float(chdtri(dimension, 2.0 * ndtr(-gate_sd)))
