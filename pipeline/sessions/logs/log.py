"""A log as the pipeline sees it, whatever its format: readings by topic in SI units, events, facts, and losses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipeline.statistics.arrays import FloatArray

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

Content = Literal["position", "velocity", "acceleration", "events", "anything"]


@dataclass(frozen=True)
class Source:
    """Where a stream's readings stand in the messages of its topic, and in which units; by default by the usual names.

    `child` and `parent` are names of frames, of which one message may hold several. `fields` gives the paths of what
    stands elsewhere ("position", "velocity", "acceleration", "angular_velocity", "orientation", "stamp"). A figure
    times `scale` is in SI, an angular velocity times `turning_scale` in rad/s, a stamp that is a single number times
    `stamp_unit_s` in seconds (None: as usual in the format). With `unstamped` a reading's stamp is its arrival, with
    `arrives_as_stamped` its arrival is its stamp.
    """

    child: str | None = None
    parent: str | None = None
    fields: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    scale: float = 1.0
    turning_scale: float = 1.0
    stamp_unit_s: float | None = None
    unstamped: bool = False
    arrives_as_stamped: bool = False


@dataclass(frozen=True)
class Limits:
    """How much a log may hold: bytes that it unpacks to, and messages. A log far larger in itself may hold more.

    What a phone measured in a long one is kept in `folder`, under no name, while it is read; in memory without one.
    """

    unpacked_bytes: int = 64 * 2**20
    messages: int = 500_000
    folder: Path | None = None


DEFAULT_LIMITS = Limits()

USUAL = Source()
"""Everything as message types usually have it."""


@dataclass(frozen=True)
class Wanted:
    """A topic to decode, what the study expects in it, and where in its messages."""

    topic: str
    content: Content
    source: Source = USUAL

    @property
    def key(self) -> str:
        """The name of these readings in `Log.topics`: the topic, and what tells them from others of the same topic."""
        apart = [] if self.content != "velocity" else ["velocity"]
        apart += [name for name in (self.source.child, self.source.parent) if name is not None]
        apart += [",".join(paths) for paths in self.source.fields.values()]
        return f"{self.topic} ({'; '.join(apart)})" if apart else self.topic


@dataclass(frozen=True)
class Claims:
    """What messages say in addition to their values, used by checks only; arrays (n,), empty if the format has none.

    `frame` counts into the names of `frames`. Of an IMU: the length of the orientation as logged, NaN where the log
    says that it is unknown, and whether a covariance of −1 says to disregard acceleration or angular velocity.
    """

    frames: tuple[str, ...] = ()
    frame: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    orientation_length: FloatArray = field(default_factory=lambda: np.zeros(0))
    force_disclaimed: BoolArray = field(default_factory=lambda: np.zeros(0, np.bool_))
    gyroscope_disclaimed: BoolArray = field(default_factory=lambda: np.zeros(0, np.bool_))


@dataclass(frozen=True)
class Readings:
    """A topic's messages in the order of the file. `lost` counts those lost, None where that cannot be known.

    `values` are SI, by content: position (n, 3) m; velocity (n, 3) m/s; acceleration (n, 10): specific force in m/s²,
    angular velocity in rad/s, orientation xyzw (NaN where unknown); events and anything (n, 0). `events` holds the
    decoded objects.
    `sampled` is true of messages at a steady rate, where a missing one leaves a gap.
    """

    stamp_ns: IntArray
    arrival_ns: IntArray
    values: FloatArray
    events: tuple[Mapping[str, object], ...] = ()
    lost: int | None = 0
    notes: tuple[str, ...] = ()
    sampled: bool = False
    claims: Claims = Claims()

    @property
    def read(self) -> int:
        """How many messages could be read."""
        return len(self.arrival_ns)


@dataclass(frozen=True)
class MessageType:
    """The type and encoding of a topic's messages; `content` is None where the type's name does not say it."""

    name: str
    encoding: str
    content: Content | None


@dataclass(frozen=True)
class Log:
    """A log's facts and topics, by `Wanted.key`; `faults` say what is wrong with the file (it was read in part).

    `types` has every topic of the log, those that were not wanted too.
    """

    facts: Mapping[str, str]
    topics: Mapping[str, Readings]
    faults: tuple[str, ...] = field(default=())
    types: Mapping[str, MessageType] = field(default_factory=dict)
