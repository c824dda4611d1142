"""Positions and accelerations in JSON: parsed by orjson and turned to arrays a block of messages at a time.

Each message is parsed by itself: joined to one array they would be read a tenth faster, but a damaged message can
hold the end of one value and the beginning of the next, and then nobody can tell whose the others are. What orjson
declines (NaN, infinity) and a block with anything unusual in it are left to the standard library.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np
import orjson
from mcap.records import Channel, Schema

from pipeline.sessions.logs.log import USUAL, IntArray, Source
from pipeline.sessions.logs.mcap.fields import (
    PAYLOAD_LIMIT,
    WIDTHS,
    Decoder,
    Fields,
    Reading,
    check_size,
    check_stamp,
    holds_stamps,
)
from pipeline.sessions.logs.mcap.layout import (
    COVARIANCE,
    FORCE,
    NANOSECONDS,
    RATE,
    SECONDS,
    STAMPS,
    TURN,
    VECTORS,
    NamePath,
)
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.tree import Layouts, reading, with_numbers_for_iso_times
from pipeline.statistics.arrays import FloatArray

AT_ONCE = 256  # messages: few enough that one unusual message does not cost much, and that objects do not pile up
_UNUSUAL = (ValueError, TypeError, LookupError, OverflowError)


def decoder(_: Channel, schema: Schema | None, content: str, source: Source) -> Decoder:
    """The decoder of a channel. Raises ValueError if the schema is not a JSON schema; its name does not matter."""
    if schema is not None and schema.encoding not in ("jsonschema", ""):
        raise ValueError(f'its schema is written as "{schema.encoding}", not jsonschema')
    usual = source == USUAL and content != "velocity"
    layouts = Layouts("a JSON object", content, source)

    def one(payload: bytes) -> Reading:
        check_size(payload)
        message = json.loads(payload)
        if not usual or _is_unusual(message, content):
            for key in ("timestamp", "stamp"):
                message = with_numbers_for_iso_times(message, key)
            return reading(message, layouts.of(message), source)
        names = _names(message, content)
        seconds, nanoseconds = (_whole(message, path) for path in names.stamp)
        check_stamp(seconds, nanoseconds)
        return Reading(seconds, nanoseconds, _figures(message, names, content))

    def many(messages: Messages, which: IntArray, fields: Fields) -> None:
        if not usual:
            return
        for begin in range(0, len(which), AT_ONCE):
            _decode_block(messages, which[begin : begin + AT_ONCE], content, fields)

    return Decoder(one, many)


def _is_unusual(message: object, content: str) -> bool:
    """Whether a message has its fields where only `tree` looks for them: in arrays, or a stamp that is a text."""
    if not isinstance(message, dict):
        return False
    in_array = isinstance(message.get("transforms"), list)
    other_force = content == "acceleration" and FORCE not in message and ("accel" in message or "vector" in message)
    return in_array or other_force or isinstance(message.get("timestamp", message.get("stamp")), str)


@dataclass(frozen=True)
class _Names:
    """Where a message has its stamp's two fields, its vectors, and its covariance if there is one."""

    stamp: tuple[NamePath, NamePath]
    vectors: Sequence[tuple[NamePath, str]]
    oriented: bool
    covariance: bool


def _names(message: object, content: str) -> _Names:
    """The names that a message uses. Raises ValueError where a required field is missing."""
    if not isinstance(message, dict):
        raise ValueError("it is no JSON object")
    stamp = _first_present(message, STAMPS)
    units = [_first_present(message, [(*stamp, name) for name in names])[-1] for names in (SECONDS, NANOSECONDS)]
    stamps = ((*stamp, units[0]), (*stamp, units[1]))
    if content == "position":
        return _Names(stamps, [(_first_present(message, VECTORS["position"]), "xyz")], False, False)
    oriented = message.get(TURN) is not None
    return _Names(
        stamps,
        [((FORCE,), "xyz"), ((RATE,), "xyz"), *([((TURN,), "xyzw")] if oriented else [])],
        oriented,
        message.get(COVARIANCE) is not None,
    )


