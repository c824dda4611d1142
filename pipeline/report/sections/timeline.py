"""What arrived when, as a figure for the section on quality."""

from __future__ import annotations

from pipeline.report import figures
from pipeline.report.document.model import Figure
from pipeline.report.sections.material import Material, first_of
from pipeline.tables import table as tables

_SESSIONS_MAX = 24  # a page holds no more rows


def figure(material: Material) -> Figure | None:
    """The first sessions' streams, silences and events; None for a study of tables alone."""
    first = range(min(len(material.sessions), _SESSIONS_MAX))
    rates = material.table_of("stream_rates", first)
    if rates.empty:
        return None
    events = material.table_of("events", first)
    exclusions = tables.frame("exclusions", material.rows("exclusions"))
    more = first_of(_SESSIONS_MAX, len(material.sessions), "sessions")
    return material.drawn("timeline", figures.timeline, rates, events, exclusions, more=more)
