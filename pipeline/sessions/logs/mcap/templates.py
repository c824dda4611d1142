"""Many messages at once: one of them shows where everything is, and all that are laid out like it are read there.

Messages of one length are tried together. The first that is not read yet is the template of all like it; one that
makes no template is left to the slow way, and so is what is left after some templates.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pipeline.sessions.logs.log import BoolArray, IntArray
from pipeline.sessions.logs.mcap.fields import PAYLOAD_LIMIT
from pipeline.sessions.logs.mcap.messages import Messages

Bytes = npt.NDArray[np.uint8]

ReadAlike = Callable[[Bytes, IntArray], BoolArray]
"""Reads what is laid out like the first of some rows; says which these are, the first among them."""

TEMPLATES = 64  # tried for messages of one length
_ROWS_AT_ONCE = 1024  # so that what is copied of them stays in the processor's cache


class Declined(Exception):  # noqa: N818
    """This message cannot serve as a template; it may be valid all the same."""


def read_by_templates(messages: Messages, which: IntArray, read_alike: ReadAlike) -> None:
    """Hand the payloads of some messages to `read_alike`, which raises Declined or ValueError for no template."""
    for length in np.unique(messages.length[which]).tolist():
        if length <= PAYLOAD_LIMIT:
            alike = which[messages.length[which] == length]
            for begin in range(0, len(alike), _ROWS_AT_ONCE):
                part = alike[begin : begin + _ROWS_AT_ONCE]
                _read_rows(messages.rows(part), part, read_alike)


def _read_rows(rows: Bytes, which: IntArray, read_alike: ReadAlike) -> None:
    """`rows` (n, length) are the payloads of the messages `which` (n,)."""
    for _ in range(TEMPLATES):
        try:
            left = ~read_alike(rows, which)
        except (Declined, ValueError):
            left = np.arange(len(rows)) > 0
        if not left.any():
            return
        rows, which = rows[left], which[left]
