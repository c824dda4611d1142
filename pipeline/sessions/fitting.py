"""Fits a study's parameters to its recordings: on the first part of each session; judged on the rest.

Judged by the likelihood of the rest's positions, which needs no reference: what makes them less likely than the values
of study.yaml do is not proposed, however well it fits the first part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fusion_core import Estimator, FusionKalman, Samples, Sensor, WindowGP
from fusion_core.accuracy import interpolate, rmse
from fusion_core.likelihood import Fitted, log_likelihood_by_replay, maximise, position_log_likelihood
from pipeline.errors import PipelineError
from pipeline.sessions.estimators import build_estimator, sensors
from pipeline.sessions.piecewise import arrived
from pipeline.sessions.recording import SETTLED_S, Recording
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study

_IMU_PRIOR = (
    0.7  # SD of the logarithm: a factor of two. A smooth motion alone does not determine an accelerometer's noise
)
_FREE = float("inf")
_FARTHEST = 100.0  # times what is stated, or a hundredth of it


@dataclass(frozen=True)
class Parameter:
    """One fitted parameter: its section and key in study.yaml, the value stated there, and the fitted one.

    `gain` is by how much the log likelihood of the rest's positions rises with the fitted values of this section's
    parameters together; None where no session goes on after the fitted part.
    """

    where: str
    key: str
    stated: float
    fitted: Fitted
    gain: float | None = None

    @property
    def at_bound(self) -> bool:
        """Whether the search ran away from the stated value, which only shows that the model does not fit the data."""
        farthest = _FARTHEST if self.where.startswith("streams.") else _FARTHEST**2  # variances among them
        return not 1 / farthest < self.fitted.value / self.stated < farthest

    @property
    def worse(self) -> bool:
        """Whether it does worse than the stated value on the part that was not fitted."""
        return self.gain is not None and self.gain < 0

    @property
    def usable(self) -> bool:
        """Whether the data determine it, the search did not run away, and it holds on the rest."""
        return self.fitted.identified and not self.at_bound and not self.worse


@dataclass(frozen=True)
class Score:
    """An estimator on the part that was not fitted: RMSE in mm as set and as fitted; None without a reference."""

    session: str
    estimator: str
    stated_rmse_mm: float
    fitted_rmse_mm: float


@dataclass(frozen=True)
class Fit:
    """Parameters, scores, and by phone gravity (3,) in mm/s² with the half widths of its interval.

    `apart` has the sensors' parameters by session, each fitted to that session alone.
    """

    parameters: tuple[Parameter, ...]
    apart: Mapping[str, tuple[Parameter, ...]]
    scores: tuple[Score, ...]
    gravity_mm_s2: Mapping[str, tuple[FloatArray, FloatArray]]


def fit(
    study: Study,
    recordings: Mapping[str, Recording],
    first_s: float,
    begin: Callable[[int], None] = lambda total: None,
    done: Callable[[], None] = lambda: None,
) -> Fit:
    """Noise and latency of the sensors, then the parameters of every fusion_kalman and window_gp of the study.

    `begin` is called with the number of steps, which are the sensors, each session's sensors apart, each estimator and
    each session's score; `done` after each. Raises PipelineError where there is nothing to fit.
    """
    if study.tracker is None:
        raise PipelineError("study.yaml: streams: fitting needs a stream of kind position")
    parts, rests = _cut(study, recordings, first_s)
    if not parts:
        raise PipelineError(f"no session has positions in its first {first_s:g} s")
    begin(1 + len(parts) + len(study.estimators) + len(recordings))
    fitted = _sensors(study, list(parts.values()), list(rests.values()))
    done()
    apart = {}
    for session, part in parts.items():
        apart[session] = tuple(_sensors(study, [part], []))
        done()
    known = _with(sensors(study), fitted)
    latency = next((p.fitted.value for p in fitted if p.key == "latency_s" and not p.at_bound and not p.worse), None)
    shifted, later = ([_late(study, one, latency) for one in cut.values()] for cut in (parts, rests))
    estimators: dict[str, Estimator] = {}
    for name in study.estimators:
        stated = build_estimator(study, name)
        used = {key: known[key] for key in stated.sensors}
        rows, estimators[name] = _estimator(name, stated, used, shifted, later)
        fitted += rows
        done()
    scores = []
    for session, loaded in recordings.items():
        times = loaded.times[loaded.times >= _begin(study, loaded) + first_s + SETTLED_S]
        scores += _scores(study, session, loaded, estimators, times, _late(study, loaded.samples, latency))
        done()
    return Fit(tuple(fitted), apart, tuple(scores), _gravity(recordings, first_s))


_Part = Mapping[str, Samples]


def _cut(
    study: Study, recordings: Mapping[str, Recording], first_s: float
) -> tuple[dict[str, _Part], dict[str, _Part]]:
    """The first part of each session, and the rest; sessions without positions in it are left out."""
    parts: dict[str, _Part] = {}
    rests: dict[str, _Part] = {}
    for session, loaded in recordings.items():
        until = _begin(study, loaded) + first_s
        part, rest = _part(loaded.samples, -np.inf, until), _part(loaded.samples, until, np.inf)
        if len(part[study.tracker or ""]):
            parts[session] = part
        if len(rest[study.tracker or ""]) > 1:
            rests[session] = rest
    return parts, rests


def _begin(study: Study, loaded: Recording) -> float:
    frames = loaded.samples[study.tracker or ""]
    return float(frames.arrival[0]) if len(frames) else 0.0


def _part(samples: Mapping[str, Samples], since: float, until: float) -> _Part:
    return {name: arrived(stream, since, until) for name, stream in samples.items()}


def _late(study: Study, samples: Mapping[str, Samples], latency_s: float | None) -> dict[str, Samples]:
    """The samples with the tracker's times of measurement shifted to a latency of `latency_s`; None: as stated."""
    shifted, name = dict(samples), study.tracker or ""
    if latency_s is not None:
        by = latency_s - study.sensor_streams[name].latency_s
        shifted[name] = replace(shifted[name], time=shifted[name].time - by)
    return shifted


