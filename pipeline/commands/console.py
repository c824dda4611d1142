"""What the user sees while things are computed: bars in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from pipeline.engine.resources import Progress

_LABELS = {
    "ingest": "reading logs",
    "fuse": "fusing",
    "assess": "assessing sessions",
    "measure": "measuring",
    "compare": "comparing",
    "report": "writing the report",
    "replay": "replaying",
    "simulate": "simulating",
    "explore": "exploring",
}


_PIECES = {"replay": "sessions by variants", "explore": "small studies"}


def tame(text: str) -> str:
    """Without control characters: a name from a log must not steer the terminal."""
    return "".join("□" if unicodedata.category(c) == "Cc" and c != "\n" else c for c in text)


def say(text: str) -> None:
    """A line of output."""
    print(tame(text), flush=True)  # noqa: T201


def warn(text: str) -> None:
    """A line for the user beside the output."""
    print(tame(text), file=sys.stderr, flush=True)  # noqa: T201


def table(header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> None:
    """Rows in columns: the first `left` columns to the left, the others, numbers, to the right."""
    from rich.cells import cell_len

    lines = [[cell.replace("\n", " ") for cell in line] for line in (header, *rows)]
    widths = [max(map(cell_len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        padded = []
        for place, (cell, width) in enumerate(zip(line, widths, strict=True)):
            room = " " * (width - cell_len(cell))
            padded.append(cell + room if place < left else room + cell)
        say(f"  {'  '.join(padded)}".rstrip())


class PlainLines:
    """Progress for a log file: a line a stage, and one every ten seconds in between."""

    def __init__(self) -> None:
        self._label, self._total, self._done, self._said = "", 0, 0, 0.0

    def begin(self, stage: str, total: int) -> None:
        """A line that says what is coming."""
        self._label, self._total, self._done, self._said = (
            _LABELS.get(stage, stage),
            total,
            0,
            time.monotonic(),
        )
        warn(f"{self._label} …" if total == 1 else f"{self._label}: {total} {_PIECES.get(stage, 'sessions')} …")

    def advance(self) -> None:
        """Now and then a line."""
        self._done += 1
        if time.monotonic() - self._said > 10 and self._done < self._total:
            self._said = time.monotonic()
            warn(f"{self._label}: {self._done} of {self._total}")

    def end(self) -> None:
        """Nothing: the next stage says that this one is done."""


class Bars:
    """Progress in a terminal."""

    def __init__(self) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description:<20}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        self._bars = Progress(*columns, transient=True)
        self._task = self._bars.add_task("", total=None, visible=False)
        self.live = self._bars

    def begin(self, stage: str, total: int) -> None:
        """A bar for the stage."""
        self._bars.update(self._task, visible=False)
        self._task = self._bars.add_task(_LABELS.get(stage, stage), total=total)

    def advance(self) -> None:
        """One further."""
        self._bars.advance(self._task)

    def end(self) -> None:
        """The bar goes."""
        self._bars.update(self._task, visible=False)


@contextmanager
def progress() -> Iterator[Progress]:
    """Bars where someone looks on, lines elsewhere."""
    if not sys.stderr.isatty():
        yield PlainLines()
        return
    bars = Bars()
    with bars.live:
        yield bars
