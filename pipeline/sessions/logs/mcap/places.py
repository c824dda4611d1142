"""Where the fields of one message lie in its bytes, whatever its encoding."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import lru_cache

from pipeline.sessions.logs.mcap.layout import Path

Place = tuple[int, str]
"""A figure's first byte, and its code in `struct` with the byte order, such as "<d"."""


@dataclass
class Places:
    """Where a message's figures are, by path; its texts; how long its arrays are; figures that it leaves out.

    `fixed` are the spans that must be the same in a message laid out like it: lengths, texts and references. `unsent`
    are figures that have the value of their type's definition because the message does not hold them.
    """

    figures: dict[Path, Place] = field(default_factory=dict)
    texts: dict[Path, str] = field(default_factory=dict)
    counts: dict[Path, int] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    unsent: dict[Path, float] = field(default_factory=dict)


def figure(payload: bytes, place: Place) -> float:
    """One figure of a message."""
    begin, code = place
    value: float = _struct(code).unpack_from(payload, begin)[0]
    return value


@lru_cache(maxsize=64)
def _struct(code: str) -> struct.Struct:
    return struct.Struct(code)
