"""What a stream reads of ROS messages in JSON, as rosbridge writes them, those of ROS 1 and of ROS 2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.live.adapters.feeds import Feed, figures_of, orientation, three
from pipeline.live.messages import Datagram, MessageError, number

_POSITIONS: Mapping[str, tuple[str, ...]] = {
    "geometry_msgs/PointStamped": ("point",),
    "geometry_msgs/PoseStamped": ("pose", "position"),
    "geometry_msgs/TransformStamped": ("transform", "translation"),
}
"""The types of positions, and where each has it."""
_IMU = "sensor_msgs/Imu"
_SECONDS, _NANOSECONDS = ("sec", "secs"), ("nanosec", "nsec", "nsecs")


def ros_name(of_type: str) -> str:
    """A type by the name that ROS 1 has for it, which ROS 2 takes too."""
    return of_type.replace("/msg/", "/")


def types_of(content: str) -> tuple[str, ...]:
    """The types that hold it."""
    return tuple(_POSITIONS) if content == "position" else (_IMU,)


def figures(feed: Feed, of_type: str, message: object) -> Datagram:
    """What a stream reads of a message, a ROS message as an object. Raises MessageError where it is not there."""
    if of_type in _POSITIONS:
        return figures_of(feed.stream, three(_vector(message, *_POSITIONS[of_type])), None)
    unknown = [_is_disclaimed(message, name) for name in ("linear_acceleration", "angular_velocity", "orientation")]
    if unknown[0]:
        raise MessageError("it has no acceleration")
    force, turning = three(_vector(message, "linear_acceleration")), three(_vector(message, "angular_velocity"))
    turned = None if unknown[2] else orientation(_vector(message, "orientation", axes="xyzw"))
    return figures_of(feed.stream, None, (force, turning), turned)


def _at(message: object, *path: str) -> Any:
    for name in path:
        if not isinstance(message, dict) or name not in message:
            raise MessageError(f"it has no {name}")
        message = message[name]
    return message


def _vector(message: object, *path: str, axes: str = "xyz") -> tuple[float, ...]:
    vector = _at(message, *path)
    return tuple(number(_at(vector, axis), axis) for axis in axes)


def _is_disclaimed(message: object, name: str) -> bool:
    """Whether the first element of a covariance is −1: the sensor does not measure that (sensor_msgs/Imu)."""
    covariance = message.get(f"{name}_covariance") if isinstance(message, dict) else None
    return isinstance(covariance, list) and bool(covariance) and covariance[0] == -1


def stamp_ms(message: object) -> float | None:
    """The header's stamp; None where it is zero, as of a sender that does not stamp."""
    stamp = _at(message, "header", "stamp")
    whole, part = (
        next((number(_at(stamp, name), name, 2.0**32) for name in names if name in stamp), None)
        if isinstance(stamp, dict)
        else None
        for names in (_SECONDS, _NANOSECONDS)
    )
    if whole is None or part is None or whole < 0 or not 0 <= part < 1e9:
        raise MessageError("its stamp is none")
    return whole * 1e3 + part * 1e-6 if whole or part else None
