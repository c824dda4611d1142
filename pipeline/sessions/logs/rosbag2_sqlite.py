"""ROS 2 bags in SQLite (.db3), read by the standard library: topics, messages, and definitions where the bag has them.

A bag has its times of arrival and no others; the senders' stamps are in the messages.
"""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.bag import Connection, Raw, keeps, take, walk_of
from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits, Log, Wanted
from pipeline.sessions.logs.mcap import log_of, takers_of
from pipeline.sessions.logs.mcap.file import unpacked
from pipeline.sessions.logs.mcap.walk import Walk

_MARK = b"SQLite format 3\0"


def read(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The wanted topics of a bag, decoded. SessionError for a file that is none, or that holds too much."""
    takers = takers_of(wanted, limits)
    with _sqlite_file(path, limits) as file, closing(_opened(file)) as bag:
        try:
            topics = bag.execute("SELECT id, name, type, serialization_format FROM topics ORDER BY id").fetchall()
            definitions = _definitions(bag)
        except sqlite3.Error as error:
            raise SessionError(f"not a ROS 2 bag: {error}") from None
        connections = [
            Connection(name, kind, encoding, *definitions.get(kind, (b"", ""))) for _, name, kind, encoding in topics
        ]
        walk = walk_of(takers, limits, connections)
        for number, (key, name, *_) in enumerate(topics, start=1):
            take(walk, _raw(walk, bag, number, key, keeps(walk, name)))
    if _has_journal(path):
        walk.note(f"its last messages may still be in {path.name}-wal: close its recorder, or convert the bag")
        walk.unknown_loss = True
    if not any(topic.read for topic in walk.topics.values()):
        raise SessionError("; ".join(["it holds no message that can be read", *walk.faults]))
    return log_of(walk, takers)


@contextmanager
def _sqlite_file(path: Path, limits: Limits) -> Iterator[Path]:
    """The file itself, or an unpacked copy of one that is packed as a whole."""
    with unpacked(path, Walk(None, limits.unpacked_bytes, 0, 0)) as (file, _):
        head = file.read(len(_MARK))
        if not head:
            raise SessionError("the file is empty")
        if head != _MARK:
            raise SessionError("not a ROS 2 bag: it does not begin as a file of SQLite")
        if path.suffix.lower() == ".db3":
            yield path
            return
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "bag.db3"
            copy.write_bytes(head + file.read())
            yield copy


def _opened(file: Path) -> sqlite3.Connection:
    """Read-only, and without the files that SQLite would otherwise put beside it."""
    return sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)


def _definitions(bag: sqlite3.Connection) -> dict[str, tuple[bytes, str]]:
    """Text and language of each type's definition; none in bags of ROS 2 before Iron."""
    names = {name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if "message_definitions" not in names:
        return {}
    rows = bag.execute("SELECT topic_type, encoded_message_definition, encoding FROM message_definitions")
    return {kind: (text.encode() if isinstance(text, str) else bytes(text), written) for kind, text, written in rows}


def _raw(walk: Walk, bag: sqlite3.Connection, number: int, key: int, with_payloads: bool) -> Iterator[Raw]:
    """A topic's messages in the order of the file, as far as it is sound."""
    what = "data" if with_payloads else "x''"
    try:
        for time, data in bag.execute(f"SELECT timestamp, {what} FROM messages WHERE topic_id = ? ORDER BY id", (key,)):  # noqa: S608
            yield Raw(number, max(time, 0), bytes(data))
    except (sqlite3.Error, TypeError) as error:
        walk.note(f"the bag is damaged: {error}")
        walk.unknown_loss = True


def _has_journal(path: Path) -> bool:
    journal = path.with_name(f"{path.name}-wal")
    return journal.is_file() and journal.stat().st_size > 0
