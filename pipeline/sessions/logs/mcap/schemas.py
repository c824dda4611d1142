"""Which message types hold what."""

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
    """What a type holds, by the encoding of its messages and its name; None where it is not one of ours."""
    if encoding == "cdr":
        return next((content for content in SAMPLED if SCHEMAS[content] == schema), None)
    content = _CONTENTS.get(re.split("[./]", schema)[-1])
    ours = (
        encoding == "json" and schema == "steadyhand.Event" if content == "events" else encoding in ("json", "protobuf")
    )
    return content if ours else None
