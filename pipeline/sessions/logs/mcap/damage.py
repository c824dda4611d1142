"""What a user is told of a truncated or damaged log, and of its records that cannot be read.

Each text names what is lost as exactly as the file shows it. Where reading can go on is found by `resume`.
"""

from __future__ import annotations

from mcap.opcode import Opcode

from pipeline.sessions.logs.mcap.resume import Place

NO_SUMMARY = "the log ends without its summary: it was cut off, or its recorder was stopped"
NO_LAST_BYTES = "the log's last bytes are missing"
WRONG_CHECKSUM = "the log's checksum does not fit its bytes: something in it is damaged"


def truncated(position: int, opcode: int) -> str:
    """The log ends within a record that begins before `position`, and nothing after it can be read."""
    what = "a chunk of messages" if opcode == Opcode.CHUNK else "a record"
    return f"the log is cut off, or damaged, {position} bytes in: {what} is not all there"


def resumed(position: int, place: Place) -> str:
    """Bytes about `position` make no record, and reading goes on behind them."""
    return f"the log is damaged about {position} bytes in: reading goes on {place.position} bytes in, at {place.what}"


def damaged_chunk(number: int, error: BaseException) -> str:
    """The chunk, counted from 1, cannot be unpacked, and its messages are lost."""
    return f"chunk {number} is damaged and left out: {error}"


def unreadable_record(opcode: int, error: BaseException) -> str:
    """A single record makes no sense."""
    name = Opcode(opcode).name.lower().replace("_", " ")
    return f"a record ({name}) cannot be read: {str(error) or type(error).__name__}"


def short_messages(count: int) -> str:
    """Messages that are shorter than the head of a message."""
    return f"{count} messages are left out: they are too short to be any"


def messages_without_topic(count: int) -> str:
    """Messages whose channel is defined nowhere in the log."""
    return f"{count} messages are left out: the log does not say what topic they belong to"


def further_faults(count: int) -> str:
    """Faults that are counted only."""
    return f"and {count} further faults"
