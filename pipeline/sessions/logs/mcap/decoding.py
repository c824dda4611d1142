"""A topic's messages as columns of numbers, decoded in blocks while the log is read, or all at once.

What is kept of a message is its numbers. Its bytes go once its block is decoded, so a log of hours takes no more memory
than its readings. How many messages a block has makes no difference to the result.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.errors import SessionError
from pipeline.sessions.growing import Growing, Spilling
from pipeline.sessions.logs.log import USUAL, Content, IntArray, Readings, Source
from pipeline.sessions.logs.mcap.claims import ClaimsSoFar
from pipeline.sessions.logs.mcap.fields import Fields
from pipeline.sessions.logs.mcap.messages import Messages, joined
from pipeline.sessions.logs.mcap.packed import inflated
from pipeline.sessions.logs.mcap.payload import Decoders, Failures, decoded, events_of, plausible, shortened
from pipeline.sessions.logs.mcap.schemas import SAMPLED
from pipeline.sessions.logs.mcap.walk import Walk

_TIME_LIMIT_NS = 2**62
_WIDTHS: Mapping[Content, int] = {"position": 3, "velocity": 3, "acceleration": 10}
_FRAMES_NAMED = 12
_NOTES = 3  # reasons named one by one; messages with others are counted together


class Decoding:
    """One stream's messages of a topic, decoded as `content`; those that cannot be are counted, with the reasons."""

    def __init__(self, content: Content, source: Source = USUAL, folder: Path | None = None) -> None:
        self._content, self._source = content, source
        self._stamp, self._arrival = Growing(np.int64), Growing(np.int64)
        self._values = Spilling(folder if content == "acceleration" else None, np.float64, _WIDTHS.get(content, 0))
        self._events: list[Mapping[str, object]] = []
        self._claims = ClaimsSoFar(content)
        self._decoders: Decoders = {}
        self._children: dict[str, None] = {}
        self._messages = 0
        self._any_of_other_frame = False
        self._failures: Counter[str] = Counter()

    @property
    def at_the_end(self) -> bool:
        """Events are few and bounded in number, which is judged before the first is decoded."""
        return self._content == "events"

    def add(self, walk: Walk, messages: Messages) -> None:
        """Decode the topic's next messages."""
        failures: Failures = {}
        messages = inflated(messages, failures)
        stamp = np.minimum(messages.publish_time, _TIME_LIMIT_NS).astype(np.int64)
        values = np.zeros((len(messages), 0))
        fields = None
        if self._content == "events":
            events = events_of(walk, messages, failures)
        elif self._content != "anything":
            fields = decoded(walk, messages, self._content, self._source, self._decoders, failures)
            stamp, values = plausible(fields, self._content, self._source, failures)
        for index in np.flatnonzero(np.maximum(messages.log_time, messages.publish_time) > _TIME_LIMIT_NS).tolist():
            failures.setdefault(index, "its time is out of all range")
        is_readable = np.ones(len(messages), bool)
        is_readable[list(failures)] = False
        if fields is not None:
            is_readable &= ~fields.of_other_frame
        readable = np.flatnonzero(is_readable)
        self._stamp.add(stamp[readable])
        self._arrival.add(messages.log_time[readable].astype(np.int64))
        self._values.add(values[readable])
        if self._content == "events":
            self._events += [events[index] for index in readable.tolist()]
        if fields is not None:
            self._take_names(walk, messages, fields, readable)
        self._messages += len(messages)
        self._failures.update(failures.values())

    def _take_names(self, walk: Walk, messages: Messages, fields: Fields, readable: IntArray) -> None:
        self._claims.add(walk, messages, fields, readable)
        self._children |= dict.fromkeys(fields.children)
        self._any_of_other_frame |= bool(fields.of_other_frame.any())

    def readings(self, walk: Walk, topic: str) -> Readings:
        """All readings, once the log has been read. Nothing can be added any more."""
        if self._source.child is None and len(self._children) > 1:
            return self._nothing(walk, topic)
        arrival, claims = self._arrival.whole(), self._claims.whole()
        failures = self._failures
        return Readings(
            self._stamp.whole(),
            arrival,
            self._values.whole(),
            tuple(self._events),
            _lost(walk, topic, failures.total()),
            (*_notes(failures), *(() if len(arrival) else self._no_such_frame())),
            self._content in SAMPLED,
            claims,
        )

    def _nothing(self, walk: Walk, topic: str) -> Readings:
        """Nobody can tell which of several frames is meant."""
        names = ", ".join(f'"{name}"' for name in list(self._children)[:_FRAMES_NAMED])
        reason = f"its topic holds the frames {names}; say in study.yaml which one is meant by `child:`"
        return Readings(
            np.zeros(0, np.int64),
            np.zeros(0, np.int64),
            np.zeros((0, _WIDTHS[self._content])),
            lost=_lost(walk, topic, self._messages),
            notes=_notes(Counter({shortened(reason): self._messages})),
            sampled=self._content in SAMPLED,
        )

    def _no_such_frame(self) -> tuple[str, ...]:
        """A note where all messages are sound and none is of the wanted frame."""
        if not self._any_of_other_frame:
            return ()
        named = (("child", self._source.child), ("parent", self._source.parent))
        wanted = " and ".join(f'{key} "{name}"' for key, name in named if name is not None)
        return (f"none of its messages is of {wanted}",)


def counted(walk: Walk, topic: str) -> Readings:
    """A topic's messages, counted. Notes say which a study could not decode, where the schema says what they hold."""
    every = _at_once(walk, topic, "anything")
    content = walk.topics[topic].content
    if content is None:
        return every
    try:
        notes = _at_once(walk, topic, content).notes
    except SessionError as error:
        notes = (str(error),)
    undecodable = tuple(f"counted, but a study would lose them: {note}" for note in notes if note not in every.notes)
    return replace(every, notes=(*every.notes, *undecodable), sampled=content in SAMPLED)


def _at_once(walk: Walk, topic: str, content: Content) -> Readings:
    decoding = Decoding(content)
    decoding.add(walk, joined(walk.topics[topic].parts))
    return decoding.readings(walk, topic)


def _notes(failures: Mapping[str, int]) -> tuple[str, ...]:
    reasons = sorted(failures.items())
    notes = [f"{count} messages cannot be read: {reason}" for reason, count in reasons[:_NOTES]]
    if len(reasons) > _NOTES:
        notes.append(f"{sum(count for _, count in reasons[_NOTES:])} messages cannot be read, for other reasons")
    return tuple(notes)


def _lost(walk: Walk, topic: str, undecodable: int) -> int | None:
    """How many messages the log states that it holds and does not; None where it does not state that."""
    collected = walk.topics[topic]
    if walk.stated is not None:
        stated = sum(walk.stated.get(channel, 0) for channel in collected.channels)
        return max(stated - collected.read, collected.in_damaged_chunks) + undecodable
    if walk.unknown_loss:
        return None
    return collected.in_damaged_chunks + undecodable
