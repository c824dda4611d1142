"""Names of files in a BIDS dataset, whose labels hold letters and digits alone."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pipeline.study.session import Session


def labels(names: Iterable[str]) -> dict[str, str]:
    """A label for each name, different ones for different names; capital letters do not tell files apart everywhere."""
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        plain = re.sub(r"[^a-zA-Z0-9]", "", name) or "x"
        label, number = plain, 1
        while label.casefold() in taken:
            number += 1
            label = f"{plain}x{number}"
        taken.add(label.casefold())
        found[name] = label
    return found


@dataclass(frozen=True)
class Names:
    """One session's labels; `run` counts the sessions of one participant in one condition, None for a single one."""

    subject: str
    condition: str | None
    run: int | None

    def stem(self, task: str, system: str | None = None) -> str:
        """What the names of its files begin with, in the order that BIDS requires: tracksys before acq."""
        parts = {
            "sub": self.subject,
            "task": task,
            "tracksys": system,
            "acq": self.condition,
            "run": None if self.run is None else f"{self.run:02d}",
        }
        return "_".join(f"{key}-{value}" for key, value in parts.items() if value is not None)


def names_of(sessions: Sequence[Session], people: Mapping[str, str]) -> list[Names]:
    """The labels of each session, by those of the participants."""
    conditions = labels(session.condition for session in sessions if session.condition is not None)
    own = [(people[str(session.participant)], conditions.get(session.condition or "")) for session in sessions]
    return [
        Names(*pair, run=1 + own[:index].count(pair) if own.count(pair) > 1 else None) for index, pair in enumerate(own)
    ]