def _sensors(study: Study, parts: Sequence[_Part], rests: Sequence[_Part]) -> list[Parameter]:
    """Latency and noise of the tracker, noise of the accelerometer, by the fusion filter with all its own free."""
    tracker, imu = study.tracker or "", study.stream_of_kind("acceleration")
    stated, plain = sensors(study), _plain(study)
    wanted = [(f"streams.{tracker}", "noise_sd_mm", stated[tracker].noise_sd, _FREE)]
    if imu is not None:
        wanted.append((f"streams.{imu}", "noise_sd_mm_s2", stated[imu].noise_sd, _IMU_PRIOR))
        if stated[tracker].latency_s > 0:
            wanted.append((f"streams.{tracker}", "latency_s", stated[tracker].latency_s, _FREE))
    own = [plain.jerk_psd_mm2_s5, plain.bias_walk_mm_s2_per_sqrt_s]

    def blocks(values: FloatArray, stretches: Sequence[_Part] = parts) -> FloatArray:
        changed = dict(stated)
        changed[tracker] = replace(stated[tracker], noise_sd=float(values[0]))
        if imu is not None:
            changed[imu] = replace(stated[imu], noise_sd=float(values[1]))
        latency = float(values[2]) if len(wanted) > 2 else None
        used = {name: changed[name] for name in plain.sensors}
        filter_ = replace(plain, sensors=used, jerk_psd_mm2_s5=float(values[-2]), bias_walk_mm_s2_per_sqrt_s=values[-1])
        return np.concatenate([position_log_likelihood(filter_, _late(study, one, latency)) for one in stretches])

    start = [row[2] for row in wanted] + own
    fitted = maximise(blocks, start, [row[3] for row in wanted] + [_FREE, _FREE])
    gain = _gain(blocks, start, fitted, rests)
    return [
        Parameter(where, key, value, fit, gain) for (where, key, value, _), fit in zip(wanted, fitted, strict=False)
    ]


def _gain(
    blocks: Callable[[FloatArray, Sequence[_Part]], FloatArray],
    stated: Sequence[float],
    fitted: Sequence[Fitted],
    rests: Sequence[_Part],
) -> float | None:
    """By how much fitted values make the rest likelier than the stated ones; None without a rest."""
    if not rests:
        return None
    better, as_stated = (np.sum(blocks(np.array(values), rests)) for values in ([fit.value for fit in fitted], stated))
    return float(better - as_stated)


