"""The fields of a message, whatever its encoding: their names in known types, and the arrays for their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.records import BROKEN
from pipeline.statistics.arrays import FloatArray

WIDTHS: Mapping[str, int] = {"position": 3, "acceleration": 11}
"""How many values are used: a position; specific force, angular velocity, orientation xyzw, its covariance's first."""

UNFIT = "the bytes do not fit the schema"
UNDECODABLE = (*BROKEN, AttributeError, TypeError, LookupError, RuntimeError)
"""What decoding a damaged message, or following its schema, raises."""

PAYLOAD_LIMIT = 64 * 1024  # bytes; a sensor's message takes some hundred

Path = tuple[str, ...]

# Named as in ROS 2, or as in Foxglove's schemas (Point3InFrame, PoseInFrame).
STAMPS: Sequence[Path] = (("header", "stamp"), ("timestamp",))
SECONDS: Sequence[str] = ("sec", "seconds")
NANOSECONDS: Sequence[str] = ("nanosec", "nsec", "nanos")
POINTS: Sequence[Path] = (("point",), ("pose", "position"))
FORCE, RATE, TURN, COVARIANCE = "linear_acceleration", "angular_velocity", "orientation", "orientation_covariance"

Reading = tuple[int, int, list[float]]
"""A stamp's seconds and nanoseconds, and the used values."""


@dataclass(frozen=True)
class Fields:
    """What n messages hold: stamps (n,), the used values (n, w), and which of the messages are decoded (n,)."""

    seconds: IntArray
    nanoseconds: IntArray
    values: FloatArray
    fits: npt.NDArray[np.bool_]

    @staticmethod
    def none_of(count: int, content: str) -> Fields:
        """Arrays for `count` messages, none of them decoded yet."""
        return Fields(
            np.zeros(count, np.int64),
            np.zeros(count, np.int64),
            np.zeros((count, WIDTHS[content])),
            np.zeros(count, bool),
        )

    def take(self, at: IntArray, of: Fields, which: IntArray) -> None:
        """Copy the messages `which` of `of` to the places `at`, and mark them as decoded."""
        self.seconds[at], self.nanoseconds[at] = of.seconds[which], of.nanoseconds[which]
        self.values[at], self.fits[at] = of.values[which], True


@dataclass(frozen=True)
class Decoder:
    """A channel's decoder, slow and fast.

    `one` decodes a message with the stock packages, and raises for one that cannot be read. `many` decodes as many as
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
