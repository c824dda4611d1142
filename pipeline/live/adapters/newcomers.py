"""Senders without a key that study.yaml does not name: which of them the operator has accepted, and who waits to be."""

from __future__ import annotations

from collections import Counter

from pipeline.live.events import Offer

NOT_ACCEPTED = "from a sender that was not accepted"
"""Why such a reading is refused."""
_MOST = 8
_ADDRESS_CHARACTERS = 64


class Newcomers:
    """What they sent is counted until one is accepted for its stream. From then on only that one feeds the stream."""

    def __init__(self) -> None:
        self._accepted: dict[str, str] = {}
        self._counts = Counter[tuple[str, str, str]]()

    def accept(self, stream: str, source: str) -> None:
        """Let a sender feed a stream until the end of the run."""
        self._accepted.setdefault(stream, source)

    def hears(self, stream: str, source: str, sends: str, is_trusted: bool) -> bool:
        """Whether a reading is used. `sends` is what the sender calls it, `is_trusted` whether it need not be accepted.

        Of those that are not used, `_MOST` are counted until the next `waiting`.
        """
        source, accepted = source[:_ADDRESS_CHARACTERS], self._accepted.get(stream)
        if is_trusted if accepted is None else source == accepted:
            return True
        sender = (stream, source, sends)
        if sender in self._counts or len(self._counts) < _MOST:
            self._counts[sender] += 1
        return False

    def waiting(self, elapsed_s: float) -> tuple[Offer, ...]:
        """Who has sent in the `elapsed_s` since the last call, and was not heard."""
        counts, self._counts = self._counts, Counter()
        return tuple(Offer(*sender, round(count / elapsed_s)) for sender, count in sorted(counts.items()))
