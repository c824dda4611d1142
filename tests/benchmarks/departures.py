"""Where a lab's reality departs from study.yaml: recordings altered one way at a time.

A `Source` is what happened: a phone's readings and where the tracked point truly was. A `Departure` says how tracker
and phone differ from what their sensors state (positions at 30 Hz with 8 mm of white noise, 0.1 s late; accelerations
on the reference's clock). `recorded` makes of both what an estimator gets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fusion_core import Samples, Sensor
from fusion_core.accuracy import interpolate
from fusion_core.phone.orientation import nearest
from fusion_core.samples import FloatArray

SENSORS: Mapping[str, Sensor] = {"tracker": Sensor("position", 8.0, 0.1), "imu": Sensor("acceleration", 100.0)}
G_MM_S2 = 9806.65
_SPELL_EVERY_S, _SPELL_S = 12.0, 1.0  # of freezes, losses and swapped bodies


@dataclass(frozen=True)
class Source:
    """A phone's readings, `quaternion` (n, 4) NaN where its orientation is unknown, and the true `reference`."""

    name: str
    time: FloatArray
    arrival: FloatArray
    force_mm_s2: FloatArray
    gyroscope_rad_s: FloatArray
    quaternion: FloatArray
    reference: Samples
    gravity_mm_s2: FloatArray

    def until(self, seconds: float) -> Source:
        """Its first part."""
        return self.between(-np.inf, self.time[0] + seconds)

    def between(self, begin: float, end: float) -> Source:
        """What was measured from one time to another."""
        kept = (self.time >= begin) & (self.time <= end)
        within = (self.reference.time >= begin) & (self.reference.time <= end)
        at, value = self.reference.time[within], self.reference.value[within]
        return replace(
            self,
            time=self.time[kept],
            arrival=self.arrival[kept],
            force_mm_s2=self.force_mm_s2[kept],
            gyroscope_rad_s=self.gyroscope_rad_s[kept],
            quaternion=self.quaternion[kept],
            reference=Samples(at, at, value),
        )


@dataclass(frozen=True)
class Departure:
    """What is otherwise than stated; the defaults are as stated."""

    noise_sd_mm: float = 8.0
    degrees: float = np.inf  # of freedom of a Student-t noise
    correlation_s: float = 0.0  # of the tracker's noise, a first-order autoregression
    latency_s: float = 0.1
    wander_s: float = 0.0  # the latency swings so far about its mean, over 20 s
    jitter_s: float = 0.0  # mean of an exponential delay of each frame, stamped on arrival
    clock_s: float = 0.0  # the phone's stamps are so much too late
    clock_ppm: float = 0.0
    spell: str = ""  # freeze, swap, loss or zeros: a second of it every twelve
    clipped_g: float = np.inf
    bits: int = 0  # of an accelerometer of ±4 g
    rate_hz: float = np.inf  # of the phone, at the most
    burst_s: float = 0.0  # the phone's readings arrive so many seconds at a time
    scale: float = 1.0  # of the accelerometer
    gravity: float = 1.0  # study.yaml's, relative to the true one
    bias_mm_s2: float = 0.0
    mounting_deg: float = 0.0
    yaw_deg: float = 0.0
    withheld: bool = False  # the orientation
    gyroscope_deg_s: float = 0.0


DEPARTURES: Mapping[str, Departure] = {
    "as stated": Departure(),
    "tracker noise 3 mm": Departure(noise_sd_mm=3.0),
    "tracker noise 5 mm": Departure(noise_sd_mm=5.0),
    "tracker noise 12 mm": Departure(noise_sd_mm=12.0),
    "tracker noise 20 mm": Departure(noise_sd_mm=20.0),
    "Student-t noise, 2.5 degrees": Departure(degrees=2.5),
    "AR(1) noise, 0.2 s": Departure(correlation_s=0.2),
    "AR(1) noise, 1 s": Departure(correlation_s=1.0),
    "latency 80 ms": Departure(latency_s=0.08),
    "latency 130 ms": Departure(latency_s=0.13),
    "latency 200 ms": Departure(latency_s=0.2),
    "latency wandering 70-150 ms": Departure(latency_s=0.11, wander_s=0.04),
    "latency jitter 20 ms": Departure(jitter_s=0.02),
    "phone clock +30 ms": Departure(clock_s=0.03),
    "phone clock -30 ms": Departure(clock_s=-0.03),
    "phone clock +60 ms": Departure(clock_s=0.06),
    "phone clock 50 ppm": Departure(clock_ppm=50.0),
    "phone clock 500 ppm": Departure(clock_ppm=500.0),
    "frozen 1 s": Departure(spell="freeze"),
    "other body 1 s": Departure(spell="swap"),
    "lost 1 s": Departure(spell="loss"),
    "zeros 1 s": Departure(spell="zeros"),
    "clipped at 2 g": Departure(clipped_g=2.0),
    "12 bit": Departure(bits=12),
    "phone at 50 Hz": Departure(rate_hz=50.0),
    "phone in bursts of 100 ms": Departure(burst_s=0.1),
    "accelerometer scale 3 %": Departure(scale=1.03),
    "gravity 1 %": Departure(gravity=1.01),
    "accelerometer bias 500 mm/s²": Departure(bias_mm_s2=500.0),
    "mounting 5°": Departure(mounting_deg=5.0),
    "mounting 10°": Departure(mounting_deg=10.0),
    "yaw 15°": Departure(yaw_deg=15.0),
    "yaw 45°": Departure(yaw_deg=45.0),
    "yaw 120°": Departure(yaw_deg=120.0),
    "orientation withheld": Departure(withheld=True),
    "withheld, gyroscope 1.5°/s": Departure(withheld=True, gyroscope_deg_s=1.5),
    "withheld, other body 1 s": Departure(withheld=True, spell="swap"),
}


