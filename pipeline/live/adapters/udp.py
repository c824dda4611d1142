"""Readings by UDP, JSON: one datagram is one reading or a few. What is too much, unknown or damaged is counted only."""

from __future__ import annotations

import asyncio
import socket
import struct
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from secrets import compare_digest
from typing import Any

from pipeline.live.access import LOOPBACK
from pipeline.live.adapters.newcomers import NOT_ACCEPTED, Newcomers
from pipeline.live.events import Reading
from pipeline.live.limits import Flow, admit
from pipeline.live.messages import DATAGRAM_BYTES, Datagram, MessageError, parse_datagram
from pipeline.live.setup import Setup
from pipeline.live.units import Units, in_si, units

_PER_SECOND = 1000.0  # datagrams of one source
_SOURCES = 64
_WAITING_BYTES = 4 << 20  # the system may allow less
_AT_ONCE, _LONGEST = 512, 65_536
_MS_PER_S = 1000.0
_OVERFLOW, _COUNT = 40, struct.Struct("@I")  # SO_RXQ_OVFL, socket(7), which Python has no name for
_BESIDE_BYTES = 64


@dataclass(frozen=True)
class Expected:
    """A stream that comes in here: what its readings hold, their units, and the address they must come from."""

    content: str
    units: Units
    source: str

    def may_be_offered(self, source: str) -> bool:
        """Whether a sender at that address may be accepted by the operator, though it has no key."""
        return self.source == "any" and source not in LOOPBACK


def expected(setup: Setup, port: int) -> dict[str, Expected]:
    """The streams of a port, by name."""
    found = {}
    for name, sender in setup.recording.senders.items():
        if sender.udp_json is not None and sender.udp_json.port == port:
            found[name] = Expected(setup.streams[name].content, units(sender), sender.udp_json.source)
    return found


class Limited(asyncio.DatagramProtocol):
    """A port that takes so much from each source and no more. `refused` counts what was dropped, by reason."""

    def __init__(self, happens: Callable[[Reading], None], now_ns: Callable[[], int]) -> None:
        self.happens, self._now_ns = happens, now_ns
        self._flows: dict[str, Flow] = {}
        self.refused: Counter[str] = Counter()

    def datagram_received(self, data: bytes, address: tuple[str | Any, int]) -> None:
        """One datagram."""
        now, source = self._now_ns(), str(address[0])
        if source not in self._flows and len(self._flows) >= _SOURCES:
            self.refused["too many sources"] += 1
            return
        flow = self._flows.get(source, Flow(_PER_SECOND, now))
        self._flows[source], admitted = admit(flow, _PER_SECOND, now)
        if not admitted:
            self.refused["too many datagrams"] += 1
        elif len(data) > DATAGRAM_BYTES:
            self.refused["too long"] += 1
        else:
            self.take(data, source, now)

    def take(self, data: bytes, source: str, now: int) -> None:
        """A datagram within the limits."""
        raise NotImplementedError


class Receiver(Limited):
    """A port for readings in JSON, which hold the run's key, or come from a sender that the operator accepts."""

    def __init__(
        self,
        streams: Mapping[str, Expected],
        key: str,
        newcomers: Newcomers,
        happens: Callable[[Reading], None],
        now_ns: Callable[[], int],
    ) -> None:
        super().__init__(happens, now_ns)
        self._streams, self._key, self._newcomers = streams, key, newcomers

    def take(self, data: bytes, source: str, now: int) -> None:
        """A datagram within the limits."""
        try:
            readings = parse_datagram(data)
        except MessageError:
            self.refused["not understood"] += 1
            return
        for reading in readings:
            self._take(reading, source, now)

    def _take(self, datagram: Datagram, source: str, now: int) -> None:
        stream, has_key = self._streams.get(datagram.stream), compare_digest(datagram.key.encode(), self._key.encode())
        may_be_offered = not datagram.key and stream is not None and stream.may_be_offered(source)
        if not has_key and not may_be_offered:
            self.refused["wrong key"] += 1
            return
        if stream is None or stream.source not in ("any", source):
            self.refused["no such stream"] += 1
            return
        values = in_si(stream.units, stream.content, datagram)
        if values is None:
            self.refused["not of the stream's kind"] += 1
            return
        if not self._newcomers.hears(datagram.stream, source, datagram.stream, has_key):
            self.refused[NOT_ACCEPTED] += 1
            return
        sent = None if datagram.t is None else datagram.t * _MS_PER_S
        self.happens(Reading(datagram.stream, None, now, values, datagram.seq, sent))


class Port:
    """An open port. All that waits is read at once: with few datagrams a turn of the loop, a flood fills the buffer.

    A good reading waits behind what came before it, so it is late as long as anything is left for the next turn.
    """

    def __init__(self, opened: socket.socket, receiver: Limited) -> None:
        self._socket, self._receiver = opened, receiver
        self._lost = 0
        if sys.platform == "linux":
            opened.setsockopt(socket.SOL_SOCKET, _OVERFLOW, 1)
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(opened, self._read)

    def _read(self) -> None:
        for _ in range(_AT_ONCE):
            try:
                data, beside, _, address = self._socket.recvmsg(_LONGEST, _BESIDE_BYTES)
            except OSError:  # nothing more is there, or the network says that an earlier answer did not arrive
                return
            if beside:
                self._overflowed(beside)
            self._receiver.datagram_received(data, address)

    def _overflowed(self, beside: list[tuple[int, int, bytes]]) -> None:
        """Linux says with each datagram how many it had no room for so far, once there are any."""
        for level, kind, data in beside:
            if (level, kind) == (socket.SOL_SOCKET, _OVERFLOW) and len(data) == _COUNT.size:
                count = _COUNT.unpack(data)[0]
                self._receiver.refused["came faster than they were read"] += (count - self._lost) % 2**32
                self._lost = count

    def close(self) -> None:
        """Listen no more."""
        self._loop.remove_reader(self._socket)
        self._socket.close()


async def listen(host: str, port: int, receiver: Limited) -> Port | asyncio.DatagramTransport:
    """Open a port. OSError where it is taken."""
    opened = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setblocking(False)
        opened.bind((host, port))
        # What comes while the loop is busy waits here.
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _WAITING_BYTES)
        return Port(opened, receiver)
    except NotImplementedError:  # Windows' loop has no readers
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(lambda: receiver, sock=opened)
        return transport
    except OSError:
        opened.close()
        raise
