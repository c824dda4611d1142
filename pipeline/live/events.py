"""What happens to a running study, and what it wants done: the whole language between its core and the world.

All times are ns of recorder time: the epoch of the wall clock at start plus what a monotonic clock counted since, so
that a wall clock that is set changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pipeline.live.messages import Incoming
from pipeline.live.outgoing import Outgoing
from pipeline.live.watch import Light, Request
from pipeline.sessions.logs.mcap import Message

Role = Literal["operator", "phone", "questionnaire"]
Values = tuple[float, ...]


@dataclass(frozen=True)
class Joined:
    """A page has connected; `client` tells its connection from all others."""

    role: Role
    client: int
    at_ns: int


@dataclass(frozen=True)
class Left:
    """A page's connection is gone."""

    role: Role
    client: int
    at_ns: int


@dataclass(frozen=True)
class Said:
    """A page's message, parsed and within all limits."""

    role: Role
    client: int
    message: Incoming
    at_ns: int


@dataclass(frozen=True)
class Reading:
    """A sensor's reading in SI and the tracker's frame.

    `values` are a position (3,) in m, or specific force (3,) in m/s², angular velocity (3,) in rad/s and orientation
    xyzw (4,), NaN where unknown. `stamp_ns` is when it was measured, where that is known; else `sent_ms` may be what
    the sender's own clock said. `seq` is None where the sender does not count.
    """

    stream: str
    stamp_ns: int | None
    arrival_ns: int
    values: Values
    seq: int | None = None
    sent_ms: float | None = None


@dataclass(frozen=True)
class Link:
    """How a stream's sender is connected: `problem` is what is wrong, and what to do; empty where nothing is."""

    stream: str
    problem: str
    at_ns: int


@dataclass(frozen=True)
class ClockOffset:
    """What was measured of a sender's clock: recorder time is the sender's time + `offset_ms`."""

    sender: str
    offset_ms: float
    at_ns: int


@dataclass(frozen=True)
class Tick:
    """Time has passed."""

    at_ns: int


@dataclass(frozen=True)
class Disk:
    """What the journal says now and then; `fault` is why it cannot write, in a sentence with its remedy."""

    at_ns: int
    free_bytes: int
    log_bytes: int | None = None
    written_ns: int | None = None
    fault: str | None = None


@dataclass(frozen=True)
class Saved:
    """A record of `Save` is on disk."""

    token: str
    at_ns: int


@dataclass(frozen=True)
class Closed:
    """A log is under its final name, `file`, or among those set aside; empty where there is none."""

    file: str
    at_ns: int


@dataclass(frozen=True)
class Agreed:
    """What was shown, `shown` estimates, is at most `mm` from the replay of a log."""

    file: str
    mm: float
    shown: int
    at_ns: int


@dataclass(frozen=True)
class Woke:
    """The computer had stopped for `seconds`: it was suspended, or too busy for anything."""

    seconds: float
    at_ns: int


@dataclass(frozen=True)
class WallClock:
    """How far the wall clock is from recorder time by now; `was_set` if it jumped since the last time."""

    off_ms: float
    was_set: bool
    at_ns: int


@dataclass(frozen=True)
class Dropped:
    """How many frames and datagrams were not taken so far, by reason; said when there are more."""

    counts: Mapping[str, int]
    at_ns: int


@dataclass(frozen=True)
class Offer:
    """A sender that was not heard: it sends what it calls `sends`, readings for a stream, from the address `source`."""

    stream: str
    source: str
    sends: str
    rate_hz: int


@dataclass(frozen=True)
class Offered:
    """Who sends just now without being heard; said when that changes."""

    offers: tuple[Offer, ...]
    at_ns: int


@dataclass(frozen=True)
class Examined:
    """What came of `Examine`: of the checks that were seen, and of what the readings claim."""

    seen: tuple[Light, ...]
    claims: tuple[Light, ...]
    at_ns: int


Event = (
    Joined
    | Left
    | Said
    | Reading
    | Link
    | ClockOffset
    | Tick
    | Disk
    | Saved
    | Closed
    | Agreed
    | Woke
    | WallClock
    | Dropped
    | Offered
    | Examined
)


@dataclass(frozen=True)
class Tell:
    """Send a message to one page."""

    client: int
    message: Outgoing


@dataclass(frozen=True)
class Show:
    """Send an estimate to a phone; it was made at `made_ns`, of everything that had arrived by then."""

    client: int
    message: Outgoing
    made_ns: int


@dataclass(frozen=True)
class Open:
    """Begin the log of an attempt, with its facts."""

    participant: str
    condition: str
    facts: Mapping[str, str]


@dataclass(frozen=True)
class Write:
    """Put a message into the open log."""

    message: Message


@dataclass(frozen=True)
class Close:
    """End the open log: under its final name, or set aside."""

    set_aside: bool = False


@dataclass(frozen=True)
class Resolve:
    """Give a log that was cut its final name, or set it (or a finished one) aside."""

    participant: str
    condition: str
    set_aside: bool


@dataclass(frozen=True)
class Save:
    """Append a record to the file of answers; `Saved` comes back with the token once it is on disk."""

    record: Mapping[str, object]
    token: str = ""


@dataclass(frozen=True)
class Tables:
    """Write the study's tables anew."""

    participants: tuple[Mapping[str, str], ...]
    ratings: tuple[Mapping[str, str], ...]


@dataclass(frozen=True)
class Replace:
    """End a page's connection: the same page has another by now."""

    client: int


@dataclass(frozen=True)
class Examine:
    """Check the last readings, beside everything else; `Examined` comes back."""

    request: Request


@dataclass(frozen=True)
class Accept:
    """Let the sender at the address `source` feed a stream, and nobody else."""

    stream: str
    source: str


Action = Tell | Show | Open | Write | Close | Resolve | Save | Tables | Examine | Replace | Accept

Actions = tuple[Action, ...]
NOTHING: Actions = ()
