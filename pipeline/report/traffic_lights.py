"""Why a session is green, amber or red: each of its quality figures compared with the limits of study.yaml."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from statistics import median
from typing import Literal

from pipeline.study.settings import QualityLimits, Study
from pipeline.tables.table import Row
from pipeline.words.numbers import number, percent

Light = Literal["not judged", "green", "amber", "red"]

LIGHTS: tuple[Light, ...] = ("not judged", "green", "amber", "red")
"""From the best to the worst; of what is not judged nothing is known."""
SYMBOLS: Mapping[Light, str] = {"not judged": "–", "green": "✓", "amber": "▲", "red": "✗"}
FACTS = ("Rate", "Longest gap", "Delay", "Clock", "Lost", "Replay", "Checks")
"""The figures of a session that are judged, in the order of the report."""
_TO_COMPARE = 3  # sessions: with fewer nobody can say which rate is the usual one


@dataclass(frozen=True)
class Judged:
    """A quality figure of a session and its light.

    `fact` is one of `FACTS`, `of` the stream, estimator or check that it belongs to, `shown` the figure as text.
    """

    session: str
    fact: str
    of: str
    shown: str
    light: Light

    @property
    def text(self) -> str:
        """`▲ amber: 0.35 s (imu)`; of a green figure the light alone."""
        head = f"{SYMBOLS[self.light]} {self.light}"
        return f"{head}: {self.shown} ({self.of})" if self.light in ("amber", "red") else head


def judged(study: Study, quality: Sequence[Row], agreement: Sequence[Row], checks: Sequence[Row] = ()) -> list[Judged]:
    """Every figure of every session, from rows of the tables `quality`, `replay_agreement` and `checks`."""
    limits, usual = study.quality_limits, _usual_rates(study, quality)
    figures = [figure for row in quality for figure in _stream_figures(study, row, usual.get(row["stream"]))]
    with_samples = {(row["session"], row["stream"]) for row in quality}
    for session in dict.fromkeys(row["session"] for row in quality):
        empty = [name for name in study.streams if (session, name) not in with_samples]
        figures += [Judged(session, "Lost", name, "no samples", "amber") for name in empty]
    for row in agreement:
        apart = row["max_mm"]
        light: Light = "not judged" if apart is None else _above(apart, limits.agreement_mm)
        figures.append(Judged(row["session"], "Replay", row["estimator"], f"{number(apart, 3)} mm apart", light))
    figures += [
        Judged(row["session"], "Checks", row["check"], row["found"], row["status"]) for row in checks if row["session"]
    ]
    return figures


def worst(figures: Sequence[Judged]) -> Judged | None:
    """The figure with the worst light, the first of several."""
    return max(figures, key=lambda figure: LIGHTS.index(figure.light), default=None)


def light_of(figures: Sequence[Judged]) -> Light:
    """A session's light: that of the worst of its figures."""
    decisive = worst(figures)
    return "not judged" if decisive is None else decisive.light


def limits_text(limits: QualityLimits) -> str:
    """The limits in words, once for the whole report."""
    rows = (
        ("rate below", limits.rate_share, "%"),
        ("longest gap over", limits.gap_s, "s"),
        ("delay over", limits.latency_s, "s"),
        ("jitter of arrivals over", limits.jitter_ms, "ms"),
        ("samples out of order over", limits.out_of_order_share, "%"),
        ("messages lost over", limits.lost_share, "%"),
        ("replay apart by over", limits.agreement_mm, "mm"),
    )
    return "; ".join(f"{what} {_plain(amber, unit)} ({_plain(red, unit)})" for what, (amber, red), unit in rows)


def _plain(value: float, unit: str) -> str:
    """A limit as it is stated, all its digits and no exponent; a share in percent."""
    exact = Decimal(repr(value)) * (100 if unit == "%" else 1)
    text = f"{exact:f}"
    return f"{text.rstrip('0').rstrip('.') if '.' in text else text} {unit}"


def _usual_rates(study: Study, quality: Sequence[Row]) -> dict[str, float]:
    """Each stream's rate as study.yaml states it, else its median over the sessions, if there are enough."""
    usual: dict[str, float] = {}
    for name, stream in study.streams.items():
        rates = [row["rate_hz"] for row in quality if row["stream"] == name and row["rate_hz"] is not None]
        stated = getattr(stream, "rate_hz", None)
        if stated is not None or len(rates) >= _TO_COMPARE:
            usual[name] = median(rates) if stated is None else stated
    return usual


def _stream_figures(study: Study, row: Row, usual_hz: float | None) -> Iterator[Judged]:
    """The figures of a stream. Events have no rate, so only their losses are judged."""
    limits, stream = study.quality_limits, study.streams.get(row["stream"])

    def figure(fact: str, shown: str, light: Light) -> Judged:
        return Judged(row["session"], fact, row["stream"], shown, light)

    if stream is not None:
        if row["rate_hz"] is not None and usual_hz is not None:
            shown = f"{number(row['rate_hz'], 1)} Hz for {number(usual_hz, 1)}"
            yield figure("Rate", shown, _below(row["rate_hz"] / usual_hz, limits.rate_share))
        if row["gap_max_s"] is not None:
            yield figure("Longest gap", f"{number(row['gap_max_s'])} s", _above(row["gap_max_s"], limits.gap_s))
        if row["latency_s"] is not None:
            delay_s = row["latency_s"] + (stream.latency_s if stream.stamped_on_arrival else 0.0)
            yield figure("Delay", f"{number(delay_s)} s", _above(abs(delay_s), limits.latency_s))
        if row["jitter_ms"] is not None:
            yield figure(
                "Clock", f"{number(row['jitter_ms'], 1)} ms jitter", _above(row["jitter_ms"], limits.jitter_ms)
            )
        if row["out_of_order"] is not None and row["messages_read"]:
            share = row["out_of_order"] / row["messages_read"]
            yield figure("Clock", f"{percent(share)} out of order", _above(share, limits.out_of_order_share))
    if row["messages_lost"] is None:
        yield figure("Lost", "number not known", "amber")
    elif row["messages_read"] + row["messages_lost"]:
        share = row["messages_lost"] / (row["messages_read"] + row["messages_lost"])
        yield figure("Lost", f"{row['messages_lost']}, {percent(share)}", _above(share, limits.lost_share))


def _above(value: float, limits: tuple[float, float]) -> Light:
    amber, red = limits
    return "red" if value > red else "amber" if value > amber else "green"


def _below(value: float, limits: tuple[float, float]) -> Light:
    amber, red = limits
    return "red" if value < red else "amber" if value < amber else "green"
