"""The result of a check: one row of the table `checks`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Status = Literal["green", "amber", "red"]


@dataclass(frozen=True)
class Finding:
    """`found` and `expected` as people read them; `message` names the likely cause and the remedy, "" where green."""

    check: str
    status: Status
    found: str
    expected: str
    message: str = ""


def of(check: str, stream: str) -> str:
    """The name of a check of one stream, such as `rate: tracker`; the part before the colon is the same everywhere."""
    return f"{check}: {stream}"


def graded(value: float, amber: float, red: float) -> Status:
    """The status of a figure that is worse the larger it is."""
    return "red" if value > red else "amber" if value > amber else "green"
