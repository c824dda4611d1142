"""Protobuf messages of one shape: the same fields in the same order, each as long, so each at the same place.

One message is taken apart by its descriptor; in others like it every tag, length and name must be the same byte, and
every number that varies in length must end where it ends there. Then all figures are at known places.
(https://protobuf.dev/programming-guides/encoding: tag = number << 3 | wire type; base-128 varints, lowest first.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from google.protobuf.descriptor import Descriptor, FieldDescriptor

from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.mcap.fields import Fields, Reading, holds_stamps
from pipeline.sessions.logs.mcap.layout import NamePath
from pipeline.sessions.logs.mcap.templates import Bytes, Declined
from pipeline.statistics.arrays import FloatArray

_VARINT, _FIXED64, _LENGTH, _FIXED32 = 0, 1, 2, 5
_DEPTH_LIMIT = 8
_VARINT_LIMIT = 9  # bytes, so that it fits 63 bits; negative numbers take ten
_SIZES = {_FIXED64: 8, _FIXED32: 4}
_FLOATS = {FieldDescriptor.TYPE_DOUBLE: 8, FieldDescriptor.TYPE_FLOAT: 4}
_WHOLE = frozenset(
    {FieldDescriptor.TYPE_INT32, FieldDescriptor.TYPE_INT64, FieldDescriptor.TYPE_UINT32, FieldDescriptor.TYPE_UINT64}
)
_WIRE = {
    **dict.fromkeys(_WHOLE, _VARINT),
    **dict.fromkeys(
        (
            FieldDescriptor.TYPE_BOOL,
            FieldDescriptor.TYPE_ENUM,
            FieldDescriptor.TYPE_SINT32,
            FieldDescriptor.TYPE_SINT64,
        ),
        _VARINT,
    ),
    **dict.fromkeys(
        (FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FIXED64, FieldDescriptor.TYPE_SFIXED64), _FIXED64
    ),
    **dict.fromkeys(
        (FieldDescriptor.TYPE_FLOAT, FieldDescriptor.TYPE_FIXED32, FieldDescriptor.TYPE_SFIXED32), _FIXED32
    ),
    **dict.fromkeys((FieldDescriptor.TYPE_STRING, FieldDescriptor.TYPE_BYTES, FieldDescriptor.TYPE_MESSAGE), _LENGTH),
}


@dataclass(frozen=True)
class _Place:
    """Where a field's value is, and its type in the descriptor."""

    begin: int
    length: int
    kind: int


@dataclass
class _Structure:
    """Which bits of a message are its shape (n,), and the places of its fields."""

    shape: Bytes
    places: dict[NamePath, _Place] = field(default_factory=dict)


@dataclass(frozen=True)
class Template:
    """Where the leaves of a message are, and how to recognise messages of the same shape.

    Bits under the mask `shape`, at the bytes `at`, must equal `bits`. `unsent` are the values of leaves not sent.
    """

    at: IntArray
    shape: Bytes
    bits: Bytes
    places: Mapping[int, _Place]
    unsent: Sequence[float]

    @staticmethod
    def of(row: Bytes, descriptor: Descriptor, leaves: Sequence[NamePath], one: Callable[[bytes], Reading]) -> Template:
        """A template by this message: leaves are a stamp's seconds and nanoseconds, then figures.

        Raises Declined if the message holds anything unusual, or `one`, the stock decoder, reads other values; and
        whatever `one` raises for a message that it cannot read.
        """
        data = row.tobytes()
        seconds, nanoseconds, values = one(data)[:3]
        structure = _Structure(np.zeros(len(row), np.uint8))
        _parse_fields(data, 0, len(data), descriptor, (), structure)
        at = np.flatnonzero(structure.shape)
        places = {index: structure.places[path] for index, path in enumerate(leaves) if path in structure.places}
        if any(place.kind not in (_WHOLE if index < 2 else _FLOATS) for index, place in places.items()):
            raise Declined
        template = Template(
            at, structure.shape[at], row[at] & structure.shape[at], places, (seconds, nanoseconds, *values)
        )
        template._check(row, one)
        return template

    def _check(self, row: Bytes, one: Callable[[bytes], Reading]) -> None:
        """Compare with the stock decoder on the same message with other values, each different from all others."""
        probe = row.copy()
        for index, place in self.places.items():
            if place.kind in _FLOATS:
                value = np.array([0.5 + index], f"<f{place.length}")
                probe[place.begin : place.begin + place.length] = value.view(np.uint8)
        ours = self.read(probe[np.newaxis])
        expected = Reading(int(ours.seconds[0]), int(ours.nanoseconds[0]), ours.values[0].tolist())
        if not ours.fits[0] or one(probe.tobytes()) != expected:
            raise Declined

    def read(self, rows: Bytes) -> Fields:
        """The leaves of messages that are as long, shape (n, length), and which of them are of this shape."""
        unsent = np.array(self.unsent[2:])
        values: FloatArray = np.tile(unsent, (len(rows), 1))
        stamps = [np.full(len(rows), int(value)) for value in self.unsent[:2]]
        for index, place in self.places.items():
            cells = np.ascontiguousarray(rows[:, place.begin : place.begin + place.length])
            if index < 2:
                stamps[index] = _varints(cells, place.kind)
            else:
                with np.errstate(invalid="ignore"):  # float32 has NaNs that warn as they are widened
                    values[:, index - 2] = cells.view(f"<f{place.length}")[:, 0]
        fits = ((rows[:, self.at] & self.shape) == self.bits).all(axis=1)
        return Fields.of(stamps[0], stamps[1], values, fits & holds_stamps(stamps[0], stamps[1]))


