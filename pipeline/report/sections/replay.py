"""The report of a replay: variants ranked, the lag and jitter of each, and what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import (
    Block,
    Column,
    Document,
    Notice,
    Paragraph,
    Section,
    Strong,
    Table,
    columns,
)
from pipeline.report.sections.accuracy import SMOOTHED_REMARK
from pipeline.report.sections.material import ORIGINS, draw_now
from pipeline.report.sections.provenance import program
from pipeline.tables import table as tables
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import SMOOTHED, reference_phrase
from pipeline.words.numbers import NO_VALUE, interval, milliseconds, number, percent
from pipeline.words.phrases import counted

_ROWS_MAX = 120
_NAMED_MAX = 3
_TITLES = (
    "Estimator",
    "Rank",
    "Sessions",
    "RMSE (mm)",
    "Lag (ms)",
    "Jitter (mm)",
    "In 95 % interval",
)
_AT_SELECTION = ("At the selections, RMSE (mm)",)
_NOTE = (
    "Means over sessions; in brackets 95 % t intervals over sessions, clipped to possible values. RMSE: root mean"
    " square distance to {standard}. Lag: positive = late. Jitter: SD while the hand is slower than 20 mm/s. In"
    " 95 % interval: share of instants and axes within 1.96 stated SDs of {standard}."
)
_NOTE_SELECTION = (
    " At the selections: root of the mean over sessions of the mean squared distance to the target that the estimator"
    " would have shown when people selected; they aimed with what they saw then, so this favours the displayed one."
)


def document(studies: Sequence[Row], results: Mapping[str, pd.DataFrame], drawn: Path) -> Document:
    """The whole report of `studies` and `results`, the tables of results.json; figures go into the folder `drawn`."""
    origins = dict.fromkeys(ORIGINS[study["data_origin"]] for study in studies)
    sections = [Section("variants", "Variants side by side", tuple(_variants(studies, results, drawn)))]
    left_out = _left_out(results["replay_exclusions"])
    if left_out is not None:
        sections.append(Section("exclusions", "Missing or excluded", (left_out,)))
    sections.append(Section("provenance", "Provenance", (_studies(studies), program())))
    subtitle = f"Replay of {counted(len(studies), 'study', 'studies')}"
    return Document("Variants of estimators", subtitle, " ".join(origins), tuple(sections))


def _variants(studies: Sequence[Row], results: Mapping[str, pd.DataFrame], drawn: Path) -> Iterator[Block]:
    every = list(tables.records("replay_means", results["replay_means"]))
    yield Paragraph(
        (
            "Every variant was run over the same raw streams and asked, at the arrival of each acceleration, where the"
            " hand is at that instant, from what had arrived by then. An estimator without brackets has its own"
            " settings.",
        )
    )
    if (results["accuracy"]["reference"] == SMOOTHED).any():
        yield Paragraph((Strong("No reference was recorded in some study."), SMOOTHED_REMARK))
    cautions = list(in_doubt(studies))
    if cautions:
        yield Notice("The data contradict themselves or study.yaml", tuple((caution,) for caution in cautions))
    for index, study in enumerate([None, *(study["name"] for study in studies)]):
        rows = [row for row in every if row["study"] == study]
        if rows:
            accuracy = results["accuracy"]
            of_study = accuracy if study is None else accuracy[accuracy["study"] == study]
            standard = reference_phrase(of_study["reference"])
            where = "all studies together" if study is None else f"study “{study}”"
            yield from _table_and_figure(rows, where, standard, drawn / f"trade-off-{index}.svg")
    if all(row["rank"] is None for row in every):
        return
    yield Notice(
        "The best of many",
        (
            (
                "The best of several variants is partly best by chance, so its figures here are too good. Try settings"
                " chosen this way on sessions that were not used for the choice.",
            ),
        ),
    )


def in_doubt(studies: Sequence[Row]) -> Iterator[str]:
    """A caution for each study with a red check: the order of its variants is that of figures not to be relied on."""
    for study in studies:
        red = study["sessions_in_doubt"]
        if red:
            named = ", ".join(red[:_NAMED_MAX]) + (", …" if len(red) > _NAMED_MAX else "")
            yield (
                f"{study['name']}: {len(red)} of {counted(study['sessions'], 'session')} with a red check ({named}): do"
                " not rely on the order of the variants before that is resolved; steadyhand report says what is wrong."
            )


def _table_and_figure(rows: Sequence[Row], where: str, standard: str, path: Path) -> Iterator[Block]:
    """One study's table and figure, or those of all together."""
    best = rows[0]
    if best["rank"] is not None:
        evidence = f"RMSE {_with_interval(best, 'rmse')} mm over {counted(best['n'], 'session')}."
        yield Paragraph((Strong(f"Least error, {where}: {_label(best)}. "), evidence))
    selections = any(row["selection_n"] for row in rows)
    titles = _TITLES + (_AT_SELECTION if selections else ())
    shown = f" The first {_ROWS_MAX} of {len(rows)}." if len(rows) > _ROWS_MAX else ""
    yield Table(
        path.stem.replace("trade-off", "table-variants"),
        f"Variants by their mean RMSE, {where}.{shown}"
        if SMOOTHED not in standard
        else f"Variants in the order asked for, {where}: RMSE and lag are distances from {standard}.{shown}",
        tuple(Column(title, title != "Estimator") for title in titles),
        tuple(_cells(row)[: len(titles)] for row in rows[:_ROWS_MAX]),
        _NOTE.format(standard=standard) + (_NOTE_SELECTION if selections else ""),
    )
    ranked = [row for row in rows if row["rank"] is not None and (row["lag_s"], row["jitter_mm"]) != (None, None)]
    if SMOOTHED in standard:
        yield Paragraph(("Without a recorded reference variants are not ranked.",))
    elif not ranked:
        yield Paragraph(("Neither lag nor jitter could be measured, so there is no figure of them against the error.",))
    else:
        yield draw_now(path, figures.trade_off, tables.frame("replay_means", ranked))


