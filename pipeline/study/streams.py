"""The kinds of sensor streams in study.yaml, and the keys that each takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.study.fields import Axes, Finite, Frozen, Positive, Seconds, Vector

FieldName = Literal["position", "velocity", "acceleration", "angular_velocity", "orientation", "stamp"]
_PATHS: Mapping[str, tuple[int, ...]] = {
    **dict.fromkeys(("position", "velocity", "acceleration", "angular_velocity"), (1, 3)),
    "orientation": (1, 4),
    "stamp": (1, 2),
}
"""How many paths each takes: one of a whole vector, or one for each of its figures (an orientation: x, y, z, w)."""

Length = Literal["m", "cm", "mm", "in"]
PathText = Annotated[str, Field(min_length=1)]


class _Stream(Frozen):
    """What a stream reads of its topic.

    `stamp: log_time` is for senders that do not stamp: a reading was measured `latency_s` before it arrived.
    `arrival: stamps` is for logs whose times of arrival are of another clock: a reading arrived when it was stamped.
    `fields` says where a message, or a table of numbers, holds what stands elsewhere than usual.
    """

    topic: str
    stamp: Literal["arrival", "measurement", "log_time"] = "measurement"
    latency_s: Seconds = 0.0
    arrival: Literal["log", "stamps"] = "log"
    stamp_unit: Literal["s", "ms", "us", "ns"] | None = None
    child: PathText | None = None
    parent: PathText | None = None
    fields: Mapping[FieldName, PathText | tuple[PathText, ...]] = {}

    @model_validator(mode="after")
    def _fields_fit(self) -> _Stream:
        for name, paths in self.fields.items():
            if not isinstance(paths, str) and len(paths) not in _PATHS[name]:
                counts = " or ".join(map(str, _PATHS[name]))
                raise ValueError(f"fields: {name} needs {counts} paths, and {len(paths)} are given")
        if self.stamp == "log_time" and self.arrival == "stamps":
            raise ValueError("stamp: log_time and arrival: stamps each take the one for the other; keep one")
        return self

    @property
    def stamped_on_arrival(self) -> bool:
        """Whether a reading was measured `latency_s` before its stamp."""
        return self.stamp != "measurement"


class _Sensor(_Stream):
    rate_hz: Positive | None = None


class PositionStream(_Sensor):
    """A tracker. `stamp: arrival` says that it stamps on delivery: measured at stamp − latency_s."""

    kind: Literal["position"]
    unit: Length = "m"
    noise_sd_mm: Positive = 8.0
    axes: Axes | None = None


class VelocityStream(_Sensor):
    """A sensor of the hand's velocity, such as optical flow."""

    kind: Literal["velocity"]
    unit: Literal["m/s", "cm/s", "mm/s"] = "m/s"
    noise_sd_mm_s: Positive
    axes: Axes | None = None


class OperatorTerm(Frozen):
    """`weight` times a derivative of the position, `at_s` after the reading's own time."""

    weight: Finite
    derivative: Annotated[int, Field(ge=0, le=2)] = 0
    at_s: Finite = 0.0


class LinearStream(_Sensor):
    """A sensor of a sum of terms: an operator of the user's own."""

    kind: Literal["linear"]
    unit: Length = "m"
    noise_sd: Positive
    operator: Annotated[tuple[OperatorTerm, ...], Field(min_length=1)]
    axes: Axes | None = None


class AccelerationStream(_Sensor):
    """A phone's IMU: body-frame specific force, turned into the tracker frame by its orientation.

    How it is mounted is given (`mounting_xyzw`, `lever_arm_mm`), or learned from each session's first `calibrate_s`.
    """

    kind: Literal["acceleration"]
    unit: Literal["m/s2", "mm/s2", "g", "-g"] = "m/s2"  # -g: of which at rest the part downwards is positive, as in iOS
    turning_unit: Literal["rad/s", "deg/s"] = "rad/s"
    gravity_mm_s2: Vector
    noise_sd_mm_s2: Positive = 100.0
    mounting_xyzw: tuple[Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 1.0)
    lever_arm_mm: Vector = (0.0, 0.0, 0.0)
    calibrate_s: Seconds = 0.0

    @model_validator(mode="after")
    def _one_way(self) -> AccelerationStream:
        if not sum(part**2 for part in self.mounting_xyzw) > 0:
            raise ValueError("mounting_xyzw is all zeros; no rotation is [0, 0, 0, 1]")
        if not sum(part**2 for part in self.gravity_mm_s2) > 0:
            raise ValueError("gravity_mm_s2 is all zeros; at rest it is some 9807 mm/s² downwards")
        given = any(self.mounting_xyzw[:3]) or any(self.lever_arm_mm)
        if self.calibrate_s and given:
            raise ValueError("gives mounting_xyzw or lever_arm_mm, and calibrate_s to learn them; keep one")
        return self


class ReferenceStream(_Stream):
    """Ground truth, brought into the tracker's frame by a rotation and a translation."""

    kind: Literal["reference"]
    unit: Length = "m"
    rotation_xyzw: tuple[Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 1.0)
    translation_mm: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _turns(self) -> ReferenceStream:
        if not sum(part**2 for part in self.rotation_xyzw) > 0:
            raise ValueError("rotation_xyzw is all zeros; no rotation is [0, 0, 0, 1]")
        return self


class DisplayStream(_Stream):
    """What the participant saw."""

    kind: Literal["display"]
    unit: Length = "m"


Sensing = PositionStream | VelocityStream | LinearStream | AccelerationStream


Stream = Annotated[
    PositionStream | VelocityStream | LinearStream | AccelerationStream | ReferenceStream | DisplayStream,
    Field(discriminator="kind"),
]
