"""Readings of a topic by rosbridge: JSON by WebSocket, as rosbridge_server sends it, of ROS 1 and ROS 2.

Protocol: https://github.com/RobotWebTools/rosbridge_suite (ROSBRIDGE_PROTOCOL.md), the operations subscribe, publish
and status. It sends NaN and infinity as null, which is no figure here either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import orjson

from pipeline.errors import PipelineError
from pipeline.live.adapters.feeds import Feed
from pipeline.live.adapters.ros_json import figures, ros_name, stamp_ms, types_of
from pipeline.live.adapters.talk import Heard
from pipeline.live.messages import MessageError, loaded
from pipeline.study.recording import Rosbridge

_LONGEST = 64 * 1024
_SAID = 200  # characters of what a server says


def check(stream: str, content: str, settings: Rosbridge, where: str) -> None:
    """Raise PipelineError for a type that does not hold what the stream reads."""
    known = types_of(content)
    if ros_name(settings.type) not in known:
        raise PipelineError(
            f"{where}: recording: senders.{stream}: rosbridge: {settings.url}: type: {settings.type} is not read as"
            f" {'a position' if content == 'position' else 'an acceleration'}; use {', '.join(known)}"
        )


class Talk:
    """What is said to a rosbridge server, and heard of it."""

    subprotocols: Sequence[str] = ()
    longest = _LONGEST

    def __init__(self, feed: Feed, settings: Rosbridge) -> None:
        self.feed, self.url, self._settings = feed, settings.url, settings

    def begin(self, subprotocol: str | None) -> Heard:
        """Ask for the topic."""
        wanted = {"op": "subscribe", "id": self.feed.stream, "topic": self._settings.topic, "type": self._settings.type}
        return Heard(answers=(orjson.dumps({**wanted, "queue_length": 0}).decode(),))

    def take(self, frame: str | bytes, now: int) -> Heard:
        """A frame has come."""
        try:
            content = loaded(frame, _LONGEST)
            if not isinstance(content, dict):
                raise MessageError("it is no object")
            if content.get("op") == "status":
                return self._status(content)
            if content.get("op") != "publish" or content.get("topic") != self._settings.topic:
                return Heard(refused="not asked for")
            message = content.get("msg")
            read, sent_ms = figures(self.feed, ros_name(self._settings.type), message), stamp_ms(message)
        except MessageError:
            return Heard(refused="not understood")
        reading = self.feed.reading(read, now, sent_ms)
        return Heard(refused="not of the stream's kind") if reading is None else Heard((reading,))

    def _status(self, content: Mapping[str, Any]) -> Heard:
        if content.get("level") != "error":
            return Heard()
        said = str(content.get("msg"))[:_SAID]
        return Heard(
            problem=f"says of {self._settings.topic}: “{said}”. Compare topic and type with `ros2 topic info"
            f" {self._settings.topic}`."
        )

    def nothing_yet(self) -> str:
        """Why there may be no reading."""
        topic = self._settings.topic
        return f"is connected, and nothing comes on {topic}. See whether it is sent: `ros2 topic hz {topic}`."
