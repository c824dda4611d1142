"""Which of a folder's files are logs, and which of them make one session: a file alone, or the files of a folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pipeline.sessions.logs import READERS, log_suffix
from pipeline.sessions.logs.rosbag2 import METADATA
from pipeline.sessions.logs.tables.named import vectors_of
from pipeline.study.guessing.headers import meaning
from pipeline.study.guessing.shapes import tlx_names
from pipeline.study.guessing.written import NotUsed, Written

_TEXT = (".csv", ".tsv", ".txt", ".tum")
"""Of files that end so a log is known by what they hold, for a table of the study may end so too."""


def logs_among(
    files: Iterable[Path], tables: Mapping[Path, Sequence[Written | NotUsed]], participant: Sequence[str] = ()
) -> list[Path]:
    """The logs among files, of which `tables` holds what was read of the texts.

    A text is one if it names no participants or conditions, by a known header or one of `participant`, is no table of
    trials or ratings, and stands in a folder with another such text: one alone may be anything, a list or notes.
    """
    listed = list(files)
    texts = [path for path in listed if path.suffix.lower() in _TEXT and path.suffix.lower() in READERS]
    others = [path for path in listed if log_suffix(path) in READERS and path not in texts]
    beside = {path.parent for path in others}
    of_sensors = [
        path for path in texts if path.parent not in beside and not _is_of_people(tables.get(path, ()), participant)
    ]
    folders = Counter(path.parent for path in of_sensors)
    return sorted([*others, *(path for path in of_sensors if folders[path.parent] > 1)])


def _is_of_people(tables: Sequence[Written | NotUsed], participant: Sequence[str]) -> bool:
    """Whether a text is a table of the study; events of a log have a column `type`, samples have x, y and z."""
    headers = [header for table in tables if isinstance(table, Written) for header in table.header]
    means = {meaning(header) for header in headers}
    if means & {"participant", "condition"} or any(header in participant for header in headers):
        return True
    is_recorded = "type" in headers or bool(vectors_of(headers, "")[0])
    return bool(not is_recorded and (means & {"trial", "rating", "scale"} or tlx_names(headers)))


def sessions_of(logs: Sequence[Path], files: Iterable[Path]) -> list[Path]:
    """Each session's file, or its folder: of a bag, or one whose files are named as in other such folders."""
    bags = {path.parent for path in files if path.name == METADATA}
    names: dict[Path, set[str]] = {}
    for path in logs:
        names.setdefault(path.parent, set()).add(path.name)
    alike = [folder for folder, own in names.items() if any(own & other for at, other in names.items() if at != folder)]
    folders = bags | set(alike)
    return list(dict.fromkeys(path.parent if path.parent in folders else path for path in logs))
