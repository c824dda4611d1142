"""The ROS 2 message types of a content, by their full names."""

from __future__ import annotations

from collections.abc import Mapping

SCHEMAS: Mapping[str, str] = {
    "position": "geometry_msgs/msg/PointStamped",
    "acceleration": "sensor_msgs/msg/Imu",
}
