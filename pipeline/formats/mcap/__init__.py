"""MCAP logs, profile ros2: reading what is readable of a damaged one, and writing.

Records are parsed by the `mcap` package and payloads by its ROS 2 decoder; the walk through the file is ours.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pipeline.formats.log import Content, Log, Wanted
from pipeline.formats.mcap.container import MAGIC, walk_log
from pipeline.formats.mcap.payload import decode
from pipeline.formats.mcap.writer import Message, in_order, write

__all__ = ["MAGIC", "Message", "in_order", "read", "write"]


def read(path: Path, wanted: Iterable[Wanted]) -> Log:
    """The wanted topics of a log, decoded; SessionError if it is none, is a bomb, or contradicts itself.

    With nothing wanted, every topic is counted and none decoded.
    """
    asked = {want.topic: want.content for want in wanted}
    walked = walk_log(path, asked)
    counted: dict[str, Content] = dict.fromkeys(walked.topics, "anything")
    topics = {
        topic: decode(walked, topic, content) for topic, content in (asked or counted).items() if topic in walked.topics
    }
    return Log(walked.facts, topics, tuple(walked.faults))
