"""What the readers of ROS bags have in common: raw messages by connection, decoded as those of an MCAP file are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from mcap.records import Channel, Schema

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import Limits
from pipeline.sessions.logs.mcap import Takers
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.records import DECODED_AT_ONCE, HOW_TO_LIFT
from pipeline.sessions.logs.mcap.schemas import content_of
from pipeline.sessions.logs.mcap.walk import Topic, Walk

_AT_ONCE = 4096  # messages of a topic


@dataclass(frozen=True)
class Connection:
    """A topic's messages of one type: `encoding` is cdr or ros1, `definition` empty where the bag has none."""

    topic: str
    type_name: str
    encoding: str
    definition: bytes = b""
    written_as: str = ""


class Raw(NamedTuple):
    """A message of the connection with this number, counted from 1."""

    number: int
    time_ns: int
    payload: bytes


def walk_of(takers: Takers, limits: Limits, connections: Sequence[Connection]) -> Walk:
    """A bag as if it were an MCAP file that has been walked through, without its messages; see `take`."""
    walk = Walk(takers or None, limits.unpacked_bytes, limits.messages, limits.unpacked_bytes)
    for number, one in enumerate(connections, start=1):
        walk.schemas[number] = Schema(number, one.definition, one.written_as, one.type_name)
        walk.channels[number] = Channel(number, one.topic, one.encoding, {}, number)
        topic = walk.topics.setdefault(one.topic, Topic())
        topic.channels.append(number)
        topic.content = topic.content or content_of(one.encoding, one.type_name)
    return walk


def keeps(walk: Walk, topic: str) -> bool:
    """Whether the payloads of a topic are needed, or only how many there are."""
    return walk.topics[topic].content is not None if walk.wanted is None else topic in walk.wanted


def take(walk: Walk, raw: Iterable[Raw]) -> None:
    """Add messages to their topics, in their order, many at a time, as decoding them is faster then.

    SessionError where they are more, or longer, than the limits allow.
    """
    waiting: dict[str, list[Raw]] = {}
    for one in raw:
        topic = walk.channels[one.number].topic
        own = waiting.setdefault(topic, [])
        own.append(one)
        if len(own) == _AT_ONCE:
            _add(walk, topic, own)
            own.clear()
    for topic, own in waiting.items():
        _add(walk, topic, own)


def _add(walk: Walk, topic: str, raw: Sequence[Raw]) -> None:
    length = np.array([len(one.payload) for one in raw], np.int64)
    walk.messages += len(raw)
    walk.inflated += int(length.sum())
    if walk.messages > walk.messages_limit:
        raise SessionError(
            f"refused: it holds more than {walk.messages_limit} messages; if it is sound, write "
            "`log_limits: {messages: N}` in study.yaml"
        )
    if walk.inflated > walk.inflated_limit:
        limit = walk.inflated_limit // 2**20
        raise SessionError(f"refused: the wanted topics hold more than {limit} MiB; {HOW_TO_LIFT}")
    times = np.array([one.time_ns for one in raw], np.int64).astype(np.uint64)
    channel = np.array([one.number for one in raw], np.uint16)
    data = b"".join([one.payload for one in raw])
    walk.topics[topic].parts.append(Messages(times, times, channel, np.cumsum(length) - length, length, data))
    walk.hand_on(topic, DECODED_AT_ONCE)
