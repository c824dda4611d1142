"""Positions and accelerations in protobuf: the stock decoder, and many messages at once by templates.

Fields are found by their names in the log's own descriptor, so a message may be Foxglove's or a ROS type in protobuf.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import DecodeError, Message
from google.protobuf.unknown_fields import UnknownFieldSet
from mcap.records import Channel, Schema
from mcap_protobuf.decoder import DecoderFactory

from pipeline.sessions.logs.log import USUAL, BoolArray, IntArray, Source
from pipeline.sessions.logs.mcap.fields import (
    UNFIT,
    Decoder,
    Fields,
    Reading,
    check_size,
    check_stamp,
)
from pipeline.sessions.logs.mcap.layout import (
    COVARIANCE,
    EACH,
    FORCE,
    LEAVES_LIMIT,
    NANOSECONDS,
    RATE,
    SECONDS,
    STAMPS,
    TURN,
    VECTORS,
    Kind,
    NamePath,
    Path,
    find_layout,
)
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.protobuf_template import Template
from pipeline.sessions.logs.mcap.templates import Bytes, read_by_templates
from pipeline.sessions.logs.mcap.tree import leave_to_one, reading

_DEPTH_LIMIT = 8
_SCHEMA_LIMIT = 256 * 1024  # bytes; Foxglove's take up to ten thousand
_WHOLE_NUMBERS = frozenset(
    getattr(FieldDescriptor, f"TYPE_{name}")
    for name in ("INT32", "INT64", "UINT32", "UINT64", "SINT32", "SINT64", "FIXED32", "FIXED64", "SFIXED32", "SFIXED64")
)
_FIGURES = frozenset({FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT})


@dataclass(frozen=True)
class _Layout:
    """The paths of a stamp's two fields, of the used values, and of the messages that must be present."""

    stamp: tuple[NamePath, NamePath]
    figures: tuple[NamePath, ...]
    needed: tuple[NamePath, ...]

    @property
    def leaves(self) -> tuple[NamePath, ...]:
        """Stamp and figures, in the order of `Template.read`."""
        return (*self.stamp, *self.figures)

    @property
    def parents(self) -> tuple[NamePath, ...]:
        """Every message on the way to a leaf."""
        ways = (leaf[:depth] for leaf in self.leaves for depth in range(len(leaf)))
        return tuple(dict.fromkeys(ways))


def decoder(channel: Channel, schema: Schema | None, content: str, source: Source = USUAL) -> Decoder:
    """The decoder of a channel. Raises ValueError or McapError if the schema lacks needed fields or cannot be read."""
    if schema is None:
        raise ValueError("it has no schema, and protobuf cannot be read without")
    if schema.encoding != "protobuf":
        raise ValueError(f'its schema is written as "{schema.encoding}", not protobuf')
    if len(schema.data) > _SCHEMA_LIMIT:
        raise ValueError(f"its schema is {len(schema.data) // 1024} KiB long, which no sensor's message takes")
    try:
        decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
        assert decode is not None  # noqa: S101
        descriptor = decode(b"").DESCRIPTOR
    except (DecodeError, TypeError, KeyError) as error:
        raise ValueError(f"its schema cannot be read: {error}") from error
    leaves = leaves_of(descriptor)
    if source != USUAL or _is_unusual(leaves, content):
        return _by_paths(decode, leaves, descriptor.full_name, content, source)
    layout = _layout(descriptor, content)

    def one(payload: bytes) -> Reading:
        check_size(payload)
        try:
            message = decode(payload)
        except DecodeError as error:
            raise ValueError(UNFIT) from error
        _check_whole(message, layout)
        seconds, nanoseconds = (int(_value(message, path)) for path in layout.stamp)
        check_stamp(seconds, nanoseconds)
        return Reading(seconds, nanoseconds, [float(_value(message, path)) for path in layout.figures])

    def many(messages: Messages, which: IntArray, fields: Fields) -> None:
        def read_alike(rows: Bytes, own: IntArray) -> BoolArray:
            read = Template.of(rows[0], descriptor, layout.leaves, one).read(rows)
            fields.take(own[read.fits], read, np.flatnonzero(read.fits))
            return read.fits

        read_by_templates(messages, which, read_alike)

    return Decoder(one, many)


def _is_unusual(leaves: Mapping[Path, Kind], content: str) -> bool:
    """Whether a type has its fields where only `tree` looks for them: in arrays, or under other names than Imu's."""
    if content != "acceleration":
        return content == "velocity" or any(path[:2] == ("transforms", EACH) for path in leaves)
    return (FORCE, "x") not in leaves and any((*path, "x") in leaves for path in VECTORS[content])


