"""Which option moves a file elsewhere that cannot be read or written where it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from pipeline.engine.folders import CACHE_FOLDER, reports_folder

_OPTIONS = ("--cache", "--out", "--junit")


def remedy(error: OSError, command: Sequence[str]) -> str:
    """`; choose another place with --out`, where the error is of a file below that option's folder; else nothing."""
    if not isinstance(error.filename, str):
        return ""
    path = Path(error.filename).absolute()
    for option, place in _places(command):
        if path.is_relative_to(place.absolute()) or place.absolute().is_relative_to(path):
            return f"; choose another place with {option}"
    return ""


def _places(command: Sequence[str]) -> Iterator[tuple[str, Path]]:
    """Where the options of a command put things, as given and, after that, by default."""
    for at, word in enumerate(command):
        option, equals, value = word.partition("=")
        if option in _OPTIONS and equals:
            yield option, Path(value)
        elif word in _OPTIONS and at + 1 < len(command):
            yield word, Path(command[at + 1])
    if not any(word.partition("=")[0] == "--cache" for word in command):
        yield "--cache", reports_folder().parent / CACHE_FOLDER
    if not any(word.partition("=")[0] == "--out" for word in command):
        yield "--out", reports_folder()
