"""The messages of pages and senders: what comes in is checked here, field by field, against every limit there is.

Whatever does not fit raises `MessageError`, is counted by the caller, and has no other effect. docs/live_messages.md
says what each message means; those that go out are in `outgoing`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

VERSION = 1
"""Of these messages, as each page says in its first one; a page that a browser has kept may be of an older one."""
FRAME_BYTES = 4096
"""The longest message of a page."""
DATAGRAM_BYTES = 1472
"""The longest datagram of a sender: what goes through any network in one piece."""
DEPTH = 4
"""How deeply values of a message may be nested."""
_FIGURE = 1e6  # readings, places and the like
_TIME_MS = 1e13  # the year 2286
_WHOLE = 2**53
_DATAGRAMS = 32  # readings in one datagram
_AGENT = 400  # characters
_NOTE = 1000
_ID = 64
_ANSWER_ID = 32

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


class MessageError(ValueError):
    """A message that is not understood; its text says why."""


@dataclass(frozen=True)
class Hello:
    """The first message of a page. `id` is chance that stays the same when a phone's page is loaded anew."""

    page: str
    version: int
    agent: str
    screen: tuple[float, float, float] | None = None
    permission: str = ""
    secure: bool = False
    wake_lock: bool = False
    id: str = ""


@dataclass(frozen=True)
class Exchange:
    """A ping and its answer in ms: sent and received by the sender's clock (t1, t4), by the recorder's (t2, t3)."""

    t1: float
    t2: float
    t3: float
    t4: float


@dataclass(frozen=True)
class Ping:
    """A phone asks what time it is; `last` is the newest answer that it has."""

    t1: float
    last: Exchange | None = None


@dataclass(frozen=True)
class Motion:
    """A phone's accelerometer and gyroscope as the browser gives them: m/s² (gravity in it, and without), °/s, ms."""

    seq: int
    t: float
    a: Three | None
    without_gravity: Three | None
    r: Three | None
    interval: float | None


@dataclass(frozen=True)
class Orientation:
    """A phone's orientation xyzw as the browser gives it, against the earth if `absolute`."""

    seq: int
    t: float
    q: Four
    absolute: bool


@dataclass(frozen=True)
class Drawn:
    """Estimate `n` is on the screen since `t`."""

    n: int
    t: float


@dataclass(frozen=True)
class Select:
    """The button was pressed at `t`, when estimate `n` was on the screen."""

    n: int
    t: float
    pressed_ms: float | None = None


@dataclass(frozen=True)
class Mouse:
    """In a demo: the pointer is at this place of the canvas, in mm."""

    t: float
    x: float
    y: float


@dataclass(frozen=True)
class Visible:
    """Whether the phone's page can be seen."""

    visible: bool
    t: float


@dataclass(frozen=True)
class Battery:
    """How full the phone's battery is, 0 to 1."""

    level: float


@dataclass(frozen=True)
class Answer:
    """One item's answer."""

    questionnaire: str
    item: str
    value: int
    id: str


@dataclass(frozen=True)
class Submit:
    """A questionnaire is filled in."""

    questionnaire: str
    id: str


DEEDS = ("start", "abort", "redo", "keep", "skip", "next", "drop", "note", "swap", "accept", "take_over")


@dataclass(frozen=True)
class Do:
    """What the operator wants done."""

    what: str
    text: str
    id: str


Incoming = Hello | Ping | Motion | Orientation | Drawn | Select | Mouse | Visible | Battery | Answer | Submit | Do


@dataclass(frozen=True)
class Datagram:
    """A sender's reading in its own units and axes; `t` is in s of its clock, None where it states none."""

    key: str
    stream: str
    seq: int | None
    t: float | None
    position: Three | None
    acceleration: Three | None
    angular_velocity: Three | None
    orientation: Four | None