def _by_paths(
    decode: Callable[[bytes], Any], leaves: Mapping[Path, Kind], name: str, content: str, source: Source
) -> Decoder:
    """A decoder by the stock package alone, for what templates do not take."""
    layout = find_layout(leaves, name, content, source)

    def one(payload: bytes) -> Reading:
        check_size(payload)
        try:
            message = decode(payload)
        except DecodeError as error:
            raise ValueError(UNFIT) from error
        return reading(message, layout, source)

    return Decoder(one, leave_to_one)


def leaves_of(descriptor: Descriptor) -> dict[Path, Kind]:
    """The paths of the figures and texts in messages of a type."""
    found: dict[Path, Kind] = {}

    def descend(inner: Descriptor, path: Path) -> None:
        for field in inner.fields:
            own: Path = (*path, field.name, EACH) if field.is_repeated else (*path, field.name)
            if field.message_type is not None:
                if len(own) < _DEPTH_LIMIT and len(found) < LEAVES_LIMIT:
                    descend(field.message_type, own)
            elif field.type in _FIGURES | _WHOLE_NUMBERS:
                found[own] = "number"
            elif field.type == FieldDescriptor.TYPE_STRING:
                found[own] = "text"

    descend(descriptor, ())
    return found


def _layout(descriptor: Descriptor, content: str) -> _Layout:
    """The paths of the needed fields. Raises ValueError that names one which is missing or of another type."""
    stamp = _first_present(descriptor, STAMPS)
    seconds = _first_present(descriptor, tuple((*stamp, name) for name in SECONDS))
    nanoseconds = _first_present(descriptor, tuple((*stamp, name) for name in NANOSECONDS))
    if content == "position":
        point = _first_present(descriptor, VECTORS["position"])
        vectors = [(point, "xyz")]
    else:
        vectors = [((FORCE,), "xyz"), ((RATE,), "xyz"), ((TURN,), "xyzw")]
    needed = (stamp, *(path for path, _ in vectors if path != (TURN,)))
    figures = [(*path, axis) for path, axes in vectors for axis in axes]
    if content == "acceleration":
        figures.append((COVARIANCE,))
    for path in (seconds, nanoseconds, *figures):
        _check_type(descriptor, path, _FIGURES if path in figures else _WHOLE_NUMBERS)
    return _Layout((seconds, nanoseconds), tuple(figures), needed)


def _first_present(descriptor: Descriptor, paths: Any) -> NamePath:
    for path in paths:
        if _field(descriptor, path) is not None:
            return tuple(path)
    raise ValueError(f"its schema, {descriptor.full_name}, has no {' or '.join('.'.join(path) for path in paths)}")


def _field(descriptor: Descriptor | None, path: NamePath) -> FieldDescriptor | None:
    """The field at the end of the path, through single messages only; None where there is none."""
    field = None
    for name in path:
        if descriptor is None or (field is not None and field.is_repeated):
            return None
        field = descriptor.fields_by_name.get(name)
        if field is None:
            return None
        descriptor = field.message_type
    return field


def _check_type(descriptor: Descriptor, path: NamePath, kinds: frozenset[int]) -> None:
    field = _field(descriptor, path)
    if field is None:
        raise ValueError(f"its schema, {descriptor.full_name}, has no {'.'.join(path)}")
    if field.type not in kinds or field.is_repeated != (path == (COVARIANCE,)):
        wanted = "a number" if kinds is _FIGURES else "a whole number"
        raise ValueError(f"its schema, {descriptor.full_name}, does not hold {wanted} as {'.'.join(path)}")


def _check_whole(message: Message, layout: _Layout) -> None:
    """Raise ValueError for a missing needed message, or for a field that the schema lacks, which protobuf ignores."""
    for path in layout.parents:
        part, there = message, True
        for depth, name in enumerate(path):
            there = there and part.HasField(name)
            if not there and path[: depth + 1] in (needed[: depth + 1] for needed in layout.needed):
                raise ValueError(f"it has no {'.'.join(path[: depth + 1])}")
            part = getattr(part, name)
        if there and len(UnknownFieldSet(part)):
            raise ValueError(UNFIT)


def _value(message: Any, path: NamePath) -> Any:
    """A field's value, the first one of a list; a field that is not sent is zero in protobuf."""
    for name in path:
        message = getattr(message, name)
    return next(chain(message, (0.0,))) if path == (COVARIANCE,) else message