def _label(row: Row) -> str:
    return str(row["variant"] or row["estimator"])


def _cells(row: Row) -> tuple[str, ...]:
    lag = milliseconds(row["lag_s"])
    if row["lag_low_s"] is not None:
        lag += f" [{milliseconds(row['lag_low_s'])}, {milliseconds(row['lag_high_s'])}]"
    return (
        _label(row),
        NO_VALUE if row["rank"] is None else str(row["rank"]),
        str(row["n"]),
        _with_interval(row, "rmse"),
        lag,
        _with_interval(row, "jitter"),
        percent(row["coverage_95"], 0),
        _with_interval(row, "selection_rmse"),
    )


def _with_interval(row: Row, figure: str) -> str:
    """A figure in mm and, where there is one, its interval."""
    low, high = row[f"{figure}_low_mm"], row[f"{figure}_high_mm"]
    return number(row[f"{figure}_mm"]) + ("" if low is None else f" {interval(low, high)}")


def _left_out(excluded: pd.DataFrame) -> Table | None:
    rows = list(tables.records("replay_exclusions", excluded))
    if not rows:
        return None
    more = f" The first {_ROWS_MAX} of {len(rows)}; all are in results.json." if len(rows) > _ROWS_MAX else ""
    cells = tuple(
        tuple(row[key] or NO_VALUE for key in ("study", "session", "variant", "what", "reason"))
        for row in rows[:_ROWS_MAX]
    )
    titles = columns(("Study", "Session", "Variant", "What", "Why"), 5)
    return Table(
        "table-exclusions", f"Sessions and files that are not in this report, or only in part.{more}", titles, cells
    )


def _studies(studies: Sequence[Row]) -> Table:
    cells = tuple((study["name"], study["title"], study["data_origin"], str(study["sessions"])) for study in studies)
    titles = columns(("Study", "Title", "Data", "Sessions"), 3)
    return Table("table-studies", "What was replayed; every number of this report is in results.json.", titles, cells)
