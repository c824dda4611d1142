"""Readings of a topic by Foxglove's WebSocket protocol, as foxglove_bridge and the Foxglove SDK speak it.

A server advertises channels, each with the encoding and schema of its messages, and sends those of a subscription as
bytes: opcode 1, the subscription's number (4 bytes), the time it was received (8 bytes), the message. Messages are
decoded as those of a log are (`pipeline.sessions.logs.mcap`).
(https://github.com/foxglove/ws-protocol; subprotocols foxglove.websocket.v1 and foxglove.sdk.v1)
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import orjson

from pipeline.live.adapters.feeds import Feed, are_plausible
from pipeline.live.adapters.foxglove_channel import SAID, decoder, figures, reason
from pipeline.live.adapters.talk import Heard
from pipeline.sessions.logs.mcap.fields import UNDECODABLE, Decoder
from pipeline.study.recording import Foxglove

_LONGEST = 16 * 2**20  # an advertisement holds the schemas of all topics
_MESSAGE = struct.Struct("<BIQ")
_MESSAGE_DATA, _SUBSCRIPTION, _ERROR = 1, 1, 2
_NAMED = 12  # topics in a message


class Talk:
    """What is said to a server of that protocol, and heard of it."""

    subprotocols: Sequence[str] = ("foxglove.websocket.v1", "foxglove.sdk.v1")
    longest = _LONGEST

    def __init__(self, feed: Feed, settings: Foxglove) -> None:
        self.feed, self.url, self._topic = feed, settings.url, settings.topic
        self._channel: int | None = None
        self._decoder: Decoder | None = None
        self._topics: dict[int, str] = {}
        self._child: str | None = None
        self._taken = False

    def begin(self, subprotocol: str | None) -> Heard:
        """Channels will be advertised."""
        self._channel, self._decoder, self._topics, self._taken = None, None, {}, False
        if subprotocol in self.subprotocols:
            return Heard()
        return Heard(problem=f"does not speak {self.subprotocols[0]}; start foxglove_bridge there, or correct the url.")

    def take(self, frame: str | bytes, now: int) -> Heard:
        """A frame has come."""
        if isinstance(frame, bytes):
            return self._message(frame, now)
        try:
            content = orjson.loads(frame)
            operation = content.get("op")
            if operation == "advertise":
                return self._advertised(content["channels"])
            if operation == "unadvertise":
                return self._unadvertised(content["channelIds"])
            if operation == "status" and content.get("level") == _ERROR:
                return Heard(problem=f"says “{str(content.get('message'))[:SAID]}”. See the server's own output.")
        except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
            return Heard(refused="not understood")
        return Heard()

    def _advertised(self, channels: list[Mapping[str, Any]]) -> Heard:
        self._topics |= {int(one["id"]): str(one["topic"]) for one in channels}
        own = next((one for one in channels if one["topic"] == self._topic), None)
        if own is None or self._channel is not None:
            return Heard()
        found = decoder(own, self.feed)
        if isinstance(found, str):
            kind = "a position" if self.feed.content == "position" else "an acceleration"
            return Heard(
                problem=f"{self._topic} cannot be read as {kind}: {found}. Name another topic, or have it sent as"
                f" {'geometry_msgs/msg/PointStamped' if kind == 'a position' else 'sensor_msgs/msg/Imu'}."
            )
        self._channel, self._decoder = int(own["id"]), found
        wanted = {"op": "subscribe", "subscriptions": [{"id": _SUBSCRIPTION, "channelId": self._channel}]}
        return Heard(answers=(orjson.dumps(wanted).decode(),))

    def _unadvertised(self, channels: list[int]) -> Heard:
        self._topics = {number: topic for number, topic in self._topics.items() if number not in channels}
        if self._channel not in channels:
            return Heard()
        self._channel = self._decoder = None
        return Heard(problem=f"does not send {self._topic} any more. See whether its sender runs.")

    def _message(self, frame: bytes, now: int) -> Heard:
        if len(frame) < _MESSAGE.size or frame[0] != _MESSAGE_DATA:
            return Heard()  # time, answers to services and the like
        if self._decoder is None or _MESSAGE.unpack_from(frame)[1] != _SUBSCRIPTION:
            return Heard(refused="not asked for")
        try:
            found = self._decoder.one(frame[_MESSAGE.size :])
        except UNDECODABLE as error:
            unless = None if self._taken else f"{self._topic} cannot be read: {reason(error)}. Name another topic."
            return Heard(refused="not understood", problem=unless)
        if not 0 <= found.nanoseconds < 1_000_000_000 or not are_plausible(found.values[:6]):
            return Heard(refused="not understood")
        if self._taken and found.child != self._child:
            frames = f'"{self._child}" and "{found.child}"'
            return Heard(refused="of another frame", problem=f"sends the frames {frames} on {self._topic}. Send one.")
        self._taken, self._child = True, found.child
        sent_ms = found.seconds * 1e3 + found.nanoseconds * 1e-6
        reading = self.feed.reading(figures(self.feed, found.values), now, sent_ms or None)
        return Heard(refused="not of the stream's kind") if reading is None else Heard((reading,))

    def nothing_yet(self) -> str:
        """Why there may be no reading."""
        if self._channel is not None:
            return f"is connected, and nothing comes on {self._topic}. See whether its sender runs."
        topics = sorted(set(self._topics.values()))
        there = (
            f"it has {', '.join(topics[:_NAMED])}{' …' if len(topics) > _NAMED else ''}" if topics else "it has none"
        )
        return f"has no topic {self._topic}; {there}. Correct the topic, or start it."
