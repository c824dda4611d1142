"""Tables of which each participant (condition, session) has a file of their own: `trials: trials/{participant}.csv`.

The placeholders are those of `sessions`. What the names of the files say is put beside each row, and where the rows say
it too, both must tell the same people apart.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.errors import PipelineError
from pipeline.study.fields import identifier
from pipeline.study.session import ANY, PLACEHOLDER, PLACEHOLDERS, expression


@dataclass(frozen=True)
class Part:
    """One file of a table, its path in the study, and what its name says: {"participant": "P01"}."""

    path: Path
    name: str
    named: Mapping[str, str] = field(default_factory=dict)


def is_split(name: str) -> bool:
    """Whether a table's name in study.yaml is a pattern of several files' names."""
    return any(placeholder in PLACEHOLDERS for placeholder in PLACEHOLDER.findall(name))


def check_name(key: str, name: str) -> None:
    """Raise ValueError for a placeholder that is not known, or a pattern that could match anything."""
    for placeholder in PLACEHOLDER.findall(name):
        if placeholder not in PLACEHOLDERS:
            known = ", ".join(f"{{{one}}}" for one in PLACEHOLDERS)
            raise ValueError(f'{key}: placeholder "{{{placeholder}}}" is not known; these are: {known}')
    if is_split(name) and ANY in name:
        raise ValueError(f'{key}: "*" may not stand in the name of a table')


def parts_of(folder: Path, name: str) -> list[Part]:
    """The files of a table that is split, by their names; none of one that is not."""
    if not is_split(name):
        return []
    root, fits = folder.resolve(), expression(name)
    found = []
    begin = (root / f"{PLACEHOLDER.split(name)[0]}_").parent  # the last folder without a placeholder
    if not begin.resolve().is_relative_to(root):
        return []
    for path in sorted(begin.rglob("*")):
        relative = path.relative_to(root).as_posix()
        match = fits.fullmatch(unicodedata.normalize("NFC", relative))
        if match and path.is_file() and path.resolve().is_relative_to(root):
            found.append(Part(path, relative, match.groupdict()))
    return found


def files_of(folder: Path, name: str) -> list[Path]:
    """The files of a table, split or not; it need not exist."""
    return [part.path for part in parts_of(folder, name)] if is_split(name) else [folder / name]


def of_table(name: str, files: Iterable[str]) -> list[str]:
    """Which of some files' names are those of a table."""
    if not is_split(name):
        return [Path(name).as_posix()]
    fits = expression(name)
    return [one for one in files if fits.fullmatch(unicodedata.normalize("NFC", one))]


def check_told_apart(name: str, key: str, said: Sequence[tuple[str, frozenset[str]]]) -> None:
    """Raise PipelineError where files' names and their own column `key` contradict each other.

    `said` has for each file what its name says, and what stands in its column.
    """
    by_value: dict[str, str] = {}
    by_name: dict[str, str] = {}
    for in_name, values in said:
        if len(values) > 1:
            raise PipelineError(
                f'{name}: the file of {key} "{in_name}" has rows of {", ".join(sorted(values)[:5])} too; keep the rows '
                f"of each {key} in a file of their own, or all of them in one file"
            )
        (value,) = values or {in_name}
        if by_value.setdefault(value, in_name) != in_name or by_name.setdefault(in_name, value) != value:
            raise PipelineError(
                f'{name}: the rows of {key} "{value}" are in the file of "{in_name}", and others say otherwise; one of '
                "the names or columns is wrong"
            )


def named_identifiers(part: Part) -> dict[str, str]:
    """What a file's name says, as it is compared everywhere."""
    return {key: str(identifier(value)) for key, value in part.named.items()}
