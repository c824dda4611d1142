"""MCAP logs with messages in CDR, protobuf or JSON: reads what is readable of a damaged one, and writes.

`container` walks through the file, `records` reads its records by the `mcap` package, `damage` says what is wrong with
it. `payload` decodes messages: many at once where their shape is known, unusual ones by the stock decoders.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pipeline.sessions.logs.log import Log, MessageType, Wanted
from pipeline.sessions.logs.mcap.container import MAGIC, walk_log
from pipeline.sessions.logs.mcap.payload import counted, decode
from pipeline.sessions.logs.mcap.schemas import content_of
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.sessions.logs.mcap.writer import LogWriter, Message, in_order, write

__all__ = ["MAGIC", "LogWriter", "Message", "in_order", "read", "write"]


def read(path: Path, wanted: Iterable[Wanted]) -> Log:
    """The wanted topics of a log, decoded. With nothing wanted, the messages of every topic are counted only.

    Raises SessionError for a file that is no log, is a decompression bomb, or contradicts itself.
    """
    content_of = {want.topic: want.content for want in wanted}
    walk = walk_log(path, content_of or None)
    if content_of:
        topics = {topic: decode(walk, topic, content) for topic, content in content_of.items() if topic in walk.topics}
    else:
        topics = {topic: counted(walk, topic) for topic in walk.topics}
    return Log(walk.facts, topics, tuple(walk.faults), _types(walk))


def _types(walk: Walk) -> dict[str, MessageType]:
    """The type of every topic that the log names; of several on one topic the last."""
    types = {}
    for channel in walk.channels.values():
        schema = walk.schemas.get(channel.schema_id)
        name = "" if schema is None else schema.name
        content = content_of(channel.message_encoding, name)
        types[channel.topic] = MessageType(name, channel.message_encoding, content)
    return types
