"""Which part of a message a stream's layout means: the element of an array that is of the wanted frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.sessions.logs.log import Source
from pipeline.sessions.logs.mcap.layout import EACH, Layout, Path


class OtherFrameError(ValueError):
    """A message that is sound and does not speak of the wanted frame."""


@dataclass(frozen=True)
class Picked:
    """An array's index to put in place of `EACH`, and the name of the frame whose movement is read."""

    index: int | None
    child: str | None


def pick(layout: Layout, source: Source, count: Callable[[Path], int], text: Callable[[Path], str]) -> Picked:
    """The element to read. `count` gives the length of the array at a path, `text` the text at a path.

    Raises OtherFrameError where none is of the wanted child and parent, ValueError where it is unknown which to read.
    """
    array = next((path for path in (layout.child, *layout.figures) if path is not None and EACH in path), None)
    if array is None:
        indices: list[int | None] = [None]
    else:
        indices = list(range(count(array[: array.index(EACH)])))
    children = [None if layout.child is None else text(at(layout.child, index)) for index in indices]
    fitting = [
        (index, child)
        for index, child in zip(indices, children, strict=True)
        if source.child in (None, child)
        and (source.parent is None or layout.parent is None or text(at(layout.parent, index)) == source.parent)
    ]
    if not fitting:
        raise OtherFrameError("it is of another frame")
    if len(fitting) > 1:
        names = ", ".join(f'"{child}"' for _, child in fitting)
        raise ValueError(f"it holds the frames {names}; say in study.yaml which one is meant by `child:`")
    return Picked(*fitting[0])


def at(path: Path, index: int | None) -> Path:
    """The path with an index in place of `EACH`."""
    return path if index is None else tuple(index if step == EACH else step for step in path)
