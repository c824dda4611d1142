"""What a message holds, whatever its encoding: where its fields are called what, and the arrays they are put in."""

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
"""How many figures are kept: a position; specific force, angular velocity, orientation xyzw, its covariance's first."""

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
"""A stamp's seconds and nanoseconds, and the kept figures."""


@dataclass(frozen=True)
class Fields:
    """What n messages hold: stamps (n,), the kept figures (n, w), and which of the messages are decoded (n,)."""

    seconds: IntArray
    nanoseconds: IntArray
    values: FloatArray
    fits: npt.NDArray[np.bool_]

    @staticmethod
    def none_of(count: int, content: str) -> Fields:
        """Room for so many messages, none of them decoded."""
        return Fields(
            np.zeros(count, np.int64),
            np.zeros(count, np.int64),
            np.zeros((count, WIDTHS[content])),
            np.zeros(count, bool),
        )

    def take(self, at: IntArray, of: Fields, which: IntArray) -> None:
        """Put messages `which` of others in at `at`, as decoded."""
        self.seconds[at], self.nanoseconds[at] = of.seconds[which], of.nanoseconds[which]
        self.values[at], self.fits[at] = of.values[which], True


@dataclass(frozen=True)
class Decoder:
    """A channel's decoder. `one` is the stock packages' way, raising where a message cannot be read.

    `many` decodes as many as it can of the messages at some indices, as `one` would; the others it leaves.
    """

    one: Callable[[bytes], Reading]
    many: Callable[[Messages, IntArray, Fields], None]


def check_size(payload: bytes) -> None:
    """ValueError for a message that would grow beyond measure when it is decoded."""
    if len(payload) > PAYLOAD_LIMIT:
        raise ValueError(f"it is longer than {PAYLOAD_LIMIT // 1024} KiB, which no sensor's message is")


def check_stamp(seconds: int, nanoseconds: int) -> None:
    """ValueError for a stamp that no stamp's fields can hold."""
    if not (-(2**31) <= seconds < 2**32 and 0 <= nanoseconds < 2**32):
        raise ValueError(UNFIT)


def holds_stamps(seconds: IntArray, nanoseconds: IntArray) -> npt.NDArray[np.bool_]:
    """Where `check_stamp` would not raise."""
    fits: npt.NDArray[np.bool_] = (seconds >= -(2**31)) & (seconds < 2**32) & (nanoseconds >= 0) & (nanoseconds < 2**32)
    return fits
