"""ROS messages in CDR and in ROS 1's own serialisation, by the definition that stands in the log.

A message is walked through along its definition (`wire`), and all that are laid out like it are read at its places
(`by_places`).
"""

from __future__ import annotations

from mcap.records import Channel, Schema

from pipeline.sessions.logs.log import Source
from pipeline.sessions.logs.mcap import by_places, well_known
from pipeline.sessions.logs.mcap.definition_text import parse, short_name
from pipeline.sessions.logs.mcap.fields import Decoder
from pipeline.sessions.logs.mcap.places import Places
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.sessions.logs.mcap.wire import ROS1, places, wire_of


def decoder(channel: Channel, schema: Schema | None, content: str, source: Source) -> Decoder:
    """The decoder of a channel. Raises one of `UNDECODABLE` if the schema is of another type or cannot be followed."""
    if schema is None:
        shape = "position" if content == "velocity" else content
        raise ValueError(f"it holds no schema, and a stream of kind {content} needs {SCHEMAS[shape]}")
    definition = parse(schema.name, _text_of(schema))
    is_ros1 = schema.encoding == "ros1msg" or channel.message_encoding == "ros1"

    def walk_through(payload: bytes) -> Places:
        return places(payload, definition, ROS1 if is_ros1 else wire_of(payload))

    return by_places.decoder(definition.leaves(), schema.name, content, source, walk_through)


def _text_of(schema: Schema) -> bytes:
    """The definition that a log gives; one that never changed where the log gives none, or in another language."""
    written_as = ("ros2msg", "ros1msg")
    if short_name(schema.name) in well_known.NAMES and (not schema.data or schema.encoding not in written_as):
        return well_known.text_of(schema.name, ros1=schema.encoding == "ros1msg")
    if schema.encoding not in written_as:
        raise ValueError(f'its schema is written as "{schema.encoding}", not ros2msg')
    return schema.data
