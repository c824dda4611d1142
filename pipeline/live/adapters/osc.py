"""Readings by Open Sound Control: arguments of messages to an address.

It has no key, so this computer alone is heard, or the sender that study.yaml names or the operator accepts. OSC states
a time for bundles alone, and most senders leave it out, so a reading's stamp is its arrival.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pipeline.live.adapters import keyless
from pipeline.live.adapters.feeds import of_numbers
from pipeline.live.adapters.newcomers import Newcomers
from pipeline.live.events import Reading
from pipeline.live.messages import Datagram
from pipeline.live.setup import Setup
from pipeline.live.units import units


@dataclass(frozen=True)
class Expected(keyless.Keyless):
    """A stream that comes to an address; `fields` are the arguments that make it."""

    fields: tuple[int, ...]


def expected(setup: Setup, port: int) -> dict[str, Expected]:
    """The streams of a port, by address."""
    found = {}
    for name, sender in setup.recording.senders.items():
        if sender.osc is not None and sender.osc.port == port:
            content = setup.streams[name].content
            of_stream = Expected(name, content, units(sender), sender.osc.source, sender.osc.fields)
            found[sender.osc.address] = of_stream
    return found


class Receiver(keyless.Receiver):
    """A port for OSC."""

    def __init__(
        self,
        streams: Mapping[str, Expected],
        newcomers: Newcomers,
        happens: Callable[[Reading], None],
        now_ns: Callable[[], int],
    ) -> None:
        super().__init__(newcomers, happens, now_ns)
        self._streams = streams

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
            else:
                self.use(stream, _reading(stream, message.params), message.address, source, now)


def _reading(stream: Expected, arguments: list[object]) -> Datagram | None:
    """The numbers of a message as those of a datagram; None where some are missing or none."""
    if max(stream.fields) >= len(arguments):
        return None
    return of_numbers(stream.stream, stream.content, [arguments[place] for place in stream.fields])