@dataclass(frozen=True)
class Recorded:
    """What an estimator gets, the instants it is asked for, and where the tracked point was then."""

    samples: dict[str, Samples]
    times: FloatArray
    truth: FloatArray


def recorded(source: Source, departure: Departure, seed: int = 1) -> Recorded:
    """A source as sensors that depart from what they state would have recorded it."""
    random = np.random.default_rng(seed)
    tracker = _tracker(source, departure, random)
    imu = _imu(source, departure, tracker)
    times = np.unique(imu.arrival)
    times = times[times > tracker.arrival[0] + 1.0]
    truth = interpolate(source.reference, times)
    known = np.isfinite(truth).all(axis=1)
    return Recorded({"tracker": tracker, "imu": imu}, times[known], truth[known])


def _tracker(source: Source, departure: Departure, random: np.random.Generator) -> Samples:
    """Frames of the reference, stamped on arrival and taken for as late as the sensor states."""
    true = source.reference
    time = np.arange(true.time[0], true.time[-1], 1 / 30)
    value = interpolate(true, time)
    kept = np.isfinite(value).all(axis=1) & (random.random(len(time)) > 0.01)
    noise = _noise(departure, value.shape, random)
    wander = departure.wander_s * np.sin(2 * np.pi * time / 20.0)
    arrival = time + departure.latency_s + wander + random.exponential(1.0, len(time)) * departure.jitter_s
    arrival += random.normal(0, 0.003, len(time))
    seen = value + noise
    spell = (time - time[0]) % _SPELL_EVERY_S > _SPELL_EVERY_S - _SPELL_S
    if departure.spell == "loss":
        kept &= ~spell
    elif departure.spell == "swap":
        seen[spell] += [400.0, -300.0, 100.0]
    elif departure.spell == "zeros":
        seen[spell] = 0.0
    elif departure.spell == "freeze":
        before = np.maximum.accumulate(np.where(spell | ~kept, 0, np.arange(len(time))))
        seen[spell] = seen[before[spell]]
    arrival, seen = np.maximum.accumulate(arrival[kept]), seen[kept]
    return Samples(arrival - SENSORS["tracker"].latency_s, arrival, seen)


def _noise(departure: Departure, shape: tuple[int, ...], random: np.random.Generator) -> FloatArray:
    sd = departure.noise_sd_mm
    if np.isfinite(departure.degrees):
        return np.asarray(sd * random.standard_t(departure.degrees, shape))
    white = random.normal(0, sd, shape)
    if departure.correlation_s == 0:
        return white
    kept = float(np.exp(-1 / 30 / departure.correlation_s))
    for row in range(1, len(white)):
        white[row] = kept * white[row - 1] + np.sqrt(1 - kept**2) * white[row]
    return white