def _plain(study: Study) -> FusionKalman:
    """The study's first fusion_kalman, or a default one, without gate and adaptation: a likelihood needs one model."""
    used = {n: s for n, s in sensors(study).items() if not any(term.at_s for term in s.terms)}
    built = (build_estimator(study, name) for name in study.estimators)
    first = next((estimator for estimator in built if isinstance(estimator, FusionKalman)), FusionKalman(used))
    return replace(first, gate_sd=0.0, adaptation=0.0, path="event_time", prior="wiener")


def _with(stated: Mapping[str, Sensor], fitted: Sequence[Parameter]) -> dict[str, Sensor]:
    """The sensors with their fitted noise."""
    with_fitted = dict(stated)
    for row in fitted:
        name = row.where.removeprefix("streams.")
        if row.key.startswith("noise") and row.usable:
            with_fitted[name] = replace(with_fitted[name], noise_sd=row.fitted.value)
    return with_fitted


def _estimator(
    name: str, stated: Estimator, used: dict[str, Sensor], parts: Sequence[_Part], rests: Sequence[_Part]
) -> tuple[list[Parameter], Estimator]:
    """The fitted parameters of one estimator, and the estimator with those that the data determine."""
    where = f"estimators.{name}"
    if isinstance(stated, FusionKalman) and stated.prior == "wiener":
        plain = replace(stated, sensors=used, gate_sd=0.0, adaptation=0.0, path="event_time")
        keys = ["jerk_psd_mm2_s5", "bias_walk_mm_s2_per_sqrt_s"]
        score: Any = position_log_likelihood
    elif isinstance(stated, WindowGP):
        plain, score = replace(stated, sensors=used), log_likelihood_by_replay  # type: ignore[assignment]
        keys = ["signal_variance_mm2", "inverse_scale_s2"]
    else:
        return [], stated
    start = [float(getattr(stated, key)) for key in keys]

    def blocks(values: FloatArray, stretches: Sequence[_Part] = parts) -> FloatArray:
        tried = replace(plain, **dict(zip(keys, map(float, values), strict=True)))  # type: ignore[arg-type]
        return np.concatenate([score(tried, one) for one in stretches])

    fitted = maximise(blocks, start, [_FREE] * len(keys))
    gain = _gain(blocks, start, fitted, rests)
    rows = [Parameter(where, key, value, fit, gain) for key, value, fit in zip(keys, start, fitted, strict=True)]
    identified = {row.key: row.fitted.value for row in rows if row.usable}
    return rows, replace(stated, sensors=used, **identified)  # type: ignore[arg-type]


def _scores(
    study: Study,
    session: str,
    loaded: Recording,
    estimators: Mapping[str, Estimator],
    times: FloatArray,
    samples: Mapping[str, Samples],
) -> list[Score]:
    """Each estimator's RMSE as stated and as fitted, at `times` after the fitted part; with the fitted latency."""
    if loaded.reference is None:
        return []
    truth = interpolate(loaded.reference, times)
    known = np.isfinite(truth).all(axis=1)
    rows = []
    for name, better in estimators.items():
        stated = build_estimator(study, name).replay(loaded.samples, times).mean
        fitted = better.replay(samples, times).mean
        on = known & np.isfinite(stated).all(axis=1) & np.isfinite(fitted).all(axis=1)
        if on.any():
            rows.append(Score(session, name, rmse(stated[on], truth[on]), rmse(fitted[on], truth[on])))
    return rows


def _gravity(recordings: Mapping[str, Recording], first_s: float) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Gravity by phone: minus the mean specific force in the tracker's frame, as a hand's mean acceleration is zero."""
    means: dict[str, list[FloatArray]] = {}
    for loaded in recordings.values():
        for name, phone in loaded.phones.items():
            body = phone.body
            early = body.time < (body.time[0] if len(body.time) else 0.0) + first_s
            turned = np.einsum("nij,nj->ni", body.rotation[early], body.force_mm_s2[early])
            blocks = ((body.time[early] - body.time[:1]) // 5.0).astype(int) if early.any() else np.empty(0, int)
            means.setdefault(name, []).extend(-turned[blocks == block].mean(axis=0) for block in np.unique(blocks))
    return {
        name: (np.mean(rows, axis=0), 1.96 * np.std(rows, axis=0, ddof=1) / np.sqrt(len(rows)))
        for name, rows in means.items()
        if len(rows) > 1
    }
