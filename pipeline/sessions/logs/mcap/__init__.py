"""MCAP logs with messages in CDR, protobuf or JSON: reading what is readable of a damaged one, and writing.

Records are parsed by the `mcap` package, and what is unusual in payloads by the stock decoders; the walk through the
file is ours, and so is the decoding of many messages at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pipeline.sessions.logs.log import Log, MessageType, Wanted
from pipeline.sessions.logs.mcap.container import MAGIC, walk_log
from pipeline.sessions.logs.mcap.payload import counted, decode
from pipeline.sessions.logs.mcap.schemas import content_of
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.sessions.logs.mcap.writer import Message, in_order, write

__all__ = ["MAGIC", "Message", "in_order", "read", "write"]


def read(path: Path, wanted: Iterable[Wanted]) -> Log:
    """The wanted topics of a log, decoded; SessionError if it is none, is a bomb, or contradicts itself.

    With nothing wanted, every message of every topic is counted, and those that a study could not decode are said.
    """
    content_of = {want.topic: want.content for want in wanted}
    walked = walk_log(path, content_of or None)
    if content_of:
        topics = {
            topic: decode(walked, topic, content) for topic, content in content_of.items() if topic in walked.topics
        }
    else:
        topics = {topic: counted(walked, topic) for topic in walked.topics}
    return Log(walked.facts, topics, tuple(walked.faults), _types(walked))


def _types(walked: Walk) -> dict[str, MessageType]:
    """The type of every topic that the log names; of several on one topic the last."""
    found = {}
    for channel in walked.channels.values():
        schema = walked.schemas.get(channel.schema_id)
        name = "" if schema is None else schema.name
        content = content_of(channel.message_encoding, name)
        found[channel.topic] = MessageType(name, channel.message_encoding, content)
    return found
