"""ROS 1 bags (.bag), their records read by the package `rosbags`, their messages as those of an MCAP file are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.bag import Connection, Raw, keeps, take, walk_of
from pipeline.sessions.logs.extras import needs
from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits, Log, Wanted
from pipeline.sessions.logs.mcap import log_of, takers_of


def read(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The wanted topics of a bag, decoded. SessionError for a file that is none, or that holds too much."""
    with needs("ros", "bags of ROS 1"):
        from rosbags.rosbag1 import Reader, ReaderError
    takers = takers_of(wanted, limits)
    if not path.stat().st_size:
        raise SessionError("the file is empty")
    reader = Reader(path)
    try:
        reader.open()
    except (ReaderError, ValueError, LookupError, OSError) as error:
        raise SessionError(f"not a bag of ROS 1 that can be read: {error}; `rosbag reindex` may mend it") from None
    with closing(reader):
        connections = [
            Connection(one.topic, one.msgtype.replace("/msg/", "/"), "ros1", one.msgdef.data.encode(), "ros1msg")
            for one in reader.connections
        ]
        walk = walk_of(takers, limits, connections)
        numbers = {one.id: number for number, one in enumerate(reader.connections, start=1)}

        def raw() -> Iterator[Raw]:
            try:
                for connection, time, data in reader.messages():
                    number = numbers[connection.id]
                    yield Raw(number, time, bytes(data) if keeps(walk, connection.topic) else b"")
            except (ReaderError, ValueError, LookupError, OSError, AssertionError) as error:
                walk.note(f"the bag is damaged: {error}")
                walk.unknown_loss = True

        take(walk, raw())
    if not any(topic.read for topic in walk.topics.values()):
        raise SessionError("; ".join(["it holds no message that can be read", *walk.faults]))
    return log_of(walk, takers)
