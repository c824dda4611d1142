"""What is said to a server of readings and heard of it, without its socket: frames in, readings and answers out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from pipeline.live.adapters.feeds import Feed
from pipeline.live.events import Reading


@dataclass(frozen=True)
class Heard:
    """What came of a frame. `problem` is None where nothing new is known of what is wrong, empty where nothing is."""

    readings: tuple[Reading, ...] = ()
    answers: tuple[str, ...] = ()
    refused: str = ""
    problem: str | None = None


class Talk(Protocol):
    """A protocol, without its socket. `longest` is the longest frame in bytes."""

    feed: Feed
    url: str
    longest: int

    @property
    def subprotocols(self) -> Sequence[str]:
        """Those that are spoken; none where the protocol has no name of its own."""

    def begin(self, subprotocol: str | None) -> Heard:
        """A connection is there, by this subprotocol."""

    def take(self, frame: str | bytes, now: int) -> Heard:
        """A frame has come."""

    def nothing_yet(self) -> str:
        """Why there may be no reading after three seconds, in a sentence that continues the stream's name and url."""
