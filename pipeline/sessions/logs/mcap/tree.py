"""Reads a message that its stock decoder has turned to Python objects, one by one: objects of attributes, or mappings.

This is the way of what no fast path takes: arrays of messages, frames to choose from, paths stated in study.yaml.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from pipeline.sessions.logs.log import Source
from pipeline.sessions.logs.mcap.fields import Fields, Reading
from pipeline.sessions.logs.mcap.layout import EACH, Kind, Layout, Path, find_layout, written
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.pick import at, pick
from pipeline.sessions.logs.mcap.stamps import split_stamp

_DEPTH_LIMIT = 8


def leave_to_one(_: Messages, __: Any, ___: Fields) -> None:
    """The `many` of a decoder without a fast path."""


def reading(message: Any, layout: Layout, source: Source) -> Reading:
    """What a stream reads of a message. Raises OtherFrameError, or ValueError where something is missing or unfit."""
    picked = pick(layout, source, lambda path: len(value_at(message, path)), lambda path: str(value_at(message, path)))
    stamp = [_moment(value_at(message, at(path, picked.index))) for path in layout.stamp]
    seconds, nanoseconds = split_stamp(stamp, source.stamp_unit_s or 1.0)
    values = [0.0 if path is None else _number(message, at(path, picked.index)) for path in layout.figures]
    parent = None if layout.parent is None else str(value_at(message, at(layout.parent, picked.index)))
    return Reading(seconds, nanoseconds, values, picked.child, parent)


def value_at(message: Any, path: Path) -> Any:
    """What stands at a path. ValueError where there is nothing."""
    for depth, step in enumerate(path):
        try:
            is_indexed = isinstance(step, int) or isinstance(message, Mapping)
            message = message[step] if is_indexed else getattr(message, str(step))
        except (LookupError, AttributeError, TypeError):
            raise ValueError(f"it has no {written(path[: depth + 1])}") from None
    return message


def _number(message: Any, path: Path) -> float:
    value = value_at(message, path)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"its {written(path)} is not a number")
    return float(value)


def _moment(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("its stamp is not a number")
    return value


def leaves_of(message: Any) -> dict[Path, Kind]:
    """The paths of the figures and texts in a message of mappings and lists; of a list, those of its first element."""
    found: dict[Path, Kind] = {}

    def descend(value: Any, path: Path) -> None:
        if len(path) > _DEPTH_LIMIT:
            return
        if isinstance(value, Mapping):
            for name, inner in value.items():
                descend(inner, (*path, name))
        elif isinstance(value, Sequence) and not isinstance(value, str | bytes):
            for inner in value[:1]:
                descend(inner, (*path, EACH))
        elif isinstance(value, str):
            found[path] = "text"
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found[path] = "number"

    descend(message, ())
    return found


class Layouts:
    """The layout of messages that do not say their type beforehand, found once for each set of paths in them."""

    def __init__(self, type_name: str, content: str, source: Source) -> None:
        self._type_name, self._content, self._source = type_name, content, source
        self._known: dict[frozenset[Path], Layout] = {}

    def of(self, message: Any) -> Layout:
        """The layout of a message."""
        leaves = leaves_of(message)
        paths = frozenset(leaves)
        if paths not in self._known:
            self._known[paths] = find_layout(leaves, self._type_name, self._content, self._source)
        return self._known[paths]


def with_numbers_for_iso_times(message: Any, key: str) -> Any:
    """A JSON message whose stamp, if it is a text in ISO 8601, is given as seconds and nanoseconds."""
    stamp = message.get(key) if isinstance(message, dict) else None
    if isinstance(stamp, str):
        moment = datetime.fromisoformat(stamp)
        moment = moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)
        since = moment - datetime(1970, 1, 1, tzinfo=UTC)
        seconds = since.days * 86_400 + since.seconds
        fraction = stamp.partition(".")[2]
        digits = _leading_digits(fraction)[:9]
        nanoseconds = int(digits.ljust(9, "0"))
        return {**message, key: {"sec": seconds, "nsec": nanoseconds}}
    return message


def _leading_digits(text: str) -> str:
    return text[: len(text) - len(text.lstrip("0123456789"))]
