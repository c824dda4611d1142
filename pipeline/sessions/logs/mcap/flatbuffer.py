"""Flatbuffers, as Foxglove's tools write them: walked through by the log's own binary schema.

A table may leave out a figure that has its type's default, which for a coordinate is 0; then messages are laid out
differently, and each way is a template of its own (`by_places`).
"""

from __future__ import annotations

import struct

from mcap.records import Channel
from mcap.records import Schema as SchemaRecord

from pipeline.sessions.logs.log import Source
from pipeline.sessions.logs.mcap import by_places
from pipeline.sessions.logs.mcap.fields import UNFIT, Decoder
from pipeline.sessions.logs.mcap.flatbuffer_schema import (
    ARRAY,
    NUMBERS,
    OBJECT,
    TEXT,
    VECTOR,
    Field,
    Object,
    Schema,
    parse,
)
from pipeline.sessions.logs.mcap.flatbuffer_tables import Buffer, field_at, references
from pipeline.sessions.logs.mcap.layout import Path
from pipeline.sessions.logs.mcap.places import Places

_STEPS_LIMIT = 20_000  # fields walked through: a message of so many holds no sensor's reading
_FIGURES_OF_ARRAY = 64  # each with a path; the others are never read one by one


def decoder(_: Channel, schema: SchemaRecord | None, content: str, source: Source) -> Decoder:
    """The decoder of a channel. Raises ValueError if the schema lacks needed fields or cannot be read."""
    if schema is None:
        raise ValueError("it has no schema, and flatbuffers cannot be read without")
    if schema.encoding != "flatbuffer":
        raise ValueError(f'its schema is written as "{schema.encoding}", not flatbuffer')
    types = parse(schema.name, schema.data)
    return by_places.decoder(types.leaves(), schema.name, content, source, lambda payload: places(payload, types))


def places(payload: bytes, schema: Schema) -> Places:
    """Walk through a message. ValueError where its bytes do not fit the schema."""
    walk = _Walk(payload, schema)
    walk.table(walk.buffer.root(), schema.root, ())
    walk.places.fixed = walk.buffer.followed
    return walk.places


class _Walk:
    """One walk through a message's tables."""

    def __init__(self, payload: bytes, schema: Schema) -> None:
        self.buffer, self.objects = Buffer(payload), schema.objects
        self.places, self.steps = Places(), 0

    def table(self, table: int, kind: Object, path: Path) -> None:
        self._step()
        where = self.buffer.fields(table)
        for field in kind.fields:
            self._step()
            own = (*path, field.name)
            at = field_at(where, field.number)
            if not at and field.base in NUMBERS:
                self.places.unsent[own] = field.default
            elif not at and field.base == VECTOR:
                self.places.counts[own] = 0
            elif not at and field.base == TEXT:
                self.places.texts[own] = ""
            elif at:
                self._field(field, at, own)

    def _field(self, field: Field, at: int, path: Path) -> None:
        if field.base == VECTOR:
            vector = self.buffer.target(at)
            self.places.counts[path] = count = self.buffer.length(vector)
            self._elements(field, vector, count, path)
        else:
            self._one(field.base, field.index, at, path)

    def _one(self, base: int, index: int, at: int, path: Path) -> None:
        if base in NUMBERS:
            self._figure(base, at, path)
        elif base == TEXT:
            self.places.texts[path] = self.buffer.text(self.buffer.target(at))
        elif base == OBJECT:
            kind = self.objects[index]
            if kind.is_struct:
                self._struct(kind, at, path)
            else:
                self.table(self.buffer.target(at), kind, path)

    def _elements(self, field: Field, vector: int, count: int, path: Path) -> None:
        if field.element in NUMBERS:
            self._figures(field.element, vector + 4, count, path)
        elif field.element == OBJECT and self.objects[field.index].is_struct:
            for place in range(count):
                kind = self.objects[field.index]
                self._struct(kind, vector + 4 + place * kind.size, (*path, place))
        elif field.element == TEXT:
            for place, at in enumerate(references(self.buffer, vector, _STEPS_LIMIT)):
                self._step()
                self.places.texts[*path, place] = self.buffer.text(at)
        elif field.element == OBJECT:
            for place, at in enumerate(references(self.buffer, vector, _STEPS_LIMIT)):
                self.table(at, self.objects[field.index], (*path, place))

    def _struct(self, kind: Object, at: int, path: Path) -> None:
        """Fields at fixed places, without a vtable."""
        for field in kind.fields:
            self._step()
            if field.base == ARRAY:
                self.places.counts[*path, field.name] = field.count
                if field.element in NUMBERS:
                    self._figures(field.element, at + field.offset, field.count, (*path, field.name))
            else:
                self._one(field.base, field.index, at + field.offset, (*path, field.name))

    def _figures(self, base: int, begin: int, count: int, path: Path) -> None:
        size = struct.calcsize(f"<{NUMBERS[base]}")
        self.buffer.within(begin, size * count)
        for place in range(min(count, _FIGURES_OF_ARRAY)):
            self._figure(base, begin + size * place, (*path, place))

    def _figure(self, base: int, at: int, path: Path) -> None:
        code = f"<{NUMBERS[base]}"
        self.buffer.within(at, struct.calcsize(code))
        self.places.figures[path] = at, code

    def _step(self) -> None:
        self.steps += 1
        if self.steps > _STEPS_LIMIT:
            raise ValueError(UNFIT)