def _first_present(message: object, paths: Sequence[NamePath]) -> NamePath:
    for path in paths:
        try:
            if _at(message, path) is not None:
                return path
        except ValueError:
            continue
    raise ValueError(f"it has no {' or '.join('.'.join(path) for path in paths)}")


def _at(message: object, path: NamePath) -> object:
    for depth, name in enumerate(path):
        if not isinstance(message, dict) or name not in message:
            raise ValueError(f"it has no {'.'.join(path[: depth + 1])}")
        message = message[name]
    return message


def _whole(message: object, path: NamePath) -> int:
    value = _at(message, path)
    if type(value) is not int:
        raise ValueError(f"its {'.'.join(path)} is not a whole number")
    return value


def _number(value: object, name: str) -> float:
    if type(value) not in (int, float):
        raise ValueError(f"its {name} is not a number")
    return float(value)  # type: ignore[arg-type]


def _figures(message: dict[str, Any], names: _Names, content: str) -> list[float]:
    """The values of one message; a missing orientation as zeros, which no real one has."""
    paths = [(*path, axis) for path, axes in names.vectors for axis in axes]
    values = [_number(_at(message, path), ".".join(path)) for path in paths]
    values += [0.0] * (min(WIDTHS[content], 10) - len(values))
    if content == "position":
        return values
    if not names.covariance:
        return [*values, 0.0]
    covariance = message[COVARIANCE]
    if not isinstance(covariance, list) or not covariance:
        raise ValueError(f"its {COVARIANCE} is no list of numbers")
    return [*values, _number(covariance[0], f"{COVARIANCE}[0]")]


def _decode_block(messages: Messages, which: IntArray, content: str, fields: Fields) -> None:
    """Fill in some messages, all or none: none where their fields have different names."""
    if messages.length[which].max() > PAYLOAD_LIMIT:
        return
    try:
        parsed = [orjson.loads(payload) for payload in messages.payloads(which)]
        if len(set(map(tuple, parsed))) > 1:
            return
        names = _names(parsed[0], content)
        seconds, nanoseconds = (_column(parsed, path, (int,)).astype(np.int64) for path in names.stamp)
        values = _matrix(parsed, names, content)
    except _UNUSUAL:
        return
    if holds_stamps(seconds, nanoseconds).all():
        every = np.arange(len(which))
        fields.take(which, Fields.of(seconds, nanoseconds, values, np.ones(len(which), bool)), every)


def _matrix(parsed: Sequence[Any], names: _Names, content: str) -> FloatArray:
    values = np.zeros((len(parsed), WIDTHS[content]))
    first = 0
    for path, axes in names.vectors:
        rows = list(map(itemgetter(*axes), _within(parsed, path)))
        values[:, first : first + len(axes)] = _array(chain.from_iterable(rows), (int, float)).reshape(len(parsed), -1)
        first += len(axes)
    if content == "acceleration":
        for name, there in ((TURN, names.oriented), (COVARIANCE, names.covariance)):
            if not there and any(message.get(name) is not None for message in parsed):
                raise ValueError(f"some messages have an {name}")
        if names.covariance:
            covariances = list(map(itemgetter(COVARIANCE), parsed))
            if set(map(type, covariances)) != {list}:
                raise ValueError("not all lists")
            values[:, 10] = _array(map(itemgetter(0), covariances), (int, float))
    return values


def _within(parsed: Sequence[Any], path: NamePath) -> Sequence[Any]:
    for name in path:
        parsed = list(map(itemgetter(name), parsed))
    return parsed


def _column(parsed: Sequence[Any], path: NamePath, kinds: tuple[type, ...]) -> np.ndarray[Any, Any]:
    return _array(_within(parsed, path), kinds)


def _array(values: Iterable[Any], kinds: tuple[type, ...]) -> np.ndarray[Any, Any]:
    """Numbers of these types only: NumPy would accept truth values and text as numbers too."""
    flat = list(values)
    if not set(map(type, flat)) <= set(kinds):
        raise TypeError("not all numbers")
    return np.array(flat, dtype=np.int64 if kinds == (int,) else np.float64)
