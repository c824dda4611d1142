"""Types of flatbuffers, as `flatc --schema --binary` writes them into a log: a table's fields, and their types.

A schema is a flatbuffer itself. Its tables and the numbers of their fields stand in reflection.fbs:

    Schema  0 objects [Object]  4 root_table Object
    Object  0 name  1 fields [Field]  2 is_struct  4 bytesize
    Field   0 name  1 type  2 id  3 offset  4 default_integer  5 default_real
    Type    0 base_type  1 element  2 index  3 fixed_length

(https://github.com/google/flatbuffers/blob/master/reflection/reflection.fbs)
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pipeline.sessions.logs.mcap.flatbuffer_tables import Buffer, field_at, references
from pipeline.sessions.logs.mcap.layout import EACH, LEAVES_LIMIT, Kind, Path, within_limit

_SCHEMA_LIMIT = 256 * 1024  # bytes; Foxglove's take two thousand
_OBJECTS_LIMIT = 1000
_DEPTH_LIMIT = 8

NUMBERS: Mapping[int, str] = dict(enumerate(("?", "b", "B", "h", "H", "i", "I", "q", "Q", "f", "d"), start=2))
"""The code in `struct` of a number, by its base type."""

TEXT, VECTOR, OBJECT, ARRAY = 13, 14, 15, 17


@dataclass(frozen=True)
class Field:
    """A field of a table or struct.

    `element` is the base type of what a vector or array holds, `index` the number of the object if it is one. `number`
    counts the fields of a table, `offset` the bytes of a struct; `count` is the length of an array.
    """

    name: str
    base: int
    element: int
    index: int
    number: int
    offset: int
    count: int
    default: float


@dataclass(frozen=True)
class Object:
    """A table, or a struct of `size` bytes."""

    name: str
    is_struct: bool
    size: int
    fields: tuple[Field, ...]


@dataclass(frozen=True)
class Schema:
    """The objects by their numbers, and which of them a message is."""

    objects: tuple[Object, ...]
    root: Object

    def leaves(self) -> dict[Path, Kind]:
        """The path and kind of every figure and text. ValueError where there are more than any sensor's message has."""
        return within_limit(self._leaves(self.root, (), _DEPTH_LIMIT))

    def _leaves(self, of: Object, before: Path, depth: int) -> Iterator[tuple[Path, Kind]]:
        if depth == 0:
            return
        for field in of.fields:
            many = field.base in (VECTOR, ARRAY)
            path = (*before, field.name, EACH) if many else (*before, field.name)
            base = field.element if many else field.base
            if base == OBJECT:
                yield from self._leaves(self.objects[field.index], path, depth - 1)
            elif base in NUMBERS or base == TEXT:
                yield path, "text" if base == TEXT else "number"


def parse(name: str, data: bytes) -> Schema:
    """The schema of a message of type `name`. ValueError where it cannot be read, or does not describe the type."""
    if len(data) > _SCHEMA_LIMIT:
        raise ValueError(f"its schema is {len(data) // 1024} KiB long, which no sensor's message takes")
    try:
        buffer = Buffer(data)
        vector = buffer.target(field_at(buffer.fields(buffer.root()), 0))
        objects = tuple(_object(buffer, table) for table in references(buffer, vector, _OBJECTS_LIMIT))
    except (ValueError, struct.error) as error:
        raise ValueError(f"its schema is no binary schema of flatbuffers (.bfbs): {error}") from None
    root = next((one for one in objects if one.name == name), None)
    if root is None:
        raise ValueError(f"its schema does not describe {name}")
    wrong = [field for one in objects for field in one.fields if OBJECT in (field.base, field.element)]
    if any(not 0 <= field.index < len(objects) for field in wrong):
        raise ValueError("its schema is no binary schema of flatbuffers (.bfbs): it refers to a type that is not there")
    return Schema(objects, root)


def _object(buffer: Buffer, table: int) -> Object:
    places = buffer.fields(table)
    name, is_struct, size = (field_at(places, number) for number in (0, 2, 4))
    fields = references(buffer, buffer.target(field_at(places, 1)), LEAVES_LIMIT)
    return Object(
        buffer.text(buffer.target(name)),
        bool(_scalar(buffer, is_struct, "?", 0)),
        int(_scalar(buffer, size, "i", 0)),
        tuple(_field(buffer, one) for one in fields),
    )


def _field(buffer: Buffer, table: int) -> Field:
    places = buffer.fields(table)
    kind = buffer.fields(buffer.target(field_at(places, 1)))
    base = int(_scalar(buffer, field_at(kind, 0), "b", 0))
    whole = _scalar(buffer, field_at(places, 4), "q", 0)
    real = _scalar(buffer, field_at(places, 5), "d", 0.0)
    return Field(
        buffer.text(buffer.target(field_at(places, 0))),
        base,
        int(_scalar(buffer, field_at(kind, 1), "b", 0)),
        int(_scalar(buffer, field_at(kind, 2), "i", -1)),
        int(_scalar(buffer, field_at(places, 2), "H", 0)),
        int(_scalar(buffer, field_at(places, 3), "H", 0)),
        int(_scalar(buffer, field_at(kind, 3), "H", 0)),
        real if NUMBERS.get(base) in ("f", "d") else whole,
    )


def _scalar(buffer: Buffer, at: int, code: str, default: float) -> float:
    if not at:
        return default
    value: float = struct.unpack_from(f"<{code}", buffer.data, at)[0]
    return value
