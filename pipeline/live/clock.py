"""The clock of a sender: offset and drift against the recorder's, from pings or from arrivals alone. Pure.

A ping and its answer bound the offset by their round trip; those with the least delay tell most. So the best of the
last 20 s make a line, whose slope is how fast the sender's clock runs (Mills 1991, on the filter of NTP). A path that
is slower one way than the other goes in by half the difference, which no exchange of stamps can see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from pipeline.live.messages import Exchange

KEPT_MS = 20_000.0
_BEST = 0.15  # of the exchanges, by round trip
_FEWEST_FOR_DRIFT = 4
_SPAN_FOR_DRIFT_MS = 4_000.0
_LARGEST_DRIFT = 200e-6
_STEP_MS, _STEP_LASTS_MS = 20.0, 1_000.0
_MOST = 600  # exchanges; pings come every 50 ms at first
_NS_PER_MS = 1e6


@dataclass(frozen=True)
class Mapping:
    """Recorder time is the sender's time t + `offset_ms` + `drift` (t − `at_ms`); off by `uncertainty_ms` at most."""

    offset_ms: float
    drift: float
    at_ms: float
    uncertainty_ms: float

    def to_ns(self, t_ms: float) -> int:
        """The recorder's time in ns."""
        return round((t_ms + self.offset_at(t_ms)) * _NS_PER_MS)

    def offset_at(self, t_ms: float) -> float:
        """The offset in ms at the sender's time `t_ms`."""
        return self.offset_ms + self.drift * (t_ms - self.at_ms)


@dataclass(frozen=True)
class Clock:
    """What is known of a sender that answers pings. `steps` counts how often its clock was set."""

    exchanges: tuple[Exchange, ...] = ()
    mapping: Mapping | None = None
    off_since_ms: float | None = None
    steps: int = 0


def offset_ms(exchange: Exchange) -> float:
    """Recorder time less sender's time, as far as one exchange knows it."""
    return ((exchange.t2 - exchange.t1) + (exchange.t3 - exchange.t4)) / 2


def round_trip_ms(exchange: Exchange) -> float:
    """How long an exchange was on its way, there and back."""
    return (exchange.t4 - exchange.t1) - (exchange.t3 - exchange.t2)


def exchanged(clock: Clock, exchange: Exchange) -> Clock:
    """The clock after one more exchange. One that cannot be (a negative round trip, an old one) changes nothing."""
    trip = round_trip_ms(exchange)
    if trip < 0 or exchange.t3 < exchange.t2 or trip > KEPT_MS:
        return clock
    if any(one.t1 == exchange.t1 for one in clock.exchanges[-4:]):
        return clock
    if clock.mapping is not None:
        apart = abs(offset_ms(exchange) - clock.mapping.offset_at(exchange.t1))
        # Each may be off by half its round trip: a page that is still loading answers late, and its clock is not set.
        if apart - trip / 2 - clock.mapping.uncertainty_ms > _STEP_MS:
            return _off(clock, exchange)
    since = exchange.t2 - KEPT_MS
    kept = (*(one for one in clock.exchanges[-_MOST:] if one.t2 >= since), exchange)
    return replace(clock, exchanges=kept, mapping=_fitted(kept), off_since_ms=None)


def _off(clock: Clock, exchange: Exchange) -> Clock:
    """A single exchange off the line is nothing; a second of them is a clock that was set."""
    since = exchange.t2 if clock.off_since_ms is None else clock.off_since_ms
    if exchange.t2 - since < _STEP_LASTS_MS:
        return replace(clock, off_since_ms=since)
    return Clock((exchange,), _fitted((exchange,)), None, clock.steps + 1)


def _fitted(exchanges: Sequence[Exchange]) -> Mapping:
    best = sorted(exchanges, key=round_trip_ms)[: max(1, round(_BEST * len(exchanges)))]
    least = round_trip_ms(best[0])
    weights = [1.0 / (0.2 + round_trip_ms(one) - least) ** 2 for one in best]
    total = sum(weights)
    first = best[0].t1
    time = sum(weight * (one.t1 - first) for weight, one in zip(weights, best, strict=True)) / total
    offset = sum(weight * offset_ms(one) for weight, one in zip(weights, best, strict=True)) / total
    drift = 0.0
    times = [one.t1 - first for one in best]
    if len(best) >= _FEWEST_FOR_DRIFT and max(times) - min(times) >= _SPAN_FOR_DRIFT_MS:
        spread = sum(weight * (t - time) ** 2 for weight, t in zip(weights, times, strict=True))
        product = sum(
            weight * (t - time) * (offset_ms(one) - offset) for weight, t, one in zip(weights, times, best, strict=True)
        )
        drift = min(max(product / spread, -_LARGEST_DRIFT), _LARGEST_DRIFT)
    return Mapping(offset, drift, first + time, least / 2)


_BUCKET_MS = 500.0
_BUCKETS = int(KEPT_MS / _BUCKET_MS)


@dataclass(frozen=True)
class OneWay:
    """What is known of a sender without a channel back: the least (arrival − its time) of each half second, for 20 s.

    A constant delay on the way cannot be told from an offset, so it belongs into `latency_s` of study.yaml.
    """

    least_ms: tuple[tuple[int, float], ...] = ()
    off_since_ms: float | None = None
    steps: int = 0

    @cached_property
    def mapping(self) -> Mapping | None:
        """The mapping, None before the first reading."""
        if not self.least_ms:
            return None
        return Mapping(min(least for _, least in self.least_ms), 0.0, 0.0, 0.0)


def arrived(clock: OneWay, t_ms: float, arrival_ms: float) -> OneWay:
    """The clock after a reading with the sender's time `t_ms` arrived at `arrival_ms`."""
    late, known = arrival_ms - t_ms, clock.mapping
    if known is not None and late - known.offset_ms > _STEP_LASTS_MS:  # no path is a second late for a second
        since = arrival_ms if clock.off_since_ms is None else clock.off_since_ms
        if arrival_ms - since < _STEP_LASTS_MS:
            return replace(clock, off_since_ms=since)
        return OneWay(((int(arrival_ms // _BUCKET_MS), late),), None, clock.steps + 1)
    bucket = int(arrival_ms // _BUCKET_MS)
    if known is not None and known.offset_ms - late > _STEP_LASTS_MS:
        return OneWay(((bucket, late),), None, clock.steps + 1)
    if clock.least_ms and clock.least_ms[-1][0] == bucket:
        if late >= clock.least_ms[-1][1]:
            return clock if clock.off_since_ms is None else replace(clock, off_since_ms=None)
        return OneWay((*clock.least_ms[:-1], (bucket, late)), None, clock.steps)
    kept = tuple(one for one in clock.least_ms if one[0] > bucket - _BUCKETS)
    return OneWay((*kept, (bucket, late)), None, clock.steps)
