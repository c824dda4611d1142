"""The message types that Steadyhand reads, and the content of each."""

from __future__ import annotations

import re
from collections.abc import Mapping

from pipeline.sessions.logs.log import Content

SCHEMAS: Mapping[str, str] = {
    "position": "geometry_msgs/msg/PointStamped",
    "acceleration": "sensor_msgs/msg/Imu",
}
"""The ROS 2 type of a content, by its full name."""

SAMPLED: tuple[Content, ...] = ("position", "velocity", "acceleration")
"""Contents that come at a steady rate."""

_ROS: Mapping[str, Content] = {
    "geometry_msgs/PointStamped": "position",
    "geometry_msgs/PoseStamped": "position",
    "geometry_msgs/PoseWithCovarianceStamped": "position",
    "geometry_msgs/TransformStamped": "position",
    "tf2_msgs/TFMessage": "position",
    "nav_msgs/Odometry": "position",
    "geometry_msgs/TwistStamped": "velocity",
    "geometry_msgs/AccelStamped": "acceleration",
    "sensor_msgs/Imu": "acceleration",
}
_BY_LAST_NAME: Mapping[str, Content] = {
    "PointStamped": "position",
    "Point3InFrame": "position",
    "PoseInFrame": "position",
    "PoseStamped": "position",
    "FrameTransform": "position",
    "FrameTransforms": "position",
    "Imu": "acceleration",
    "Event": "events",
}
_ROS_ENCODINGS = ("cdr", "ros1")


def content_of(encoding: str, schema: str) -> Content | None:
    """The content of a message type, by encoding and name; None for a type that does not say it, or is not read."""
    parts = re.split("[./]", schema)
    if encoding in _ROS_ENCODINGS and f"{parts[0]}/{parts[-1]}" in _ROS:
        return _ROS[f"{parts[0]}/{parts[-1]}"]
    content = _BY_LAST_NAME.get(parts[-1])
    if content == "events":
        return content if encoding == "json" and schema == "steadyhand.Event" else None
    is_foxglove = parts[0] in ("foxglove", "foxglove_msgs")
    is_read = encoding in ("json", "protobuf", "flatbuffer") or (is_foxglove and encoding == "cdr")
    return content if is_read else None
