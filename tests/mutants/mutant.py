"""One fault: a piece of source text and what stands in its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType


@dataclass(frozen=True)
class Mutant:
    """`old` occurs once in all sources and is looked for in all of them, so that a file may move.

    `tests` are the modules that should notice. `equivalent` says why no test can, where that is so.
    """

    old: str
    new: str
    tests: tuple[ModuleType, ...]
    equivalent: str = ""

    @property
    def change(self) -> str:
        """Its first line that changes, before and after."""
        olds, news = self.old.splitlines(), self.new.splitlines() or [""]
        for old, new in zip(olds, news, strict=False):
            if old != new:
                return f"{old.strip()}  →  {new.strip() or '(nothing)'}"
        return f"{olds[len(news)].strip()}  →  (nothing)"


def place(mutant: Mutant, sources: Mapping[Path, str]) -> Path | str:
    """The source that holds a mutant's text; what is wrong where it is not exactly one, once."""
    holding = [path for path, text in sources.items() if mutant.old in text]
    if not holding:
        return "its text no longer occurs"
    times = sum(sources[path].count(mutant.old) for path in holding)
    return holding[0] if times == 1 else f"its text occurs {times} times"
