"""What the readers of ROS bags have in common: raw messages by connection, decoded as those of an MCAP file are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from mcap.records import Channel, Schema

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import Limits, Wanted
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.records import HOW_TO_LIFT
from pipeline.sessions.logs.mcap.schemas import content_of
from pipeline.sessions.logs.mcap.walk import Topic, Walk


@dataclass(frozen=True)
class Connection:
    """A topic's messages of one type: `encoding` is cdr or ros1, `definition` empty where the bag has none."""

    topic: str
    type_name: str
    encoding: str
    definition: bytes = b""
    written_as: str = ""


def walk_of(wanted: Sequence[Wanted], limits: Limits, connections: Sequence[Connection]) -> Walk:
    """A bag as if it were an MCAP file that has been walked through, without its messages; see `add`."""
    topics = frozenset(want.topic for want in wanted)
    walk = Walk(topics or None, limits.unpacked_bytes, limits.messages, limits.unpacked_bytes)
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


def add(walk: Walk, number: int, times_ns: Sequence[int], payloads: Iterable[bytes]) -> None:
    """Add messages of the connection with this number, counted from 1, to their topic.

    SessionError where they are more, or longer, than the limits allow.
    """
    each = list(payloads)
    walk.messages += len(each)
    walk.inflated += sum(map(len, each))
    if walk.messages > walk.messages_limit:
        raise SessionError(
            f"refused: it holds more than {walk.messages_limit} messages; if it is sound, write "
            "`log_limits: {messages: N}` in study.yaml"
        )
    if walk.inflated > walk.inflated_limit:
        limit = walk.inflated_limit // 2**20
        raise SessionError(f"refused: the wanted topics hold more than {limit} MiB; {HOW_TO_LIFT}")
    length = np.array([len(payload) for payload in each], np.int64)
    times = np.array(times_ns, np.int64).astype(np.uint64)
    channel = np.full(len(each), number, np.uint16)
    messages = Messages(times, times, channel, np.cumsum(length) - length, length, b"".join(each))
    walk.topics[walk.channels[number].topic].parts.append(messages)
