"""MCAP logs with messages in CDR, protobuf or JSON: reading what is readable of a damaged one, and writing.

Records are parsed by the `mcap` package, and what is unusual in payloads by the stock decoders; the walk through the
file is ours, and so is the decoding of many messages at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pipeline.sessions.logs.log import Log, Wanted
from pipeline.sessions.logs.mcap.container import MAGIC, walk_log
from pipeline.sessions.logs.mcap.payload import counted, decode
from pipeline.sessions.logs.mcap.writer import Message, in_order, write

__all__ = ["MAGIC", "Message", "in_order", "read", "write"]


def read(path: Path, wanted: Iterable[Wanted]) -> Log:
    """The wanted topics of a log, decoded; SessionError if it is none, is a bomb, or contradicts itself.

    With nothing wanted, every message of every topic is counted, and those that a study could not decode are said.
    """
    asked = {want.topic: want.content for want in wanted}
    walked = walk_log(path, asked or None)
    if asked:
        topics = {topic: decode(walked, topic, content) for topic, content in asked.items() if topic in walked.topics}
    else:
        topics = {topic: counted(walked, topic) for topic in walked.topics}
    return Log(walked.facts, topics, tuple(walked.faults))
