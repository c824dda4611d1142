"""A log to arrays by the stock packages, message by message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from pipeline.sessions.logs.log import Content

KINDS: dict[str, Content] = {
    "/tracker/position": "position",
    "/reference/position": "position",
    "/phone/imu": "acceleration",
}


def stock_arrays(path: Path) -> dict[str, np.ndarray]:
    """Arrival, stamp (ns) and figures of each topic, by the stock reader and decoder, message by message."""
    rows: dict[str, list[list[float]]] = {topic: [] for topic in KINDS}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(topics=list(KINDS)):
            stamp = decoded.header.stamp.sec * 1_000_000_000 + decoded.header.stamp.nanosec
            if KINDS[channel.topic] == "position":
                point = decoded.point
                values = [point.x, point.y, point.z]
            else:
                force, rate, turn = decoded.linear_acceleration, decoded.angular_velocity, decoded.orientation
                values = [force.x, force.y, force.z, rate.x, rate.y, rate.z, turn.x, turn.y, turn.z, turn.w]
            rows[channel.topic].append([message.log_time, stamp, *values])
    return {topic: np.array(values) for topic, values in rows.items()}
