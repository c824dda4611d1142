"""Fitts' law: movement time over difficulty, where the study has targets of known distance and width."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import Block, Notice, Paragraph, Section, Strong, Table, Text, columns
from pipeline.report.figures.fitts_law import line_in_words
from pipeline.report.sections.material import Material
from pipeline.tables.table import Row
from pipeline.words.numbers import NO_VALUE, fraction, interval, number
from pipeline.words.phrases import listing


def section(material: Material) -> Section | None:
    """Fitts' law; None where nobody made five movements of one distance and width."""
    rows = material.rows("fitts")
    if not rows:
        return None
    text = (
        "Fitts' law says that movement time grows in a line with the index of difficulty, ID = log₂(A/W + 1) of the"
        " distance A and the width W. Nominal difficulty is that of the targets as shown; effective difficulty takes W"
        " as 4.133 SD of where people selected, and A as the distance they covered."
    )
    blocks: list[Block] = [Paragraph((text,))]
    if any(row["slope_s_bit"] is not None for row in rows):
        points = pd.DataFrame(material.rows("fitts_points"))
        blocks.append(material.drawn("fitts", figures.fitts, points, pd.DataFrame(rows), material.study.conditions))
    blocks.append(Paragraph((Strong("Fitts' law: "), f"{_sentence(rows)}.")))
    blocks += [_table(rows), *_cautions(rows)]
    return Section("fitts", "Fitts' law", tuple(blocks))


def _sentence(rows: Sequence[Row]) -> str:
    """Each condition's line and throughput, by effective difficulty where it is known."""
    effective = [row for row in rows if row["difficulty"] == "effective"] or list(rows)
    parts = []
    for row in effective:
        line = "no line"
        if row["slope_s_bit"] is not None:
            line = f"MT = {line_in_words(row['intercept_s'], row['slope_s_bit'])}, R² = {fraction(row['r_squared'])}"
        parts.append(f"{row['condition']}, {line}, throughput {number(row['throughput_bits_s'])} bit/s")
    return f"by {effective[0]['difficulty']} difficulty, {'; '.join(parts)}"


def _table(rows: Sequence[Row]) -> Table:
    of_line = ("Intercept (s) [95 % interval]", "Slope (s/bit) [95 % interval]", "R²")
    titles = ("Condition, difficulty", "n", "Points", *of_line, "Throughput (bit/s)")
    cells = tuple(
        (
            f"{row['condition']}, {row['difficulty']}",
            f"{row['n']}",
            f"{row['blocks']}",
            _with_interval(row["intercept_s"], row["intercept_ci_low_s"], row["intercept_ci_high_s"]),
            _with_interval(row["slope_s_bit"], row["slope_ci_low_s_bit"], row["slope_ci_high_s_bit"]),
            fraction(row["r_squared"]),
            number(row["throughput_bits_s"]),
        )
        for row in rows
    )
    caption = (
        "Fitts' law by condition. The line goes through the means over participants of each distance and width;"
        " throughput is the mean over participants of difficulty over movement time, and no inverse of the slope."
    )
    return Table("table-fitts", caption, columns(titles, 1), cells)


def _with_interval(value: float | None, low: float | None, high: float | None) -> str:
    return NO_VALUE if value is None else f"{number(value)} {interval(low, high)}"


def _cautions(rows: Sequence[Row]) -> list[Block]:
    """Remarks against a line, each once, with all the lines that it concerns."""
    lines: dict[str, list[str]] = {}
    for row in rows:
        if row["remark"] is not None:
            lines.setdefault(row["remark"], []).append(f"{row['condition']} ({row['difficulty']})")
    if not lines:
        return []
    texts: tuple[Text, ...] = tuple((Strong(f"{listing(names)}: "), f"{remark}.") for remark, names in lines.items())
    return [Notice("With care", texts)]
