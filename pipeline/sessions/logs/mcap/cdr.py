"""Positions and accelerations in CDR, many messages at once.

A message is an encapsulation header (4 bytes), a stamp (int32 s, uint32 ns), the frame's name with its length, padding
to 8 bytes, and float64 to the end. So messages that are equally long have every field at the same place, whatever
their frame is called. (OMG DDS-XTypes 1.3, 7.4: plain CDR; alignment counts from behind the header.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.mcap.fields import Fields, Reading
from pipeline.sessions.logs.mcap.templates import Bytes

NUMBERS: Mapping[str, int] = {"position": 3, "acceleration": 37}
"""How many float64 a message holds."""

COLUMNS: Mapping[str, tuple[int, ...]] = {
    "position": (0, 1, 2),
    "acceleration": (25, 26, 27, 13, 14, 15, 0, 1, 2, 3, 4),
}
"""Which of them are used: a position; specific force, angular velocity, orientation xyzw, its covariance's first."""

_HEADER = 4
_NAME = 16  # where the frame's name begins, its length before it
_EMPTY_NAME_BYTES = 20


def fields(rows: Bytes, content: str) -> Fields:
    """The fields of equally long messages, shape (n, length). Where `fits` is false the values mean nothing."""
    count, length = rows.shape
    body = length - (length - _HEADER) % 8 - 8 * NUMBERS[content]
    result = Fields.none_of(count, content)
    if body < _EMPTY_NAME_BYTES:
        return result
    for flag, order in ((0, ">"), (1, "<")):
        which = np.flatnonzero((rows[:, 0] == 0) & (rows[:, 1] == flag))
        if not len(which):
            continue
        part = rows if len(which) == count else rows[which]
        view = part.view(_layout(order, length, body, content))[:, 0]
        result.seconds[which] = view["seconds"]
        result.nanoseconds[which] = view["nanoseconds"]
        result.values[which] = view["numbers"][:, COLUMNS[content]]
        name_bytes = view["name_bytes"].astype(np.int64)
        padded = _HEADER + -(-(_NAME - _HEADER + name_bytes) // 8) * 8
        result.fits[which] = (padded == body) & _are_text(part[:, _NAME:body], name_bytes)
    return result


def _layout(order: str, length: int, body: int, content: str) -> np.dtype[np.void]:
    return np.dtype(
        {
            "names": ["seconds", "nanoseconds", "name_bytes", "numbers"],
            "formats": [f"{order}i4", f"{order}u4", f"{order}u4", (f"{order}f8", (NUMBERS[content],))],
            "offsets": [4, 8, 12, body],
            "itemsize": length,
        }
    )


def _are_text(names: Bytes, name_bytes: IntArray) -> npt.NDArray[np.bool_]:
    """Which names are UTF-8, by trying each different one; they are mostly all the same."""
    if (names == names[0]).all() and (name_bytes == name_bytes[0]).all():
        return np.full(len(names), _is_text(names[0].tobytes(), int(name_bytes[0])))
    each = [(name.tobytes(), int(size)) for name, size in zip(names, name_bytes, strict=True)]
    text = {key: _is_text(*key) for key in set(each)}
    return np.array([text[key] for key in each])


def _is_text(name: bytes, size: int) -> bool:
    try:
        name[: max(size - 1, 0)].decode()
    except UnicodeDecodeError:
        return False
    return True


def laid_out_alike(row: Bytes, content: str, stock: Callable[[bytes], Reading]) -> bool:
    """Whether the stock decoder reads a message of this shape in the same way.

    It follows the log's own schema. The probe is the message with other figures in it, each different and the stamp
    before 1970, so that no field can be mistaken for another.
    """
    probe = row.copy()[np.newaxis]
    body = len(row) - (len(row) - _HEADER) % 8 - 8 * NUMBERS[content]
    view = probe.view(_layout("<" if row[1] else ">", len(row), body, content))[0]
    view["seconds"], view["nanoseconds"], view["numbers"] = -2, 3, 0.5 + np.arange(NUMBERS[content])
    ours = fields(probe, content)
    expected = Reading(int(ours.seconds[0]), int(ours.nanoseconds[0]), ours.values[0].tolist())
    return bool(ours.fits[0]) and stock(probe.tobytes()) == expected
