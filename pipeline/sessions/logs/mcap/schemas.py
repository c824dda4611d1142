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

SAMPLED: tuple[Content, ...] = ("position", "acceleration")
"""Contents that come at a steady rate."""

_CONTENTS: Mapping[str, Content] = {
    "PointStamped": "position",
    "Point3InFrame": "position",
    "PoseInFrame": "position",
    "Imu": "acceleration",
    "Event": "events",
}


def content_of(encoding: str, schema: str) -> Content | None:
    """The content of a message type, by encoding and name; None for a type that is not read."""
    if encoding == "cdr":
        return next((content for content in SAMPLED if SCHEMAS[content] == schema), None)
    content = _CONTENTS.get(re.split("[./]", schema)[-1])
    is_read = (
        encoding == "json" and schema == "steadyhand.Event" if content == "events" else encoding in ("json", "protobuf")
    )
    return content if is_read else None
