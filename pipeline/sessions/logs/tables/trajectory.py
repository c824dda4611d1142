"""Trajectories without a line of names: time, x, y, z, and an orientation xyzw, as TUM's and KITTI's tools write them.

(https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats: "timestamp tx ty tz qx qy qz qw", in s and m.)
"""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.sessions.logs.tables.sheet import Sheet
from pipeline.sessions.logs.tables.table import table_of
from pipeline.sessions.logs.tables.text import Text, separator_of

NAMES = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
_EUROC = "#timestamp [ns]"
_COMMENT = re.compile(rb"^[ \t]*#.*$\n?", re.MULTILINE)


def recognised(text: Text) -> bool:
    """Whether the first line that is no comment holds eight numbers and nothing else."""
    if text.head[0].startswith(_EUROC):  # whose orientations begin with w
        return False
    first = next((line for line in text.head if line.strip() and not line.lstrip().startswith("#")), "")
    cells = re.split(r"[,;\s]+", first.strip())
    return len(cells) == len(NAMES) and all(map(_is_number, cells))


def sheets(path: Path, text: Text) -> list[Sheet]:
    """The one body of a trajectory."""
    leading = next(index for index, line in enumerate(text.head) if not line.lstrip().startswith("#"))
    lines = bytes(text.below(leading))
    if b"#" in lines:
        lines = _COMMENT.sub(b"", lines)
    separator = separator_of(lines[: lines.find(b"\n")].decode())
    if separator == " " and any(_is_aligned(line) for line in text.head[leading:]):
        lines = _with_single_spaces(lines)
    table = table_of(lines, NAMES, separator, stamp=NAMES[0])
    if separator == " " and table.lost:  # lines of which some are aligned, far below
        table = table_of(_with_single_spaces(lines), NAMES, separator, stamp=NAMES[0])
    vectors = {"position": NAMES[1:4], "orientation": NAMES[4:]}
    return [Sheet(path.stem, "trajectory", table, "timestamp", {"timestamp": 1.0}, vectors, {"position": 1.0})]


def _is_aligned(line: str) -> bool:
    return line != " ".join(line.split())


def _with_single_spaces(lines: bytes) -> bytes:
    """Lines with one space between their cells, and none before or behind them."""
    for mark, single in ((b"\t", b" "), (b"  ", b" "), (b"\n ", b"\n"), (b" \n", b"\n")):
        before = -1
        while before != len(lines):
            before, lines = len(lines), lines.replace(mark, single)
    return lines.strip(b" ")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
