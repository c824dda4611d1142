"""The messages that go to pages, and their JSON. docs/live_messages.md says what each means."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal


@dataclass(frozen=True)
class Welcome:
    """The task as the phone draws it."""

    TYPE: ClassVar[str] = "welcome"
    task: str
    of: int
    px_per_mm: float
    window_mm: tuple[float, float] | None
    canvas_x_mm: tuple[float, float]
    canvas_y_mm: tuple[float, float]
    path_mm: Sequence[tuple[float, float]]
    targets_mm: Sequence[tuple[float, float]]
    target_diameter_mm: float
    button: Mapping[str, object]
    confirm_ms: float
    window: str
    mouse: bool


@dataclass(frozen=True)
class Pong:
    """The answer to a ping; t2 and t3 in ms of recorder time."""

    TYPE: ClassVar[str] = "pong"
    t1: float
    t2: float
    t3: float


@dataclass(frozen=True)
class Shown:
    """Estimate `n` in mm, for the trial that is under way."""

    TYPE: ClassVar[str] = "show"
    n: int
    x: float
    y: float
    trial: int


PhoneState = Literal["waiting", "checks", "practice", "countdown", "running", "paused", "done", "finished", "second"]


@dataclass(frozen=True)
class PhaseOfTask:
    """Where a phone stands in its task."""

    TYPE: ClassVar[str] = "state"
    state: PhoneState
    trial: int | None = None
    target: int | None = None
    seconds_left: float | None = None


@dataclass(frozen=True)
class Selected:
    """A trial has its selection."""

    TYPE: ClassVar[str] = "selected"
    trial: int


@dataclass(frozen=True)
class Say:
    """A sentence to the participant; empty takes it away. The page has `what` in its own language."""

    TYPE: ClassVar[str] = "say"
    text: str
    what: Literal["", "wait"] = ""


@dataclass(frozen=True)
class Form:
    """A questionnaire to be filled in."""

    TYPE: ClassVar[str] = "form"
    questionnaire: str
    task: str
    title: str | None
    items: Sequence[Mapping[str, object]]
    pairs: Sequence[Mapping[str, object]]
    page: int
    of: int


@dataclass(frozen=True)
class FormState:
    """Why there is no form now."""

    TYPE: ClassVar[str] = "state"
    state: Literal["waiting", "thanks", "finished"]


@dataclass(frozen=True)
class AnswerSaved:
    """An answer is on disk."""

    TYPE: ClassVar[str] = "saved"
    id: str


@dataclass(frozen=True)
class Refused:
    """What was asked for cannot be done, or not without a reason that is given."""

    TYPE: ClassVar[str] = "refused"
    id: str
    why: str
    reason_overrules: bool = False


@dataclass(frozen=True)
class Done:
    """What the operator wanted is done."""

    TYPE: ClassVar[str] = "done"
    id: str


@dataclass(frozen=True)
class Whole:
    """The state, or the lights, for the operator's page."""

    TYPE: ClassVar[str] = ""
    type: Literal["state", "lights"]
    content: Mapping[str, object]


Outgoing = (
    Welcome | Pong | Shown | PhaseOfTask | Selected | Say | Form | FormState | AnswerSaved | Refused | Done | Whole
)


def to_json(message: Outgoing) -> bytes:
    """A message as it is sent."""
    import orjson

    if isinstance(message, Whole):
        return orjson.dumps({"type": message.type, **message.content})
    content = vars(message)
    if any(isinstance(value, float) and not math.isfinite(value) for value in content.values()):
        raise ValueError("a message holds finite numbers only")
    return orjson.dumps({"type": message.TYPE, **content})