class _Fields:
    """A message's fields, each read with its limits."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        self.content = content

    def number(self, key: str, largest: float = _FIGURE) -> float:
        """A finite number within ± `largest`."""
        return number(self.content.get(key), key, largest)

    def optional(self, key: str, largest: float = _FIGURE) -> float | None:
        """The same, None where it is absent or null."""
        return None if self.content.get(key) is None else self.number(key, largest)

    def time(self, key: str = "t") -> float:
        """A time in ms since the epoch."""
        value = self.number(key, _TIME_MS)
        if value < 0:
            raise MessageError(f"{key} is negative")
        return value

    def whole(self, key: str, largest: int = _WHOLE) -> int:
        """A whole number from 0."""
        value = self.content.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= largest:
            raise MessageError(f"{key} should be a whole number from 0")
        return value

    def truth(self, key: str) -> bool:
        """True or false."""
        value = self.content.get(key)
        if not isinstance(value, bool):
            raise MessageError(f"{key} should be true or false")
        return value

    def text(self, key: str, longest: int = _ID, shortest: int = 1) -> str:
        """Text of limited length."""
        value = self.content.get(key)
        if not isinstance(value, str) or not shortest <= len(value) <= longest:
            raise MessageError(f"{key} should be text of {shortest} to {longest} characters")
        return value

    def vector(self, key: str, length: int, largest: float = _FIGURE) -> Any:
        """Numbers, None where the key is absent or null."""
        value = self.content.get(key)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != length:
            raise MessageError(f"{key} should be {length} numbers")
        return tuple(number(part, key, largest) for part in value)

    def quaternion(self, key: str) -> Four | None:
        """An orientation, whose length must be about 1."""
        q: Four | None = self.vector(key, 4, 2.0)
        if q is not None and not 0.8 < sum(part * part for part in q) < 1.25:
            raise MessageError(f"{key} should be a quaternion of length 1")
        return q


def number(value: object, key: str, largest: float = _FIGURE) -> float:
    """A finite number within ± `largest`. Raises MessageError for anything else."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise MessageError(f"{key} should be a number")
    if not abs(value) <= largest:  # NaN too
        raise MessageError(f"{key} is out of range")
    return float(value)


def _hello(fields_: _Fields) -> Hello:
    screen = fields_.content.get("screen")
    if screen is not None and not isinstance(screen, dict):
        raise MessageError("screen should be an object")
    size = None if screen is None else tuple(_Fields(screen).number(key) for key in ("w", "h", "ratio"))
    given = fields_.content
    return Hello(
        fields_.text("page"),
        fields_.whole("version", 1000),
        str(given.get("agent", ""))[:_AGENT],
        size,  # type: ignore[arg-type]
        str(given.get("permission", ""))[:_ID],
        given.get("secure") is True,
        given.get("wake_lock") is True,
        fields_.text("id", _ID, 0) if given.get("id") is not None else "",
    )


def _ping(fields_: _Fields) -> Ping:
    last = fields_.content.get("last")
    if last is None:
        return Ping(fields_.time("t1"))
    if not isinstance(last, dict):
        raise MessageError("last should be an object")
    times = [_Fields(last).time(key) for key in ("t1", "t2", "t3", "t4")]
    return Ping(fields_.time("t1"), Exchange(*times))


def _motion(fields_: _Fields) -> Motion:
    a, without, r = (fields_.vector(key, 3) for key in ("a", "l", "r"))
    return Motion(fields_.whole("seq"), fields_.time(), a, without, r, fields_.optional("i"))


def _orientation(fields_: _Fields) -> Orientation:
    q = fields_.quaternion("q")
    if q is None:
        raise MessageError("q is missing")
    return Orientation(fields_.whole("seq"), fields_.time(), q, fields_.content.get("absolute") is True)


def _do(fields_: _Fields) -> Do:
    what = fields_.text("what")
    if what not in DEEDS:
        raise MessageError("what is not known")
    text = fields_.text("text", _NOTE, 0) if "text" in fields_.content else ""
    return Do(what, text, fields_.text("id", _ANSWER_ID))


