"""Dependent variables: from each session's trials and events, and from the study's own tables, to rows."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.analysis import orders
from pipeline.analysis.missing import check_exclusion, excludable, finite_values, gaps, incomplete_trials, matches
from pipeline.analysis.scores import instruments, items_of, reliability, score_values
from pipeline.analysis.values import (
    CELL,
    all_movements,
    all_trials,
    completion_values,
    measures_table,
    movement_values,
    rated_values,
    selection_values,
    table_path,
    tabled_values,
)
from pipeline.engine.stage import Outcome, Work
from pipeline.errors import PipelineError
from pipeline.study import csv_tables as study_tables
from pipeline.study.measures import has_total, reported_scales
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.table import Row

ALL_DATA = "all_data"
"""The folder of `measures` and `observations` as they would be if study.yaml excluded nothing; where it does."""


def run(work: Work) -> Outcome:
    """The study's trials, measures and exclusions; PipelineError for a bad table."""
    study = work.study
    exclusions: list[Row] = []
    (trials, selections), moved = all_trials(work), all_movements(work)
    tabled = measures_table(work)
    values = pd.concat(
        [
            selection_values(study, trials),
            completion_values(work, exclusions),
            *movement_values(moved),
            *rated_values(work),
            *tabled_values(work, tabled),
        ]
    ).reset_index(drop=True)
    _check_sources(values)
    scored_by = instruments(study, sorted(set(values["measure"])))
    counts_in = items_of(scored_by)
    agreement = list(reliability(scored_by, values))
    scores = score_values(scored_by, values, exclusions)
    names = {name for one in scored_by for name in one.scores}
    values = pd.concat([values[~values["measure"].isin(_only_items(counts_in))], scores]).reset_index(drop=True)
    known, everything = excludable(work, values, trials) if study.exclusions else values[:0], values
    for excluded in study.exclusions:
        check_exclusion(excluded, known)
        values = values[~matches(excluded, values)]
        if excluded.measure is None:
            trials, selections, moved = (rows[~matches(excluded, rows)] for rows in (trials, selections, moved))
        exclusions.append({**excluded.model_dump(), "what": "excluded in study.yaml"})
    exclusions += incomplete_trials(trials, moved)
    values = finite_values(values, exclusions)
    measures = _with_totals(study, _cells(values, CELL), CELL, names)
    exclusions += gaps(work, measures)
    run, sequences = _orders(work, tabled)
    _write_values(study, measures, orders.placed(values, run, sequences), names, work.out)
    if study.exclusions:
        whole, unfiltered = study.model_copy(update={"exclusions": ()}), finite_values(everything, [])
        (work.out / ALL_DATA).mkdir()
        counted = _with_totals(whole, _cells(unfiltered, CELL), CELL, names)
        _write_values(whole, counted, orders.placed(unfiltered, run, sequences), names, work.out / ALL_DATA)
    tables.write("orders", run, work.out)
    tables.write("reliability", tables.frame("reliability", agreement), work.out)
    tables.write("trials", trials, work.out)
    tables.write("selections", selections, work.out)
    tables.write("exclusions", tables.frame("exclusions", exclusions), work.out)
    return Outcome()


def _only_items(counts_in: Mapping[str, Sequence[str]]) -> list[str]:
    """The items that are nothing but items: what an instrument reports by itself, as the NASA-TLX does, stays."""
    return [name for name in counts_in if name.partition("/")[2] not in reported_scales(name.partition("/")[0])]


def _write_values(
    study: Study, measures: pd.DataFrame, placed: pd.DataFrame, scores: Collection[str], folder: Path
) -> None:
    """A study's values: a mean a cell, and the same with their session, period and sequence."""
    observed = [*CELL, "session", "period", "sequence"]
    tables.write("measures", measures, folder)
    tables.write("observations", _with_totals(study, _cells(placed, observed), observed, scores), folder)


def _orders(work: Work, tabled: tuple[pd.DataFrame, list[str]] | None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """In which order people met the conditions, and the labels of their sequences."""
    path = table_path(work, "participants")
    return orders.gathered(
        work.study.conditions,
        work.sessions,
        tables.read("session_orders", work.entries["ingest"]),
        None if tabled is None else tabled[0],
        None if path is None else study_tables.read_participants(path),
    )


def _cells(values: pd.DataFrame, cell: list[str]) -> pd.DataFrame:
    """The mean of each cell and further factor, and of how many values: one row a cell and measure."""
    found: Any = values.groupby([*cell, "factors", "measure"], dropna=False, sort=False)["value"]
    return pd.DataFrame(found.agg(["mean", "size"]).reset_index()).rename(columns={"mean": "value", "size": "n"})


def _with_totals(study: Study, cells: pd.DataFrame, cell: list[str], scores: Collection[str]) -> pd.DataFrame:
    """Cells and the questionnaires' totals, less those that study.yaml excludes, in the order of the table."""
    rows = pd.concat([cells, _totals(cells, cell, scores)]).reset_index(drop=True)
    for excluded in study.exclusions:
        if excluded.session is None:
            rows = rows[~matches(excluded, rows)]
    return rows.sort_values(["measure", *CELL, "factors"], kind="stable")


def _totals(cells: pd.DataFrame, cell: list[str], scores: Collection[str]) -> pd.DataFrame:
    """`nasa_tlx/total`: a participant's plain sum over the scales; none where a scale is missing.

    Of the instruments only those have one whose record says that people report a sum.
    """
    parts = [str(measure).partition("/") for measure in cells["measure"]]
    told = cells.assign(questionnaire=[part[0] for part in parts], scale=[part[2] for part in parts])
    ratings = told[(told["scale"] != "") & ~told["measure"].isin(list(scores))]
    rows = []
    keys = [*cell, "factors"]
    for questionnaire, answered in ratings.groupby("questionnaire", sort=False):
        scales = set(answered["scale"])
        if "total" in scales or not has_total(str(questionnaire)):
            continue
        for found, rated in answered.groupby(keys, dropna=False, sort=False):
            if set(rated["scale"]) == scales:
                rows.append((*found, f"{questionnaire}/total", rated["value"].sum(), rated["n"].min()))
    return pd.DataFrame(rows, columns=[*keys, "measure", "value", "n"])


def _check_sources(values: pd.DataFrame) -> None:
    """A measure comes from one place only."""
    sources = values.groupby("measure")["source"].unique()
    for measure, found in sources.items():
        if len(found) > 1:
            raise PipelineError(f'"{measure}" stands both in {found[0]} and in {found[1]}; rename one of them')
