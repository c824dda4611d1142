"""An attempt's settings, its state, and what happens to it; `session` says what follows from that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from fusion_core import Estimator
from pipeline.live.changes import changed
from pipeline.live.events import Actions, Reading, Tick, Values
from pipeline.live.streams import LiveStream
from pipeline.statistics.arrays import FloatArray

Phase = Literal["practice", "countdown", "running", "ended"]


@dataclass(frozen=True)
class Attempt:
    """What does not change during an attempt; `uses` are the streams that change what the estimator shows.

    `armed` is the stream of the phone whose lever arm is taken off positions, and added to what is shown.
    """

    participant: str
    condition: str
    estimator: Estimator
    uses: frozenset[str]
    streams: Mapping[str, LiveStream]
    axes: Sequence[str]
    targets_mm: Sequence[tuple[float, float]]
    display_topic: str
    events_topic: str
    practice: int
    countdown_ns: int
    abort_after_ns: int
    confirm_ns: int
    armed: str | None = None


@dataclass(frozen=True)
class Estimate:
    """What was sent to the phone: its number, the instant it holds for, and the position in mm."""

    n: int
    instant_ns: int
    mean_mm: tuple[float, ...]


@dataclass(frozen=True)
class Heard:
    """What has come of a stream: `recent` are readings by stamp, for copies.

    Bit i of `numbers` says whether the sender's number `highest` − i has come.
    """

    newest_ns: int = 0
    arrival_ns: int = 0
    last: Values = ()
    recent: tuple[tuple[int, Values], ...] = ()
    highest: int = -1
    numbers: int = 0
    taken: int = 0
    dropped: int = 0
    lost: int = 0
    silent: bool = False
    gone: bool = False


@dataclass(frozen=True)
class Session:
    """The state of an attempt.

    `clock_ns` is the newest instant that was given to anything. `waiting` says that there was something new to show
    while the phone could take nothing. `arms` are the lever arms (3,) in mm in the tracker's frame, by when the phone
    was turned so, of the last seconds.
    """

    attempt: Attempt
    phase: Phase
    since_ns: int
    clock_ns: int
    estimated: Any
    phone: int | None
    phone_gone_ns: int | None = None
    origin_ns: int | None = None
    n: int = 0
    sent: tuple[Estimate, ...] = ()
    under_way: tuple[int, ...] = ()
    drawn: int = 0
    shown_ns: int = 0
    waiting: bool = False
    target: int = 0
    begun_ns: int = 0
    trial_ns: int = 0
    last_press_ns: int = 0
    seconds_left: int = 0
    heard: Mapping[str, Heard] = field(default_factory=dict)
    arms: tuple[tuple[int, FloatArray], ...] = ()
    ignored_presses: int = 0
    ended_by: str = ""

    @property
    def trial(self) -> int:
        """The trial's number, from 1."""
        return self.target + 1

    @property
    def selections(self) -> int:
        """How many trials have their selection."""
        return self.target if self.phase in ("running", "ended") else 0


@dataclass(frozen=True)
class PhoneDrew:
    """Estimate `n` is on the screen since `drawn_ns`."""

    n: int
    drawn_ns: int
    at_ns: int


@dataclass(frozen=True)
class PhonePressed:
    """The button was pressed at `pressed_ns` (recorder time), with estimate `n` on the screen."""

    n: int
    pressed_ns: int
    at_ns: int


@dataclass(frozen=True)
class PhoneIs:
    """The phone is this connection now; None: it is gone, if it is known since when, since `gone_ns`."""

    client: int | None
    at_ns: int
    gone_ns: int | None = None


@dataclass(frozen=True)
class Aborted:
    """Somebody ends the attempt, for a reason."""

    reason: str
    at_ns: int


@dataclass(frozen=True)
class Noted:
    """The operator's note."""

    text: str
    at_ns: int
    kind: str = "note"


Event = Reading | PhoneDrew | PhonePressed | PhoneIs | Aborted | Noted | Tick
Stepped = tuple[Session, Actions]


def with_heard(state: Session, name: str, heard: Heard) -> Session:
    """With what has come of a stream."""
    return changed(state, heard={**state.heard, name: heard})
