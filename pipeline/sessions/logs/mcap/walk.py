"""What has been read of a log so far, while `container` goes through it."""

from __future__ import annotations

from dataclasses import dataclass, field

from mcap.records import Channel, Schema

from pipeline.sessions.logs.log import Content
from pipeline.sessions.logs.mcap.messages import Messages

_FAULTS_LIMIT = 20


@dataclass
class Topic:
    """What has been collected of one topic so far."""

    parts: list[Messages] = field(default_factory=list)
    channels: list[int] = field(default_factory=list)
    content: Content | None = None  # None while no schema of its channels says what it holds
    in_damaged_chunks: int = 0

    @property
    def read(self) -> int:
        """How many of its messages have been read."""
        return sum(map(len, self.parts))


@dataclass
class Walk:
    """What is known so far.

    `unshared` messages are not given to their topics yet, because many at once are faster; `orphans` have a channel
    that no record has defined yet; `loose` holds records outside of any chunk, not read yet. `stated` are the numbers
    of messages by channel that the log's statistics state. `unknown_loss` is true where nobody can say how much is
    lost; of a damaged chunk the message indexes behind it say so.
    """

    wanted: frozenset[str] | None
    inflated_limit: int
    messages_limit: int
    chunk_limit: int
    messages: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    topics: dict[str, Topic] = field(default_factory=dict)
    unshared: list[Messages] = field(default_factory=list)
    orphans: list[Messages] = field(default_factory=list)
    loose: bytearray = field(default_factory=bytearray)
    facts: dict[str, str] = field(default_factory=dict)
    stated: dict[int, int] | None = None
    faults: list[str] = field(default_factory=list)
    noted: int = 0
    inflated: int = 0
    chunks: int = 0
    last_chunk_damaged: bool = False
    unknown_loss: bool = False
    in_summary: bool = False
    complete: bool = False

    def note(self, fault: str) -> None:
        """Note a fault of the file; after the first few, faults are only counted."""
        self.noted += 1
        if self.noted <= _FAULTS_LIMIT:
            self.faults.append(fault)

    @property
    def unlisted_faults(self) -> int:
        """How many faults were counted only."""
        return max(0, self.noted - _FAULTS_LIMIT)
