"""MCAP logs with messages in CDR, protobuf, flatbuffers or JSON: reads what is readable of a damaged one, and writes.

`container` walks through the file, `records` reads its records by the `mcap` package, `damage` says what is wrong with
it. `payload` decodes messages: many at once where one shows how the others are laid out, unusual ones one by one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits, Log, MessageType, Wanted
from pipeline.sessions.logs.mcap.container import MAGIC, walk_log
from pipeline.sessions.logs.mcap.payload import counted, decode
from pipeline.sessions.logs.mcap.schemas import content_of
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.sessions.logs.mcap.writer import LogWriter, Message, in_order, write

__all__ = ["MAGIC", "LogWriter", "Message", "in_order", "read", "write"]


def read(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The wanted topics of a log, decoded. With nothing wanted, the messages of every topic are counted only.

    Raises SessionError for a file that is no log, is a decompression bomb, or contradicts itself.
    """
    wants = tuple(wanted)
    walk = walk_log(path, frozenset(want.topic for want in wants) or None, limits)
    return log_of(walk, wants)


def log_of(walk: Walk, wants: Sequence[Wanted]) -> Log:
    """The wanted topics of a log that was walked through; with nothing wanted, all of them, counted only."""
    if wants:
        topics = {
            want.key: decode(walk, want.topic, want.content, want.source) for want in wants if want.topic in walk.topics
        }
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
