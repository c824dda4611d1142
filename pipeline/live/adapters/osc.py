"""Readings by Open Sound Control: arguments of messages to an address.

It has no key, so this computer alone is heard, or the sender that study.yaml names or the operator accepts. OSC states
a time for bundles alone, and most senders leave it out, so a reading's stamp is its arrival.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pipeline.live.access import LOOPBACK
from pipeline.live.adapters.feeds import of_numbers
from pipeline.live.adapters.newcomers import NOT_ACCEPTED, Newcomers
from pipeline.live.adapters.udp import Limited
from pipeline.live.events import Reading
from pipeline.live.messages import Datagram
from pipeline.live.setup import Setup
from pipeline.live.units import Units, in_si, units


@dataclass(frozen=True)
class Expected:
    """A stream that comes to an address: which arguments make it, what they hold, their units, and who may send it."""

    stream: str
    fields: tuple[int, ...]
    content: str
    units: Units
    source: str | None = None

    def trusts(self, source: str) -> bool:
        """Whether a sender at that address may send it, without being accepted."""
        return source in LOOPBACK if self.source is None else self.source in ("any", source)


def expected(setup: Setup, port: int) -> dict[str, Expected]:
    """The streams of a port, by address."""
    found = {}
    for name, sender in setup.recording.senders.items():
        if sender.osc is not None and sender.osc.port == port:
            content = setup.streams[name].content
            of_stream = Expected(name, sender.osc.fields, content, units(sender), sender.osc.source)
            found[sender.osc.address] = of_stream
    return found


class Receiver(Limited):
    """A port for OSC."""

    def __init__(
        self,
        streams: Mapping[str, Expected],
        newcomers: Newcomers,
        happens: Callable[[Reading], None],
        now_ns: Callable[[], int],
    ) -> None:
        super().__init__(happens, now_ns)
        self._streams, self._newcomers = streams, newcomers

    def take(self, data: bytes, source: str, now: int) -> None:
        """A datagram within the limits."""
        from pythonosc.osc_packet import OscPacket, ParseError

        try:
            messages = [timed.message for timed in OscPacket(data).messages]
        except (ParseError, ValueError, IndexError, RecursionError, OverflowError):
            self.refused["not understood"] += 1
            return
        for message in messages:
            stream = self._streams.get(message.address)
            if stream is None:
                self.refused["no such address"] += 1
                continue
            is_trusted = stream.trusts(source)
            if stream.source is not None and not is_trusted:
                self.refused["not from its source"] += 1
                continue
            reading = _reading(stream, message.params)
            values = None if reading is None else in_si(stream.units, stream.content, reading)
            if values is None:
                self.refused["not of the stream's kind"] += 1
            elif not self._newcomers.hears(stream.stream, source, message.address, is_trusted):
                self.refused[NOT_ACCEPTED] += 1
            else:
                self.happens(Reading(stream.stream, None, now, values))


def _reading(stream: Expected, arguments: list[object]) -> Datagram | None:
    """The numbers of a message as those of a datagram; None where some are missing or none."""
    if max(stream.fields) >= len(arguments):
        return None
    return of_numbers(stream.stream, stream.content, [arguments[place] for place in stream.fields])