def _imu(source: Source, departure: Departure, tracker: Samples) -> Samples:
    """Accelerations in the tracker's frame, as the pipeline makes them of a phone's readings."""
    from scipy.spatial.transform import Rotation

    kept = _thinned(source.time, departure.rate_hz)
    time, arrival = source.time[kept], source.arrival[kept]
    force = source.force_mm_s2[kept] * departure.scale + departure.bias_mm_s2 * np.array([0.8, -0.5, 0.33])
    tilt = np.radians(departure.mounting_deg) * np.array([0.6, -0.64, 0.48])
    force = Rotation.from_rotvec(tilt).apply(force)
    force = np.clip(force, -departure.clipped_g * G_MM_S2, departure.clipped_g * G_MM_S2)
    if departure.bits:
        step = 8 * G_MM_S2 / 2**departure.bits
        force = np.round(force / step) * step
    if departure.burst_s:
        arrival = np.ceil(arrival / departure.burst_s) * departure.burst_s
    stamps = time + departure.clock_s + departure.clock_ppm * 1e-6 * (time - time[0])
    gravity = source.gravity_mm_s2 * departure.gravity
    gyroscope = source.gyroscope_rad_s[kept] + np.radians(departure.gyroscope_deg_s) * np.array([0.6, 0.64, -0.48])
    logged = source.quaternion[kept]
    if departure.yaw_deg:
        up = -source.gravity_mm_s2 / np.linalg.norm(source.gravity_mm_s2)
        known = np.isfinite(logged).all(axis=1)
        about = Rotation.from_rotvec(np.radians(departure.yaw_deg) * up)
        logged = logged.copy()
        logged[known] = (about * Rotation.from_quat(logged[known])).as_quat()
    if departure.withheld:
        logged = np.full_like(logged, np.nan)
    return _aligned(stamps, arrival, force, gyroscope, logged, gravity, tracker)


def _aligned(
    time: FloatArray,
    arrival: FloatArray,
    force: FloatArray,
    gyroscope: FloatArray,
    logged: FloatArray,
    gravity: FloatArray,
    tracker: Samples,
) -> Samples:
    from pipeline.sessions.phone import Imu, aligned
    from pipeline.study.streams import AccelerationStream

    stream = AccelerationStream(
        topic="/imu", kind="acceleration", gravity_mm_s2=tuple(gravity), noise_sd_mm_s2=SENSORS["imu"].noise_sd
    )
    imu = Imu(time, arrival, force, gyroscope, SENSORS["imu"])
    return aligned(imu, logged, stream, (tracker, SENSORS["tracker"])).body.acceleration()


def _thinned(time: FloatArray, rate_hz: float) -> npt.NDArray[np.int64]:
    """Which readings are left of a phone that gives so many a second at the most."""
    if not np.isfinite(rate_hz):
        return np.arange(len(time), dtype=np.int64)
    wanted = np.arange(time[0], time[-1], 1 / rate_hz)
    found: npt.NDArray[np.int64] = np.unique(nearest(time, wanted))
    return found


def simulated(seconds: float = 40.0, seed: int = 0, swing: float = 1.0) -> Source:
    """A hand that reaches to and fro, turning the phone as it goes; a phone's bias, mounting and lever arm."""
    from scipy.spatial.transform import Rotation

    random = np.random.default_rng(seed)
    fine = np.arange(0, seconds, 1 / 900)
    place, turn = (_wandering(fine, random, scale) for scale in (150.0, 0.35 * swing))
    rotation = Rotation.from_rotvec(turn)
    step = fine[1] - fine[0]
    arm = rotation.apply(np.array([30.0, 40.0, -10.0]))
    acceleration = np.gradient(np.gradient(place - arm, step, axis=0), step, axis=0)
    gravity = np.array([0.0, 0.0, -G_MM_S2])
    at = slice(5, -5, 10)
    force = rotation[at].inv().apply(acceleration[at] - gravity)
    force = Rotation.from_rotvec([0.015, -0.01, 0.012]).apply(force) + np.array([120.0, -80.0, 60.0])
    force += random.normal(0, 100.0, force.shape)
    turning = np.concatenate([(rotation[:-1].inv() * rotation[1:]).as_rotvec() / step, np.zeros((1, 3))])
    time = fine[at]
    reference = Samples(fine[::9], fine[::9], place[::9])
    return Source("simulated", time, time + 0.002, force, turning[at], rotation[at].as_quat(), reference, gravity)


def _wandering(time: FloatArray, random: np.random.Generator, scale: float) -> FloatArray:
    """Minimum-jerk moves (Flash and Hogan 1985) between random places (n, 3), with rests, and a slow drift."""
    place, here, begin = np.empty((len(time), 3)), np.zeros(3), 0.0
    while begin < time[-1]:
        there, length, rest = random.normal(0, scale, 3), random.uniform(0.5, 1.2), random.uniform(0.0, 0.5)
        row = (time >= begin) & (time < begin + length + rest)
        u = np.clip((time[row] - begin) / length, 0.0, 1.0)
        place[row] = here + (there - here) * (10 * u**3 - 15 * u**4 + 6 * u**5)[:, None]
        here, begin = there, begin + length + rest
    return place
