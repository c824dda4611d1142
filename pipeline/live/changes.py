"""A changed copy of a frozen value, for the states that are changed hundreds of times a second."""

from __future__ import annotations

from typing import Any, TypeVar

_Value = TypeVar("_Value")


def changed(value: _Value, /, **fields: Any) -> _Value:
    """As `dataclasses.replace`, many times as fast: nothing is checked again but that the fields exist.

    Not for values with cached properties, which would be copied too.
    """
    before = value.__dict__
    content = before | fields
    if len(content) != len(before):
        raise TypeError(f"{type(value).__name__} has no {', '.join(fields.keys() - before.keys())}")
    copy = object.__new__(type(value))
    object.__setattr__(copy, "__dict__", content)
    return copy
