"""study.yaml's streams as sensors, and its estimators built from them."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from fusion_core import ESTIMATORS, Estimator, Sensor, Term
from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.settings import Study
from pipeline.study.streams import AccelerationStream, LinearStream, PositionStream, Sensing


def sensor(study: Study, stream: Sensing) -> Sensor:
    """A stream's sensor, of the analysed axes."""
    axes = None if isinstance(stream, AccelerationStream) else stream.axes
    seen = None if axes is None else tuple(study.axes.index(axis) for axis in axes)
    dimension = len(study.axes) if seen is None else len(seen)
    operator: str | tuple[Term, ...] = stream.kind
    if isinstance(stream, PositionStream):
        noise_sd = stream.noise_sd_mm
    elif isinstance(stream, AccelerationStream):
        noise_sd = stream.noise_sd_mm_s2
    elif isinstance(stream, LinearStream):
        noise_sd = stream.noise_sd
        operator = tuple(Term(term.weight, term.derivative, term.at_s) for term in stream.operator)
    else:
        noise_sd = stream.noise_sd_mm_s
    return Sensor(operator, noise_sd, stream.latency_s, dimension, stream.rate_hz, seen)


def sensors(study: Study) -> dict[str, Sensor]:
    """The study's sensors by stream name, of the analysed axes."""
    return {name: sensor(study, stream) for name, stream in study.sensor_streams.items()}


def of_space(of_axes: Sensor) -> Sensor:
    """The same sensor with all three axes."""
    return Sensor(of_axes.operator, of_axes.noise_sd, of_axes.latency_s, 3, of_axes.rate_hz)


_POSITIONS_ONLY = ("raw", "one_euro", "holt", "position_kalman")  # whatever sensors there are


def fusing(study: Study) -> dict[str, str]:
    """The estimators that use accelerations, and the stream that each has them from."""
    found = {}
    for name, settings in study.estimators.items():
        streams = [one for one, stream in study.sensor_streams.items() if isinstance(stream, AccelerationStream)]
        used = [one for one in streams if settings.use is None or one in settings.use]
        if used and settings.type not in _POSITIONS_ONLY:
            found[name] = used[0]
    return found


def sensors_used(study: Study, name: str) -> frozenset[str]:
    """The streams whose readings change what an estimator shows."""
    settings = study.estimators[name]
    named = [one for one in study.sensor_streams if settings.use is None or one in settings.use]
    if settings.type not in _POSITIONS_ONLY:
        return frozenset(named)
    trackers = (one for one in named if study.sensor_streams[one].kind == "position")
    return frozenset(list(trackers)[:1])


def build_estimator(study: Study, name: str, where: str | None = None) -> Estimator:
    """The study's estimator of that name. Raises PipelineError, saying which key or value is wrong.

    `where` names the place of its settings, if that is not study.yaml.
    """
    settings = study.estimators[name]
    where = where or f"study.yaml: estimators.{name}"
    if settings.type not in ESTIMATORS:
        raise PipelineError(f'{where}: type "{settings.type}" is not known{did_you_mean(settings.type, ESTIMATORS)}')
    kind = ESTIMATORS[settings.type]
    types = {field.name: field.type for field in fields(kind) if field.name != "sensors"}
    used = {n: s for n, s in sensors(study).items() if settings.use is None or n in settings.use}
    parameters = {}
    for key, value in settings.parameters.items():
        if key not in types:
            raise PipelineError(f'{where}: unknown key "{key}"{did_you_mean(key, types)}')
        parameters[key] = _converted(kind, key, value, where)
    try:
        return kind(used, **parameters)
    except ValueError as error:
        raise PipelineError(f"{where}: {error}") from None


@cache
def _adapters(kind: type) -> dict[str, TypeAdapter[Any]]:
    """For each parameter, what turns a value of study.yaml into the type in the estimator's dataclass."""
    from typing import get_type_hints

    strict = ConfigDict(allow_inf_nan=False)
    hints = get_type_hints(kind)
    return {
        field.name: TypeAdapter(hints[field.name], config=strict) for field in fields(kind) if field.name != "sensors"
    }


def _converted(kind: type, key: str, value: Any, where: str) -> Any:
    if isinstance(value, bool):
        raise PipelineError(f'{where}: "{key}": should not be {str(value).lower()}')
    try:
        return _adapters(kind)[key].validate_python(value)
    except ValidationError as error:
        fault = error.errors()[0]["msg"]
        raise PipelineError(f'{where}: "{key}": {fault[0].lower()}{fault[1:]} (found {value!r})') from None
