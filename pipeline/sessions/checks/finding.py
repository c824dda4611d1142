"""The result of a check: one row of the table `checks`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Literal

from pipeline.tables.table import Row

Status = Literal["green", "amber", "red"]


@dataclass(frozen=True)
class Finding:
    """`found` and `expected` as people read them; `message` names the likely cause and the remedy.

    Where green it is "", but for what contradicts nothing and a reader should know all the same.
    """

    check: str
    status: Status
    found: str
    expected: str
    message: str = ""


def rows_of(findings: Iterable[Finding], session: str | None = None) -> list[Row]:
    """Rows of the table `checks`, of a session or of the study's own tables."""
    return [{"session": session, **asdict(finding), "message": finding.message or None} for finding in findings]


def of(check: str, stream: str) -> str:
    """The name of a check of one stream, such as `rate: tracker`; the part before the colon is the same everywhere."""
    return f"{check}: {stream}"


def graded(value: float, amber: float, red: float) -> Status:
    """The status of a figure that is worse the larger it is."""
    return "red" if value > red else "amber" if value > amber else "green"
