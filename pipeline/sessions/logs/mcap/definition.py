"""Checks a ROS 2 message definition before the stock decoder follows it.

That decoder reads arrays of messages beyond the end of the bytes, so a definition could keep it busy for ever.
"""

from __future__ import annotations

import contextlib
import io
from typing import Any

from mcap.records import Schema
from mcap_ros2._dynamic import _for_each_msgdef
from mcap_ros2._vendor.rosidl_adapter.parser import InvalidSpecification, InvalidValue

_TEXT_LIMIT = 64 * 1024  # bytes; an Imu's takes 5 KiB with every comment
_FIELDS_LIMIT = 200


def check_definition(schema: Schema) -> None:
    """ValueError if the definition cannot be parsed, or describes more fields than a sensor's message has."""
    if len(schema.data) > _TEXT_LIMIT:
        raise ValueError(f"its schema is {len(schema.data) // 1024} KiB long, which no sensor's message takes")
    definitions: dict[str, Any] = {}
    try:
        with contextlib.redirect_stderr(io.StringIO()):  # the parser prints what it also raises
            _for_each_msgdef(
                schema.name,
                schema.data.decode(),
                lambda _, name, definition: definitions.update({name: definition}),
            )
    except (InvalidSpecification, InvalidValue, NameError, TypeError, LookupError, RuntimeError) as error:
        raise ValueError(f"its schema cannot be read: {error}") from error
    _count_fields(definitions, "/".join([schema.name.split("/")[0], schema.name.split("/")[-1]]), 0)


def _count_fields(definitions: dict[str, Any], name: str, count: int) -> int:
    """`count` and the fields of a message and of those within it."""
    for field in definitions[name].fields if name in definitions else ():
        count += 1
        if count > _FIELDS_LIMIT:
            raise ValueError(f"its schema describes more than {_FIELDS_LIMIT} fields, which no sensor's message has")
        if not field.type.is_primitive_type():
            if field.type.is_array:
                raise ValueError(f'its schema holds an array of messages ("{field.name}"), as no sensor\'s does')
            count = _count_fields(definitions, f"{field.type.pkg_name}/{field.type.type}", count)
    return count
