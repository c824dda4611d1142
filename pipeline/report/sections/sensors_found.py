"""What each session's sensors turned out to be like, as the adaptive filter finds them."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.report.document.model import Folded, Table, columns
from pipeline.report.sections.material import Material
from pipeline.tables.table import Row
from pipeline.words.numbers import NO_VALUE, interval, number

_ROWS_MAX = 40  # a page stays readable; tables/sensors_found.csv has them all
_MS_PER_S = 1000.0


def folded(material: Material) -> list[Folded]:
    """A table per session and estimator; nothing where no estimator finds its sensors."""
    found: dict[tuple[str, str], dict[str, Row]] = {}
    for row in material.rows("sensors_found"):
        found.setdefault((row["session"], row["estimator"]), {})[row["quantity"]] = row
    if not found:
        return []
    several = len({estimator for _, estimator in found}) > 1
    cells = tuple(
        (
            f"{session}, {estimator}" if several else session,
            _figure(figures, "tracker_noise", 1),
            number(figures["tracker_noise"]["stated"], 1),
            _figure(figures, "tracker_late", 0, _MS_PER_S),
            *(_three(figures, name, digits) for name, digits in (("mounting", 1), ("lever_arm", 0))),
            _figure(figures, "heading", 1),
            _figure(figures, "scale", 1),
        )
        for (session, estimator), figures in list(found.items())[:_ROWS_MAX]
    )
    titles = (
        "Session",
        "Tracker's noise (mm)",
        "Stated (mm)",
        "Tracker later than stated (ms)",
        "Phone turned, x, y, z (°)",
        "Lever arm x, y, z (mm)",
        "Heading off (°)",
        "Scale off (%)",
    )
    table = Table(
        "table-sensors-found",
        "What the sensors turned out to be like by the end of each session, as the adaptive filter finds and uses it,"
        " with 95 % intervals. Look for what lies far from what study.yaml states.",
        columns(titles, 1),
        cells,
        "Of the two clocks only the difference shows: a phone that stamps early looks like a late tracker. Whoever"
        " knows which is right names it in study.yaml, as the estimator's trusted_clock. Wide intervals: the hand moved"
        " too little to tell.",
    )
    return [Folded("What the sensors turned out to be like", (table,))]


def _figure(figures: Mapping[str, Row], quantity: str, digits: int, factor: float = 1.0) -> str:
    row = figures.get(quantity)
    if row is None:
        return NO_VALUE
    value, low, high = (factor * row[name] for name in ("value", "ci_low", "ci_high"))
    return f"{number(value, digits)} {interval(low, high, digits)}"


def _three(figures: Mapping[str, Row], quantity: str, digits: int) -> str:
    """`1.2 ± 0.3, …`, of the three axes."""
    rows = [figures.get(f"{quantity}_{axis}") for axis in "xyz"]
    known = [row for row in rows if row is not None]
    return (
        ", ".join(
            f"{number(row['value'], digits)} ± {number((row['ci_high'] - row['ci_low']) / 2, digits)}" for row in known
        )
        or NO_VALUE
    )
