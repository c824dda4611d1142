"""What senders by UDP that have no key have in common: who may send a stream, and what becomes of their figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pipeline.live.access import LOOPBACK
from pipeline.live.adapters.newcomers import NOT_ACCEPTED, Newcomers
from pipeline.live.adapters.udp import Limited
from pipeline.live.events import Reading
from pipeline.live.messages import Datagram
from pipeline.live.units import Units, in_si


@dataclass(frozen=True)
class Keyless:
    """A stream that comes in without a key: what its readings hold, their units, and the address that may send it."""

    stream: str
    content: str
    units: Units
    source: str | None

    def trusts(self, source: str) -> bool:
        """Whether a sender at that address may send it, without being accepted."""
        return source in LOOPBACK if self.source is None else self.source in ("any", source)


class Receiver(Limited):
    """A port for them."""

    def __init__(self, newcomers: Newcomers, happens: Callable[[Reading], None], now_ns: Callable[[], int]) -> None:
        super().__init__(happens, now_ns)
        self._newcomers = newcomers

    def use(
        self,
        stream: Keyless,
        figures: Datagram | None,
        sends: str,
        source: str,
        now: int,
        sent_ms: float | None = None,
    ) -> None:
        """Figures of a stream, None where some are missing or none; `sends` is what the sender calls them."""
        is_trusted = stream.trusts(source)
        if stream.source is not None and not is_trusted:
            self.refused["not from its source"] += 1
            return
        values = None if figures is None else in_si(stream.units, stream.content, figures)
        if values is None:
            self.refused["not of the stream's kind"] += 1
        elif not self._newcomers.hears(stream.stream, source, sends, is_trusted):
            self.refused[NOT_ACCEPTED] += 1
        else:
            self.happens(Reading(stream.stream, None, now, values, None, sent_ms))
