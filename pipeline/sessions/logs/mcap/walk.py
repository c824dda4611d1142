"""What has been read of a log so far, while `container` goes through it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from mcap.records import Channel, Schema

from pipeline.sessions.logs.log import Content
from pipeline.sessions.logs.mcap.messages import Messages, joined

_FAULTS_LIMIT = 20


class Taker(Protocol):
    """What takes a topic's messages while the log is read, so that their bytes need not be kept."""

    @property
    def at_the_end(self) -> bool:
        """Whether it has to be given all messages at once, when the log has been read."""

    def add(self, walk: Walk, messages: Messages) -> None:
        """Take the topic's next messages."""


@dataclass
class Topic:
    """What has been collected of one topic so far: `taken` messages are with its takers, those of `parts` are not."""

    parts: list[Messages] = field(default_factory=list)
    taken: int = 0
    channels: list[int] = field(default_factory=list)
    content: Content | None = None  # None while no schema of its channels says what it holds
    in_damaged_chunks: int = 0

    @property
    def read(self) -> int:
        """How many of its messages have been read."""
        return self.taken + sum(map(len, self.parts))


@dataclass
class Walk:
    """What is known so far.

    `wanted` are topics by name, with what takes their messages; None: all that the log says what they hold.
    `unshared` messages are not given to their topics yet, because many at once are faster; `orphans` have a channel
    that no record has defined yet; `loose` holds records outside of any chunk, not read yet. `stated` are the numbers
    of messages by channel that the log's statistics state. `unknown_loss` is true where nobody can say how much is
    lost; of a damaged chunk the message indexes behind it say so.
    """

    wanted: Mapping[str, Mapping[str, Taker]] | None
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

    def hand_on(self, name: str, least_bytes: int = 0) -> None:
        """Give a wanted topic's messages to its takers, if they are so many bytes and the log has defined their types.

        Their bytes are kept no longer.
        """
        topic, takers = self.topics[name], (self.wanted or {}).get(name, {}).values()
        if not takers or sum(len(part.data) for part in topic.parts) < least_bytes:
            return
        if least_bytes and (any(taker.at_the_end for taker in takers) or not self._types_known(topic)):
            return
        messages = joined(topic.parts)
        topic.parts.clear()
        topic.taken += len(messages)
        for taker in takers:
            taker.add(self, messages)

    def _types_known(self, topic: Topic) -> bool:
        """A type's definition may have been lost in a damaged chunk, and stand in the summary again."""
        needed = {self.channels[number].schema_id for number in topic.channels}
        return needed - {0} <= self.schemas.keys()

    def note(self, fault: str) -> None:
        """Note a fault of the file; after the first few, faults are only counted."""
        self.noted += 1
        if self.noted <= _FAULTS_LIMIT:
            self.faults.append(fault)

    @property
    def unlisted_faults(self) -> int:
        """How many faults were counted only."""
        return max(0, self.noted - _FAULTS_LIMIT)
