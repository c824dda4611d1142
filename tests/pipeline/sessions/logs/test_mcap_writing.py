"""What is written, byte by byte as the stock ROS 2 encoder writes it."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import serialize_dynamic

from pipeline.sessions.logs.mcap import Message
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.sessions.logs.mcap.writer import IMU, POINT_STAMPED, encoded

POSITION = serialize_dynamic(SCHEMAS["position"], POINT_STAMPED)[SCHEMAS["position"]]
PHONE = serialize_dynamic(SCHEMAS["acceleration"], IMU)[SCHEMAS["acceleration"]]
STAMPS_NS = st.integers(0, (2**31 - 1) * 10**9)
NUMBERS = st.floats(width=64)


def header(stamp_ns: int, frame_id: str) -> dict[str, object]:
    return {"stamp": {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}, "frame_id": frame_id}


def vector(values: list[float], names: str = "xyz") -> dict[str, float]:
    return dict(zip(names, values, strict=True))


@given(stamp_ns=STAMPS_NS, values=st.lists(NUMBERS, min_size=3, max_size=3))
def test_positions_are_what_the_stock_encoder_writes(stamp_ns: int, values: list[float]) -> None:
    ours = encoded(Message("/tracker", "position", stamp_ns, stamp_ns, np.array(values)))
    assert ours == POSITION({"header": header(stamp_ns, "tracker"), "point": vector(values)})


@given(
    stamp_ns=STAMPS_NS,
    values=st.lists(NUMBERS, min_size=6, max_size=6),
    turn=st.lists(st.floats(-1, 1), min_size=4, max_size=4) | st.just([np.nan] * 4),
)
def test_readings_of_the_phone_are_what_the_stock_encoder_writes(
    stamp_ns: int, values: list[float], turn: list[float]
) -> None:
    ours = encoded(Message("/phone", "acceleration", stamp_ns, stamp_ns, np.array([*values, *turn])))
    unknown = bool(np.isnan(turn[0]))
    stock = PHONE(
        {
            "header": header(stamp_ns, "phone"),
            "orientation": vector([0, 0, 0, 1] if unknown else turn, "xyzw"),
            "orientation_covariance": [-1.0 if unknown else 0.0] + [0.0] * 8,
            "angular_velocity": vector(values[3:6]),
            "angular_velocity_covariance": [0.0] * 9,
            "linear_acceleration": vector(values[0:3]),
            "linear_acceleration_covariance": [0.0] * 9,
        }
    )
    assert ours == stock
