"""The progress of a run: bars in a terminal, plain lines in a log file."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

_BETWEEN_LINES_S = 10.0


class Progress(Protocol):
    """Shows how far a run is."""

    def begin(self, label: str, total: int, unit: str = "sessions") -> None:
        """A task of `total` steps begins; `label` names the task, `unit` what its steps are."""

    def advance(self) -> None:
        """One step is done."""

    def end(self) -> None:
        """All steps are done."""


class PlainLines:
    """A line when a task begins, and one about every ten seconds while it lasts."""

    def __init__(self) -> None:
        self._label, self._total, self._done, self._last_line_s = "", 0, 0, 0.0

    def begin(self, label: str, total: int, unit: str = "sessions") -> None:
        """Print the task and how many steps it has."""
        self._label, self._total, self._done, self._last_line_s = label, total, 0, time.monotonic()
        _print(f"{label} …" if total == 1 else f"{label}: {total} {unit} …")

    def advance(self) -> None:
        """Count a step; print a line if the last one was over ten seconds ago."""
        self._done += 1
        if time.monotonic() - self._last_line_s > _BETWEEN_LINES_S and self._done < self._total:
            self._last_line_s = time.monotonic()
            _print(f"{self._label}: {self._done} of {self._total}")

    def end(self) -> None:
        """Print nothing: the line of the next task shows that this one is done."""


def _print(text: str) -> None:
    print(text, file=sys.stderr, flush=True)  # noqa: T201 - beside the output, which may go into a file


class Bars:
    """A bar in a terminal for the task that is running; it disappears when the task is done."""

    def __init__(self) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description:<20}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self.live = Progress(*columns, transient=True)
        self._task = self.live.add_task("", total=None, visible=False)

    def begin(self, label: str, total: int, unit: str = "sessions") -> None:
        """Show a bar; there is no room on it for the unit of its steps."""
        del unit
        self.live.update(self._task, visible=False)
        self._task = self.live.add_task(label, total=total)

    def advance(self) -> None:
        """The bar grows by one step."""
        self.live.advance(self._task)

    def end(self) -> None:
        """Hide the bar."""
        self.live.update(self._task, visible=False)


@contextmanager
def show_progress() -> Iterator[Progress]:
    """Bars if stderr is a terminal, otherwise lines."""
    if not sys.stderr.isatty():
        yield PlainLines()
        return
    bars = Bars()
    with bars.live:
        yield bars
