"""What has been decoded of a topic's messages, whatever their encoding, and what a decoder is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.records import BROKEN
from pipeline.statistics.arrays import FloatArray

WIDTHS: Mapping[str, int] = {"position": 3, "velocity": 3, "acceleration": 11}
"""How many values are used: a vector; or specific force, angular velocity, orientation xyzw, its covariance's first."""

UNFIT = "the bytes do not fit the schema"
UNDECODABLE = (*BROKEN, AttributeError, TypeError, LookupError, RuntimeError)
"""What decoding a damaged message, or following its schema, raises."""

PAYLOAD_LIMIT = 64 * 1024  # bytes; a sensor's message takes some hundred


class Reading(NamedTuple):
    """A stamp's seconds and nanoseconds, the used values, and the names of the frames that a message speaks of."""

    seconds: int
    nanoseconds: int
    values: list[float]
    child: str | None = None
    parent: str | None = None


@dataclass(frozen=True)
class Fields:
    """What n messages hold: stamps (n,), the used values (n, w), and which of the messages are decoded (n,).

    `of_other_frame` are those that hold nothing of the wanted frame. `parent` (n,) counts into `parents`, the names of
    the frames in which values are given, −1 where there is none; `children` are those of the frames that move.
    """

    seconds: IntArray
    nanoseconds: IntArray
    values: FloatArray
    fits: npt.NDArray[np.bool_]
    of_other_frame: npt.NDArray[np.bool_]
    parent: IntArray
    parents: dict[str, int] = field(default_factory=dict)
    children: dict[str, int] = field(default_factory=dict)

    @staticmethod
    def none_of(count: int, content: str) -> Fields:
        """Arrays for `count` messages, none of them decoded yet."""
        return Fields(
            np.zeros(count, np.int64),
            np.zeros(count, np.int64),
            np.zeros((count, WIDTHS[content])),
            np.zeros(count, bool),
            np.zeros(count, bool),
            np.full(count, -1, np.int64),
        )

    @staticmethod
    def of(seconds: IntArray, nanoseconds: IntArray, values: FloatArray, fits: npt.NDArray[np.bool_]) -> Fields:
        """Messages that speak of no frame."""
        count = len(seconds)
        return Fields(seconds, nanoseconds, values, fits, np.zeros(count, bool), np.full(count, -1, np.int64))

    def take(self, at: IntArray, of: Fields, which: IntArray) -> None:
        """Copy the messages `which` of `of` to the places `at`, and mark them as decoded."""
        self.seconds[at], self.nanoseconds[at] = of.seconds[which], of.nanoseconds[which]
        self.values[at], self.fits[at] = of.values[which], True

    def take_named(self, at: IntArray, of: Fields, child: str | None, parent: str | None) -> None:
        """Copy all messages of `of`, which speak of these frames, to the places `at`, and mark them as decoded."""
        self.take(at, of, np.arange(len(at)))
        self._name(at, child, parent)

    def take_one(self, index: int, reading: Reading) -> None:
        """Copy one message."""
        self.seconds[index], self.nanoseconds[index], self.values[index] = reading[:3]
        self._name(index, reading.child, reading.parent)

    def _name(self, at: IntArray | int, child: str | None, parent: str | None) -> None:
        if child is not None:
            self.children.setdefault(child, len(self.children))
        if parent is not None:
            self.parent[at] = self.parents.setdefault(parent, len(self.parents))


@dataclass(frozen=True)
class Decoder:
    """A channel's decoder, slow and fast.

    `one` decodes a message by itself, and raises for one that cannot be read. `many` decodes as many as
    it can of the messages at some indices, with the same result as `one`, and leaves the others to `one`.
    """

    one: Callable[[bytes], Reading]
    many: Callable[[Messages, IntArray, Fields], None]


def check_size(payload: bytes) -> None:
    """Raise ValueError for a message that is too long: decoded, it could fill the memory."""
    if len(payload) > PAYLOAD_LIMIT:
        raise ValueError(f"it is longer than {PAYLOAD_LIMIT // 1024} KiB, which no sensor's message is")


def check_stamp(seconds: int, nanoseconds: int) -> None:
    """Raise ValueError for a stamp outside what its 32-bit fields can hold."""
    if not (-(2**31) <= seconds < 2**32 and 0 <= nanoseconds < 2**32):
        raise ValueError(UNFIT)


def holds_stamps(seconds: IntArray, nanoseconds: IntArray) -> npt.NDArray[np.bool_]:
    """Where `check_stamp` would not raise."""
    fits: npt.NDArray[np.bool_] = (seconds >= -(2**31)) & (seconds < 2**32) & (nanoseconds >= 0) & (nanoseconds < 2**32)
    return fits
