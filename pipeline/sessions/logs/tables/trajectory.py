"""Trajectories without a line of names: time, x, y, z, and an orientation xyzw, as TUM's and KITTI's tools write them.

(https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats: "timestamp tx ty tz qx qy qz qw", in s and m.)
"""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.sessions.logs.tables.sheet import Sheet
from pipeline.sessions.logs.tables.text import Text, separator_of, table_of

NAMES = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
_EUROC = "#timestamp [ns]"
_COMMENT = re.compile(r"^\s*#.*$\n?", re.MULTILINE)


def recognised(text: Text) -> bool:
    """Whether the first line that is no comment holds eight numbers and nothing else."""
    if text.head[0].startswith(_EUROC):  # whose orientations begin with w
        return False
    first = next((line for line in text.head if line.strip() and not line.lstrip().startswith("#")), "")
    cells = re.split(r"[,;\s]+", first.strip())
    return len(cells) == len(NAMES) and all(map(_is_number, cells))


def sheets(path: Path, text: Text) -> list[Sheet]:
    """The one body of a trajectory."""
    lines = _COMMENT.sub("", text.whole)
    separator = separator_of(lines.partition("\n")[0])
    if separator == " ":
        lines = re.sub(r"[ \t]+", " ", re.sub(r"^[ \t]+|[ \t]+$", "", lines, flags=re.MULTILINE))
    table = table_of(lines, NAMES, separator)
    vectors = {"position": NAMES[1:4], "orientation": NAMES[4:]}
    return [Sheet(path.stem, "trajectory", table, "timestamp", {"timestamp": 1.0}, vectors, {"position": 1.0})]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
