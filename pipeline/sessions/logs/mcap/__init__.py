"""MCAP logs with messages in CDR, protobuf, flatbuffers or JSON: reads what is readable of a damaged one, and writes.

`container` walks through the file, `records` reads its records by the `mcap` package, `damage` says what is wrong with
it. `decoding` decodes messages while the file is read, so that their bytes are not kept: many at once where one shows
how the others are laid out, unusual ones one by one (`payload`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits, Log, MessageType, Readings, Wanted
from pipeline.sessions.logs.mcap.container import MAGIC, walk_log
from pipeline.sessions.logs.mcap.decoding import Decoding, counted
from pipeline.sessions.logs.mcap.schemas import content_of
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.sessions.logs.mcap.writer import LogWriter, Message, in_order, write

__all__ = ["MAGIC", "LogWriter", "Message", "in_order", "read", "write"]


def read(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The wanted topics of a log, decoded. With nothing wanted, the messages of every topic are counted only.

    Raises SessionError for a file that is no log, is a decompression bomb, or contradicts itself.
    """
    takers = takers_of(wanted, limits)
    return log_of(walk_log(path, takers or None, limits), takers)


Takers = Mapping[str, Mapping[str, Decoding]]
"""What decodes each wanted topic, by topic and `Wanted.key`."""


def takers_of(wanted: Iterable[Wanted], limits: Limits) -> Takers:
    """What decodes the wanted topics while a log is read."""
    takers: dict[str, dict[str, Decoding]] = {}
    for want in wanted:
        takers.setdefault(want.topic, {})[want.key] = Decoding(want.content, want.source, limits.folder)
    return takers


def log_of(walk: Walk, takers: Takers) -> Log:
    """The wanted topics of a log that was walked through; with nothing wanted, all of them, counted only."""
    topics: dict[str, Readings] = {}
    for topic, own in takers.items():
        if topic in walk.topics:
            walk.hand_on(topic)
            topics |= {key: decoding.readings(walk, topic) for key, decoding in own.items()}
    if not takers:
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