def _varints(cells: Bytes, kind: int) -> IntArray:
    """Base-128 numbers, shape (n, bytes of each), cut to the type's bits as the stock decoder does."""
    shifts = 7 * np.arange(cells.shape[1])
    whole: IntArray = ((cells.astype(np.int64) & 0x7F) << shifts).sum(axis=1)
    if kind == FieldDescriptor.TYPE_INT32:
        return whole.astype(np.uint32).view(np.int32).astype(np.int64)
    return whole & 0xFFFFFFFF if kind == FieldDescriptor.TYPE_UINT32 else whole


def _parse_fields(
    data: bytes, begin: int, end: int, descriptor: Descriptor, path: NamePath, structure: _Structure
) -> None:
    """Note the shape and places of the fields from `begin` to `end`. Raises Declined for anything unusual.

    Of a field that is sent twice the last counts, as in protobuf.
    """
    at = begin
    while at < end:
        tag, value = _varint(data, at, end)
        known = descriptor.fields_by_number.get(tag >> 3)
        if known is None or len(path) > _DEPTH_LIMIT:
            raise Declined
        structure.shape[at:value] = 0xFF
        at = _parse_field(data, value, end, known, tag & 7, (*path, known.name), structure)


def _parse_field(
    data: bytes, at: int, end: int, known: FieldDescriptor, wire: int, path: NamePath, structure: _Structure
) -> int:
    """Note one field's value, which begins at `at`; where it ends."""
    packed = known.is_repeated and wire == _LENGTH and known.type in _FLOATS
    if not packed and (known.is_repeated or wire != _WIRE.get(known.type)):
        raise Declined
    if wire == _VARINT:
        _, after = _varint(data, at, end)
        structure.shape[at:after] = 0x80
        structure.places[path] = _Place(at, after - at, known.type)
        return after
    if wire in _SIZES:
        after = at + _SIZES[wire]
        if after > end:
            raise Declined
        structure.places[path] = _Place(at, after - at, known.type)
        return after
    length, inner = _varint(data, at, end)
    after = inner + length
    if after > end:
        raise Declined
    structure.shape[at:inner] = 0xFF
    if packed and length:
        structure.places[path] = _Place(inner, _FLOATS[known.type], known.type)
    elif known.message_type is not None:
        _parse_fields(data, inner, after, known.message_type, path, structure)
    elif known.type == FieldDescriptor.TYPE_STRING:
        structure.shape[inner:after] = 0xFF  # the same name, so it is text in each if it is in one
    return after


def _varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    """A base-128 number, and where it ends."""
    value = 0
    for index in range(_VARINT_LIMIT):
        if at + index >= end:
            break
        value |= (data[at + index] & 0x7F) << (7 * index)
        if data[at + index] < 0x80:
            return value, at + index + 1
    raise Declined
