"""What the user reads in the terminal: lines of output, lines beside it, and tables."""

from __future__ import annotations

import os
import sys
import unicodedata
from collections.abc import Collection, Sequence
from pathlib import Path

_NO_LETTERS = ("Cc", "Cs", "Zl", "Zp")  # control characters, halves of characters, further line breaks
_DIRECTIONS = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def printable(text: str) -> str:
    """Text with control characters replaced: a name from a log must not steer the terminal, nor show text reversed."""
    return "".join(
        "□" if (c in _DIRECTIONS or unicodedata.category(c) in _NO_LETTERS) and c != "\n" else c for c in text
    )


def say(text: str, strong: bool = False) -> None:
    """Print a line of output, a strong one in bold green where the terminal shows colours."""
    shown = printable(text)
    if strong and sys.stdout.isatty() and "NO_COLOR" not in os.environ:
        shown = f"\033[1;32m{shown}\033[0m"
    print(shown, flush=True)  # noqa: T201


def warn(text: str) -> None:
    """Print a line for the user beside the output."""
    print(printable(text), file=sys.stderr, flush=True)  # noqa: T201


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1, strong: Collection[int] = frozenset()
) -> None:
    """Print rows in columns: the first `left` columns to the left, the others, which are numbers, to the right.

    `strong` are the places of the rows that stand out.
    """
    from rich.cells import cell_len

    lines = [[printable(cell.replace("\n", " ")) for cell in line] for line in (header, *rows)]
    widths = [max(map(cell_len, column)) for column in zip(*lines, strict=True)]
    for at, line in enumerate(lines, start=-1):
        padded = []
        for place, (cell, width) in enumerate(zip(line, widths, strict=True)):
            room = " " * (width - cell_len(cell))
            padded.append(cell + room if place < left else room + cell)
        say(f"  {'  '.join(padded)}".rstrip(), strong=at in strong)


def short_path(path: Path) -> str:
    """The path relative to where the user is, if it lies below."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)
