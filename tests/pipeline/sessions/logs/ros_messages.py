"""ROS messages as the package `rosbags` serialises them, independent of ours, in logs of the stock MCAP writer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

ROS2 = get_typestore(Stores.ROS2_HUMBLE)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))

POSITIONS = (
    "geometry_msgs/msg/PointStamped",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    "geometry_msgs/msg/Vector3Stamped",
    "nav_msgs/msg/Odometry",
    "tf2_msgs/msg/TFMessage",
)


class Maker:
    """Makes messages of one ROS version."""

    def __init__(self, store: Typestore) -> None:
        self.store, self.is_ros1 = store, store is ROS1

    def make(self, name: str, /, **fields: Any) -> Any:
        return self.store.types[name](**fields)

    def header(self, stamp_ns: int, frame: str) -> Any:
        seconds, nanoseconds = divmod(stamp_ns, 10**9)
        stamp = self.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        seq = {"seq": 7} if self.is_ros1 else {}
        return self.make("std_msgs/msg/Header", **seq, stamp=stamp, frame_id=frame)

    def vector(self, name: str, values: Sequence[float]) -> Any:
        axes = dict(zip("xyzw", map(float, values), strict=False))
        return self.make(f"geometry_msgs/msg/{name}", **axes)

    def pose(self, place: Sequence[float], turn: Sequence[float] = (0, 0, 0, 1)) -> Any:
        parts = {"position": self.vector("Point", place), "orientation": self.vector("Quaternion", turn)}
        return self.make("geometry_msgs/msg/Pose", **parts)

    def transform(self, stamp_ns: int, parent: str, child: str, place: Sequence[float]) -> Any:
        parts = {"translation": self.vector("Vector3", place), "rotation": self.vector("Quaternion", (0, 0, 0, 1))}
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            transform=self.make("geometry_msgs/msg/Transform", **parts),
        )

    def twist(self, linear: Sequence[float], angular: Sequence[float] = (9, 8, 7)) -> Any:
        parts = {"linear": self.vector("Vector3", linear), "angular": self.vector("Vector3", angular)}
        return self.make("geometry_msgs/msg/Twist", **parts)

    def position(  # noqa: PLR0911
        self, name: str, stamp_ns: int, place: Sequence[float], frame: str = "room", child: str = "hand"
    ) -> Any:
        """A message of one of `POSITIONS` at a place; its other figures are none of the place's."""
        header, last = self.header(stamp_ns, frame), name.rsplit("/", maxsplit=1)[-1]
        covariance = np.arange(36.0) + 100
        if last == "TFMessage":
            return self.make(name, transforms=[self.transform(stamp_ns, frame, child, place)])
        if last == "TransformStamped":
            return self.transform(stamp_ns, frame, child, place)
        if last == "PointStamped":
            return self.make(name, header=header, point=self.vector("Point", place))
        if last == "Vector3Stamped":
            return self.make(name, header=header, vector=self.vector("Vector3", place))
        if last == "PoseStamped":
            return self.make(name, header=header, pose=self.pose(place))
        pose = self.make("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(place), covariance=covariance)
        if last == "PoseWithCovarianceStamped":
            return self.make(name, header=header, pose=pose)
        twist = self.make("geometry_msgs/msg/TwistWithCovariance", twist=self.twist((3, 2, 1)), covariance=covariance)
        return self.make(name, header=header, child_frame_id=child, pose=pose, twist=twist)

    def imu(self, stamp_ns: int, force: Sequence[float], rate: Sequence[float], turn: Sequence[float]) -> Any:
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(stamp_ns, "phone"),
            orientation=self.vector("Quaternion", turn),
            orientation_covariance=np.zeros(9),
            angular_velocity=self.vector("Vector3", rate),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector("Vector3", force),
            linear_acceleration_covariance=np.zeros(9),
        )

    def bytes_of(self, message: Any) -> bytes:
        name = message.__msgtype__
        return bytes(
            self.store.serialize_ros1(message, name) if self.is_ros1 else self.store.serialize_cdr(message, name)
        )

    def definition(self, name: str) -> str:
        return self.store.generate_msgdef(name, ros_version=1 if self.is_ros1 else 2)[0]


IN_ROS2, IN_ROS1 = Maker(ROS2), Maker(ROS1)


def write_payloads(
    path: Path, name: str, payloads: Iterable[bytes], definition: str, maker: Maker = IN_ROS2, step_ns: int = 1000
) -> Path:
    """A log with payloads of one type on /t, received at 0, `step_ns`, …"""
    encodings = ("ros1msg", "ros1") if maker.is_ros1 else ("ros2msg", "cdr")
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(name, encodings[0] if definition else "", definition.encode())
        channel = writer.register_channel("/t", encodings[1], schema)
        for index, payload in enumerate(payloads):
            writer.add_message(channel, index * step_ns, payload, index * step_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def write_messages(path: Path, messages: Sequence[Any], maker: Maker = IN_ROS2) -> Path:
    """A log with messages of one type on /t."""
    name = messages[0].__msgtype__
    written = name.replace("/msg/", "/") if maker.is_ros1 else name
    return write_payloads(path, written, map(maker.bytes_of, messages), maker.definition(name), maker)