_PHONE: Mapping[str, Callable[[_Fields], Incoming]] = {
    "hello": _hello,
    "ping": _ping,
    "motion": _motion,
    "orientation": _orientation,
    "drawn": lambda f: Drawn(f.whole("n"), f.time()),
    "select": lambda f: Select(f.whole("n"), f.time(), f.optional("pressed_ms")),
    "mouse": lambda f: Mouse(f.time(), f.number("x"), f.number("y")),
    "visible": lambda f: Visible(f.truth("visible"), f.time()),
    "battery": lambda f: Battery(f.number("level", 1.0)),
}
_KNOWN: Mapping[str, Mapping[str, Callable[[_Fields], Incoming]]] = {
    "phone": _PHONE,
    "questionnaire": {
        "hello": _hello,
        "answer": lambda f: Answer(
            f.text("questionnaire"), f.text("item", 2 * _ID), f.whole("value", 1000), f.text("id", _ANSWER_ID)
        ),
        "submit": lambda f: Submit(f.text("questionnaire"), f.text("id", _ANSWER_ID)),
    },
    "operator": {"hello": _hello, "do": _do},
}


def parse(role: str, frame: str | bytes) -> Incoming:
    """A page's message. Raises MessageError for anything that is not one that this role may send."""
    content = loaded(frame, FRAME_BYTES)
    if not isinstance(content, dict):
        raise MessageError("a message is an object")
    read = _KNOWN[role].get(str(content.get("type")))
    if read is None:
        raise MessageError(f"a {role} may not send that type")
    return read(_Fields(content))


def parse_datagram(datagram: bytes) -> tuple[Datagram, ...]:
    """A sender's readings. Raises MessageError where the datagram holds anything else."""
    content = loaded(datagram, DATAGRAM_BYTES)
    listed = content if isinstance(content, list) else [content]
    if not 1 <= len(listed) <= _DATAGRAMS or not all(isinstance(one, dict) for one in listed):
        raise MessageError("a datagram is an object, or a short array of them")
    return tuple(_datagram(_Fields(one)) for one in listed)


def _datagram(fields_: _Fields) -> Datagram:
    seq, t = fields_.content.get("seq"), fields_.optional("t", _TIME_MS)
    position, force, turning = (fields_.vector(key, 3) for key in ("position", "acceleration", "angular_velocity"))
    if (position is None) == (force is None):
        raise MessageError("a reading is a position or an acceleration")
    return Datagram(
        fields_.text("key", 2 * _ID, 0) if "key" in fields_.content else "",
        fields_.text("stream"),
        None if seq is None else fields_.whole("seq"),
        t,
        position,
        force,
        turning,
        fields_.quaternion("orientation"),
    )


def loaded(frame: str | bytes, longest: int) -> Any:
    """JSON of at most `longest` bytes, nested at most `DEPTH` deep. Raises MessageError for anything else."""
    import orjson

    if len(frame) > longest or (isinstance(frame, str) and len(frame.encode("utf-8", "replace")) > longest):
        raise MessageError("it is too long")
    try:
        content = orjson.loads(frame)
    except (ValueError, RecursionError) as error:
        raise MessageError(f"it is not JSON: {error}") from None
    # What opens no more brackets than that cannot be deeper, and most messages do not.
    opened = frame.count("[") + frame.count("{") if isinstance(frame, str) else frame.count(b"[") + frame.count(b"{")
    if opened > DEPTH and _deeper(content, DEPTH):
        raise MessageError("it is nested too deeply")
    return content


def _deeper(value: object, depth: int) -> bool:
    if isinstance(value, dict):
        return depth == 0 or any(_deeper(part, depth - 1) for part in value.values())
    if isinstance(value, list):
        return depth == 0 or any(_deeper(part, depth - 1) for part in value)
    return False
