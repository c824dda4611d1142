"""How much of one kind may come from one source: a bucket that fills with time. Pure."""

from __future__ import annotations

from typing import NamedTuple

_BURST_S = 2.0  # a machine that stood still for longer ends the attempt anyway
_CLOSED_AFTER_NS = 10_000_000_000
_FORGIVEN_NS = 1_000_000_000


class Flow(NamedTuple):  # made anew with each datagram of a flood, and a tuple is made soonest
    """What a source may still send; `refused` counts what was over the limit, since `over_ns` without a break."""

    left: float
    at_ns: int
    refused: int = 0
    over_ns: int | None = None
    refused_ns: int = 0

    @property
    def is_flood(self) -> bool:
        """Whether it has been over the limit for 10 s."""
        return self.over_ns is not None and self.refused_ns - self.over_ns > _CLOSED_AFTER_NS


def admit(flow: Flow, per_second: float, at_ns: int) -> tuple[Flow, bool]:
    """The flow after one more, and whether it is within the limit.

    Two seconds' worth may come at once: what an honest sender has sent while this machine stood still.
    """
    left = min(flow.left + (at_ns - flow.at_ns) * 1e-9 * per_second, _BURST_S * per_second)
    if left >= 1.0:
        over = None if flow.over_ns is not None and at_ns - flow.refused_ns > _FORGIVEN_NS else flow.over_ns
        return Flow(left - 1.0, at_ns, flow.refused, over, flow.refused_ns), True
    over = at_ns if flow.over_ns is None else flow.over_ns
    return Flow(left, at_ns, flow.refused + 1, over, at_ns), False
