"""How a stream of readings does, before and during a session, and the light that it gets. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.live.changes import changed

_RECENT_NS = 2_000_000_000
_SILENT_NS = 300_000_000
_GAP_AMBER_MS = 150.0
_LATE_AMBER_MS = 250.0  # half of what an estimator looks back, as usual
_NS_PER_MS = 1e6
_SMOOTHED = 0.05


@dataclass(frozen=True)
class Health:
    """A stream's newest arrival, mean interval, widest recent gap and mean delay."""

    arrival_ns: int = 0
    count: int = 0
    interval_ms: float = 0.0
    gap_ms: float = 0.0
    gap_ns: int = 0
    late_ms: float | None = None


def heard(health: Health, arrival_ns: int, stamp_ns: int | None) -> Health:
    """After one more reading."""
    late = None if stamp_ns is None else (arrival_ns - stamp_ns) / _NS_PER_MS
    if late is not None and health.late_ms is not None:
        late = health.late_ms + _SMOOTHED * (late - health.late_ms)
    if not health.count:
        return Health(arrival_ns, 1, late_ms=late)
    apart = (arrival_ns - health.arrival_ns) / _NS_PER_MS
    weight = max(_SMOOTHED, 1.0 / health.count)
    interval = health.interval_ms + weight * (apart - health.interval_ms)
    widest, at = health.gap_ms, health.gap_ns
    if apart >= widest or arrival_ns - at > _RECENT_NS:
        widest, at = apart, arrival_ns
    return changed(
        health,
        arrival_ns=arrival_ns,
        count=health.count + 1,
        interval_ms=interval,
        gap_ms=widest,
        gap_ns=at,
        late_ms=late,
    )


def is_silent(health: Health, at_ns: int) -> bool:
    """Whether nothing has come for 0.3 s, or ever."""
    return not health.count or at_ns - health.arrival_ns > _SILENT_NS


def light(health: Health, at_ns: int, lost: int) -> dict[str, object]:
    """A stream's light with its figures, as the operator's page takes it."""
    if not health.count:
        return {"light": "red", "text": "Nothing has come yet."}
    silent_s = (at_ns - health.arrival_ns) / _NS_PER_MS / 1e3
    rate = 1e3 / health.interval_ms if health.interval_ms > 0 else 0.0
    figures: dict[str, object] = {
        "rate_hz": round(rate, 1),
        "gap_ms": round(health.gap_ms),
        "late_ms": None if health.late_ms is None else round(health.late_ms, 1),
        "lost": lost,
    }
    if at_ns - health.arrival_ns > _SILENT_NS:
        return {"light": "red", "text": f"Silent for {silent_s:.1f} s.", **figures}
    late = "" if health.late_ms is None else f", {health.late_ms:.0f} ms late"
    text = f"{rate:.1f} Hz, gap {health.gap_ms:.0f} ms{late}"
    is_late = health.late_ms is not None and health.late_ms > _LATE_AMBER_MS
    if is_late:
        text += ". That is too late to be shown: have each reading sent at once, not in batches."
    amber = health.gap_ms > _GAP_AMBER_MS or is_late
    return {"light": "amber" if amber else "green", "text": text, **figures}
