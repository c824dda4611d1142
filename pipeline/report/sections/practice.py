"""Practice: whether people became faster from trial to trial, and what that means for the comparison."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd

from pipeline.analysis.practice import ALL_TRIALS, LAST_HALF, in_one_session, with_enough
from pipeline.report import figures
from pipeline.report.document.model import Block, Paragraph, Section, Strong, Table, columns
from pipeline.report.sections.material import Material
from pipeline.statistics import OK
from pipeline.tables.table import Row
from pipeline.words.evidence import statistic
from pipeline.words.numbers import (
    MINUS,
    NO_VALUE,
    fraction,
    fraction_interval,
    p_phrase,
    p_value,
    percent,
)
from pipeline.words.phrases import listing

_ORDER_CHECKS = ("order of the conditions", "times in each period", "times each condition comes just before each other")


def section(material: Material) -> Section | None:
    """Practice; None where nobody has enough trials with a time."""
    rows = section_rows(material)
    if not rows:
        return None
    if rows[0]["remark"] is not None:
        text = (
            f"Whether people became faster with practice cannot be said: {rows[0]['remark']}. An order drawn anew for"
            " each participant would tell them apart."
        )
        return Section("practice", "Practice", (Paragraph((text,)),))
    movements = material.table("movements")
    timed = movements[movements["duration_s"].notna()]
    trials = with_enough(timed[in_one_session(timed)])
    conditions = material.study.conditions
    blocks: list[Block] = [
        material.drawn("practice", figures.practice, trials, pd.DataFrame(rows), conditions),
        Paragraph((Strong("What it means: "), " ".join(_meaning(material, rows)))),
        _table(rows, conditions),
    ]
    return Section("practice", "Practice", tuple(blocks))


def section_rows(material: Material) -> list[Row]:
    """The rows with a slope; none where nothing could be tested."""
    rows = [row for row in material.rows("learning") if row["slope"] is not None]
    return rows if any(row["status"] == OK for row in rows) else []


def _meaning(material: Material, rows: Sequence[Row]) -> Iterator[str]:
    """In plain words: where people became faster, where they still did at the end, what that does to means."""
    alpha, conditions = material.study.alpha, material.study.conditions
    of_conditions = [row for row in rows if row["trials"] == ALL_TRIALS and row["contrast"] in conditions]
    pairs = [row for row in rows if row["trials"] == ALL_TRIALS and row["contrast"] not in conditions]
    faster, slower = (
        [row["contrast"] for row in of_conditions if _significant(row, alpha) and sign * row["slope"] > 0]
        for sign in (-1, 1)
    )
    if faster:
        yield f"People became faster from trial to trial in {listing(faster)}."
    if slower:
        yield f"They became slower in {listing(slower)}, which is no practice; fatigue or harder targets would do it."
    others = [row["contrast"] for row in of_conditions if row["contrast"] not in (*faster, *slower)]
    if others:
        yield f"No change was found in {listing(others)}, which does not show that there is none."
    unfinished = [row["contrast"] for row in rows if row["trials"] == LAST_HALF and _unfinished(row, alpha)]
    if unfinished:
        yield (
            f"In {listing(unfinished)} they were still becoming faster in the last half of the trials, so more practice"
            " would change the means that are compared."
        )
    yield from _meaning_of_pairs(pairs, alpha)
    if faster or slower:
        yield from _meaning_of_order(material)


def _meaning_of_pairs(pairs: Sequence[Row], alpha: float) -> Iterator[str]:
    if not pairs:
        return
    differ = [row for row in pairs if _significant(row, alpha)]
    if differ:
        evidence = "; ".join(f"{_compared(row)}, {p_phrase(row['p_adjusted'], 'Holm-adjusted p')}" for row in differ)
        yield (
            f"Practice differed between conditions ({evidence}): how far apart they are depends on how many trials"
            " people had."
        )
    else:
        yield "No difference in practice was found between conditions, so nothing says that it favoured one of them."


def _meaning_of_order(material: Material) -> Iterator[str]:
    """Whether practice may also have gone from one condition to the next."""
    remarks = [row["remark"] for row in material.rows("design_check") if row["what"] in _ORDER_CHECKS and row["remark"]]
    if remarks:
        yield (
            "What people learn may also carry on from one condition to the next, and here the order of the conditions"
            " is not known or not balanced (see the design check): a part of the differences may be practice."
        )


def _significant(row: Row, alpha: float) -> bool:
    return row["p_adjusted"] is not None and row["p_adjusted"] < alpha


def _unfinished(row: Row, alpha: float) -> bool:
    return _significant(row, alpha) and row["slope"] < 0


def _compared(pair: Row) -> str:
    return str(pair["contrast"]).replace(" - ", f" {MINUS} ")


def _table(rows: Sequence[Row], conditions: Sequence[str]) -> Table:
    titles = ("Trials", "Condition or pair", "n", "When trials double", "Slope [95 % interval]", "Test", "p (Holm)")
    cells = tuple(
        (
            row["trials"].capitalize(),
            row["contrast"] if row["contrast"] in conditions else _compared(row),
            f"{row['n']}" if row["left_out"] == 0 else f"{row['n']} ({row['left_out']} left out)",
            _change(row),
            f"{fraction(row['slope'])} {fraction_interval(row['ci_low'], row['ci_high'], 3)}",
            statistic({**row, "df1": None}) if row["status"] == OK else row["status"],
            p_value(row["p_adjusted"]),
        )
        for row in rows
    )
    caption = (
        "Practice: each participant's slope of log time on log trial number (power law of practice), tested against"
        " zero and, of two conditions, against each other. Below zero is faster."
    )
    return Table("table-practice", caption, columns(titles, 2), cells)


def _change(row: Row) -> str:
    """`−7.0 %` of the time when trials double; `NO_VALUE` for a pair, whose figure is a ratio of two such ratios."""
    if row["first_trial_s"] is None and row["trials"] == ALL_TRIALS:
        return NO_VALUE
    change = row["ratio_when_trials_double"] - 1
    return f"{MINUS if change < 0 else '+'}{percent(abs(change))}"
