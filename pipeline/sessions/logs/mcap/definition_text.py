"""Message definitions of ROS 2 (ros2msg) and ROS 1 (ros1msg) as trees of fields.

A text holds the message's own fields, then those of every message within it, each behind a line of "=" and a line
"MSG: package/Name". (https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html, wiki.ros.org/msg)
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pipeline.sessions.logs.mcap.layout import EACH, Kind, Path, within_limit

_TEXT_LIMIT = 64 * 1024  # bytes; an Odometry's takes 6 KiB with every comment
_DEPTH_LIMIT = 12

SIZES: Mapping[str, tuple[str, int]] = {
    "bool": ("?", 1),
    "byte": ("B", 1),
    "char": ("B", 1),
    "int8": ("b", 1),
    "uint8": ("B", 1),
    "int16": ("h", 2),
    "uint16": ("H", 2),
    "int32": ("i", 4),
    "uint32": ("I", 4),
    "int64": ("q", 8),
    "uint64": ("Q", 8),
    "float32": ("f", 4),
    "float64": ("d", 8),
}
"""The code in `struct` and the bytes of a number, by its type."""

_SEPARATOR = re.compile(r"^=+[ \t]*$", re.MULTILINE)
_FIELD = re.compile(r"(?P<kind>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?:<=)?\d*\])?\s+(?P<name>\w+)\s*(?P<constant>=)?")


@dataclass(frozen=True)
class Field:
    """A field: its type, and how many there are of it: None for one, -1 for a number that the message states."""

    name: str
    kind: str
    count: int | None


@dataclass(frozen=True)
class Definition:
    """The fields of a message, and of every message within it by its name `package/Name`."""

    name: str
    messages: Mapping[str, tuple[Field, ...]]

    def leaves(self) -> dict[Path, Kind]:
        """The path and kind of every figure and text. ValueError where there are more than any sensor's message has."""
        return within_limit(self._leaves(self.name, (), _DEPTH_LIMIT))

    def _leaves(self, message: str, before: Path, depth: int) -> Iterator[tuple[Path, Kind]]:
        if depth == 0:
            raise ValueError(f"its schema describes messages within messages, more than {_DEPTH_LIMIT} deep")
        for field in self.messages[message]:
            path = (*before, field.name) if field.count is None else (*before, field.name, EACH)
            if field.kind in self.messages:
                yield from self._leaves(field.kind, path, depth - 1)
            else:
                yield path, "number" if field.kind in SIZES else "text"


def parse(name: str, text: bytes) -> Definition:
    """A message's definition. ValueError where it cannot be read, or lacks the definition of a message within it."""
    if len(text) > _TEXT_LIMIT:
        raise ValueError(f"its schema is {len(text) // 1024} KiB long, which no sensor's message takes")
    own, *others = _SEPARATOR.split(text.decode())
    whole = short_name(name)
    messages = {
        "builtin_interfaces/Time": (Field("sec", "int32", None), Field("nanosec", "uint32", None)),
        "builtin_interfaces/Duration": (Field("sec", "int32", None), Field("nanosec", "uint32", None)),
        "time": (Field("secs", "uint32", None), Field("nsecs", "uint32", None)),
        "duration": (Field("secs", "int32", None), Field("nsecs", "int32", None)),
        whole: _fields(own, whole),
    }
    for other in others:
        head, _, body = other.strip().partition("\n")
        if not head.startswith("MSG:"):
            raise ValueError(f'its schema cannot be read: "{head[:60]}" is not the name of a message')
        inner = short_name(head.removeprefix("MSG:").strip())
        messages[inner] = _fields(body, inner)
    for fields in list(messages.values()):
        for field in fields:
            if field.kind not in SIZES and field.kind not in messages and field.kind not in ("string", "wstring"):
                raise ValueError(f'its schema cannot be read: it does not say what "{field.kind}" is')
    return Definition(whole, messages)


def short_name(name: str) -> str:
    """`package/Name` of `package/msg/Name`."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


def _fields(text: str, message: str) -> tuple[Field, ...]:
    fields = []
    for line in text.splitlines():
        stripped = line.split("#")[0].strip()
        if not stripped:
            continue
        match = _FIELD.match(stripped)
        if match is None:
            raise ValueError(f'its schema cannot be read: "{stripped[:60]}" is no field')
        if match["constant"] is None:
            fields.append(Field(match["name"], _full(match["kind"], message), _count(match["array"])))
    return tuple(fields)


def _full(kind: str, message: str) -> str:
    if kind in SIZES or kind in ("string", "wstring", "time", "duration"):
        return kind
    if "/" in kind:
        return short_name(kind)
    return "std_msgs/Header" if kind == "Header" else f"{message.split('/', maxsplit=1)[0]}/{kind}"


def _count(array: str | None) -> int | None:
    if array is None:
        return None
    return int(array[1:-1]) if array[1:-1].isdigit() else -1
