"""Servers of readings that tests run: as much of rosbridge and of Foxglove's protocol as two topics need."""

from __future__ import annotations

import asyncio
import json
import struct
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from pipeline.sessions.logs.mcap import Message
from pipeline.sessions.logs.mcap.writer import IMU as IMU_SCHEMA
from pipeline.sessions.logs.mcap.writer import POINT_STAMPED, encoded

POSITION, IMU = "/hand", "/phone"
PLACE_M = (-0.1, 0.5, 1.2)
FORCE_M_S2 = (0.0, 9.80665, 0.0)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
Serve = Callable[[ServerConnection], Any]


def stamp(time_ns: int) -> dict[str, Any]:
    """A header of ROS 2 in JSON."""
    return {"stamp": {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}, "frame_id": "world"}


def xyz(figures: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyzw", figures, strict=False))


def published(topic: str, message: dict[str, Any]) -> str:
    """What rosbridge sends of a topic."""
    return json.dumps({"op": "publish", "topic": topic, "msg": message})


def point_stamped(time_ns: int, place_m: Sequence[float] = PLACE_M) -> dict[str, Any]:
    return {"header": stamp(time_ns), "point": xyz(place_m)}


def imu(time_ns: int, **changes: Any) -> dict[str, Any]:
    zero = [0.0] * 9
    return {
        "header": stamp(time_ns),
        "orientation": xyz(UPRIGHT),
        "orientation_covariance": zero,
        "angular_velocity": xyz((0.0, 0.0, 0.0)),
        "angular_velocity_covariance": zero,
        "linear_acceleration": xyz(FORCE_M_S2),
        "linear_acceleration_covariance": zero,
        **changes,
    }


def data(payload: bytes, subscription: int = 1) -> bytes:
    """What a server of Foxglove's protocol sends of a subscription."""
    return struct.pack("<BIQ", 1, subscription, 5) + payload


def advertised(*channels: dict[str, Any]) -> str:
    return json.dumps({"op": "advertise", "channels": list(channels)})


CDR = {"encoding": "cdr", "schemaEncoding": "ros2msg"}
CDR_POSITION = {"topic": POSITION, **CDR, "schemaName": "geometry_msgs/msg/PointStamped", "schema": POINT_STAMPED}
CDR_IMU = {"topic": IMU, **CDR, "schemaName": "sensor_msgs/msg/Imu", "schema": IMU_SCHEMA}


def cdr(topic: str, time_ns: int) -> bytes:
    """A reading of either topic in CDR."""
    import numpy as np

    values = PLACE_M if topic == POSITION else (*FORCE_M_S2, 0.0, 0.0, 0.0, *UPRIGHT)
    return encoded(Message(topic, "position" if topic == POSITION else "acceleration", time_ns, 0, np.array(values)))


async def _steadily(topic: str, send: Callable[[int], Any]) -> None:
    with suppress(ConnectionClosed):
        while True:
            await send(time.time_ns())
            await asyncio.sleep(0.01 if topic == POSITION else 0.004)


async def rosbridge(socket: ServerConnection) -> None:
    """Serve whoever subscribes."""
    topic = json.loads(await socket.recv())["topic"]
    made = point_stamped if topic == POSITION else imu
    await _steadily(topic, lambda at: socket.send(published(topic, made(at))))


async def foxglove(socket: ServerConnection) -> None:
    """Advertise both topics, and serve whoever subscribes to one."""
    await socket.send(json.dumps({"op": "serverInfo", "name": "a test", "capabilities": []}))
    await socket.send(advertised({"id": 7, **CDR_POSITION}, {"id": 8, **CDR_IMU}))
    wanted = json.loads(await socket.recv())["subscriptions"][0]
    topic = {7: POSITION, 8: IMU}[wanted["channelId"]]
    await _steadily(topic, lambda at: socket.send(data(cdr(topic, at), wanted["id"])))


@asynccontextmanager
async def serving(handle: Serve, port: int = 0, subprotocols: Sequence[str] = ()) -> AsyncIterator[int]:
    """A server at a port of this computer."""
    spoken = [Subprotocol(one) for one in subprotocols] or None
    async with serve(handle, "127.0.0.1", port, subprotocols=spoken, compression=None) as server:
        yield next(iter(server.sockets)).getsockname()[1]
