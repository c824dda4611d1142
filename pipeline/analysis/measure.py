"""Dependent variables: from each session's trials and events, and from the study's own tables, to rows."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.analysis import further_columns, orders, table_checks
from pipeline.analysis.copied_logs import copied_rows
from pipeline.analysis.missing import check_exclusion, excludable, finite_values, gaps, incomplete_trials, matches
from pipeline.analysis.practice_trials import Tables, without_practice
from pipeline.analysis.scores import instruments, items_of, reliability, score_values
from pipeline.analysis.values import (
    CELL,
    all_movements,
    all_trials,
    completion_values,
    given_table,
    measures_table,
    movement_values,
    no_values,
    rated_values,
    selection_values,
    tabled_values,
    typed_trials,
)
from pipeline.engine.stage import Outcome, Work
from pipeline.errors import PipelineError
from pipeline.study import given_tables
from pipeline.study.measures import has_total, reported_scales
from pipeline.study.settings import Exclusion, Study
from pipeline.tables import table as tables
from pipeline.tables.table import Row

THROUGHPUT = "throughput_bits_s"
ALL_DATA = "all_data"
"""The folder of `measures` and `observations` without the exclusions of study.yaml; written only where it has some."""


def run(work: Work) -> Outcome:
    """Write the study's trials, measures and exclusions; raises PipelineError for a table that cannot be used."""
    study = work.study
    typed = typed_trials(work)
    tables.give_back(0 if typed is None else len(typed))
    (trials, selections), movements = all_trials(work, typed), all_movements(work, typed)
    del typed
    tables.give_back(len(trials))
    every_trial = trials
    given, exclusions = without_practice(study, Tables(trials, selections, movements, measures_table(work)))
    trials, selections, movements, tabled = given.trials, given.selections, given.movements, given.measures
    values = _together(
        [
            *selection_values(study, trials, selections),
            *completion_values(work, exclusions),
            *movement_values(movements),
            *rated_values(work),
            *tabled_values(work, tabled),
        ]
    )
    _check_sources(values)
    checked = [*_table_checks(work, values, selections), *further_columns.check_rows(study, every_trial)]
    tables.give_back(len(values))
    scored_by = instruments(study, sorted(values["measure"].unique()))
    scores_by_item = items_of(scored_by)
    agreement = list(reliability(scored_by, values))
    scores = score_values(scored_by, values, exclusions)
    score_names = {name for instrument in scored_by for name in instrument.scores}
    if len(scores) or scores_by_item:
        values = pd.concat([values[~values["measure"].isin(_only_items(scores_by_item))], scores])
        values = values.reset_index(drop=True)
    known, all_values = excludable(work, values, every_trial) if study.exclusions else values[:0], values
    for excluded in study.exclusions:
        check_exclusion(excluded, known)
        values = values[~matches(excluded, values)]
        if excluded.measure is None:
            trials, selections, movements = (rows[~matches(excluded, rows)] for rows in (trials, selections, movements))
        exclusions.append(_listed(excluded))
    if any(excluded.trial is not None and excluded.measure is None for excluded in study.exclusions):
        values = _with_sequences_of(movements, values)
    exclusions += incomplete_trials(trials, movements)
    for name, rows in (("trials", trials), ("selections", selections), ("movements", movements)):
        tables.write(name, rows, work.out)
    del every_trial, given, trials, selections, movements, rows
    tables.give_back(len(values))
    values = finite_values(values, exclusions)
    measures = _with_totals(study, _cells(values, CELL), CELL, score_names)
    exclusions += gaps(work, measures)
    order_rows, sequences = _orders(work, tabled)
    checked += table_checks.order_rows(order_rows, _starts(work))
    checked += copied_rows(work.sessions, work.entries["ingest"])
    tables.write("checks", tables.of_rows("checks", checked), work.out)
    _write_values(study, measures, orders.with_periods(values, order_rows, sequences), score_names, work.out)
    if study.exclusions:
        whole, unfiltered = study.model_copy(update={"exclusions": ()}), finite_values(all_values, [])
        (work.out / ALL_DATA).mkdir()
        counted = _with_totals(whole, _cells(unfiltered, CELL), CELL, score_names)
        _write_values(
            whole, counted, orders.with_periods(unfiltered, order_rows, sequences), score_names, work.out / ALL_DATA
        )
    tables.write("orders", order_rows, work.out)
    tables.write("reliability", tables.of_rows("reliability", agreement), work.out)
    tables.write("exclusions", tables.of_rows("exclusions", exclusions), work.out)
    return Outcome()


def _together(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """All rows; those of a study that has but one kind of them keep their types, which take a third of the memory.

    The parts are let go: they are as large as the result.
    """
    together = pd.concat([part for part in parts if len(part)] or [no_values()]).reset_index(drop=True)
    parts.clear()
    tables.give_back(len(together))
    return together if "target" in together else together.assign(target=None)


def _listed(excluded: Exclusion) -> Row:
    """The row of `exclusions` for a decision of study.yaml; the table has no column for a trial."""
    trial = "" if excluded.trial is None else f"trial {excluded.trial}: "
    row = excluded.model_dump(exclude={"trial"})
    return {**row, "what": "excluded in study.yaml", "reason": f"{trial}{excluded.reason}"}


def _with_sequences_of(movements: pd.DataFrame, values: pd.DataFrame) -> pd.DataFrame:
    """Values with the throughput of the movements that are left: a sequence is of many trials."""
    kept = values[values["measure"] != THROUGHPUT]
    anew = pd.concat([rows for rows in movement_values(movements) if THROUGHPUT in set(rows["measure"])] or [kept[:0]])
    whole = values[values["measure"] == THROUGHPUT][["participant", "condition", "session"]].drop_duplicates()
    return pd.concat([kept, anew.merge(whole, on=["participant", "condition", "session"])]).reset_index(drop=True)


def _table_checks(work: Work, values: pd.DataFrame, selections: pd.DataFrame) -> list[Row]:
    """Rows of `checks` for what people typed or exported; what comes from logs was checked with them."""
    typed = {str(name) for name in (work.study.questionnaires, work.study.measures) if name is not None}
    file = given_table(work, "trials")
    values = values[["participant", "measure", "value", "source"]]
    if file is None:
        return table_checks.check_rows(values[values["source"].isin(typed)], None, work.study.scoring)
    theirs = {ours: given for given, ours in file.headers.items()}
    timed = (values["source"] == "the trials") & (values["measure"] == "trial_time_s")
    trials = values[values["source"].isin(typed) | timed]
    trials = trials.assign(source=trials["source"].where(trials["source"] != "the trials", file.path.name))
    times = (theirs.get("start_s", "start_s"), theirs.get("selection_s", "selection_s"))
    return table_checks.check_rows(trials, selections, work.study.scoring, times)


def _starts(work: Work) -> pd.DataFrame:
    """When each session's first event was logged, in ns since 1970; of those that have events."""
    rows = []
    for session, folder in zip(work.sessions, work.entries["ingest"], strict=True):
        times = tables.read_arrow("events", folder)["time_ns"]
        if len(times):
            ids = session.ids
            rows.append((ids["participant"], ids["condition"], times.to_numpy().min()))
    return pd.DataFrame(rows, columns=[*CELL, "start_ns"]).astype(dict.fromkeys(CELL, "string"))


def _only_items(scores_by_item: Mapping[str, Sequence[str]]) -> list[str]:
    """The items that are not reported by themselves, unlike the scales of the NASA-TLX."""
    return [name for name in scores_by_item if name.partition("/")[2] not in reported_scales(name.partition("/")[0])]


def _write_values(
    study: Study, measures: pd.DataFrame, values: pd.DataFrame, scores: Collection[str], folder: Path
) -> None:
    """Write one mean per cell, one per cell, session, period and sequence, and of trials also one per target."""
    observed = [*CELL, "session", "period", "sequence"]
    tables.write("measures", measures, folder)
    tables.write("observations", _with_totals(study, _cells(values, observed), observed, scores), folder)
    tables.write("target_observations", _cells_of_targets(values, observed), folder)


def _cells_of_targets(values: pd.DataFrame, observed: list[str]) -> pd.DataFrame:
    """The cells of values whose target is known, with the target as their one factor."""
    known = values["target"].notna()
    by_target = values if known.all() else values[known]
    if by_target.empty:
        return by_target
    factors = {place: json.dumps({"target": place}) for place in by_target["target"].unique()}
    return _cells(by_target.assign(factors=by_target["target"].map(factors)), observed)


def _orders(work: Work, tabled: tuple[pd.DataFrame, list[str]] | None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The tables `orders` and `sequences`: who met the conditions in which order, and the orders' labels."""
    file = given_table(work, "participants")
    return orders.gathered(
        work.study.conditions,
        work.sessions,
        tables.read("session_orders", work.entries["ingest"]),
        None if tabled is None else tabled[0],
        None if file is None else given_tables.read_participants(file),
    )


def _cells(values: pd.DataFrame, cell: list[str]) -> pd.DataFrame:
    """The mean and the number of values of each cell, further factor and measure: one row each."""
    keys = [*cell, "factors", "measure"]
    empty = {key: values[key].iloc[:1] for key in keys if len(values) and values[key].isna().all()}  # costs a key each
    by = [key for key in keys if key not in empty]
    grouped: Any = values.groupby(by, dropna=False, sort=False)["value"]
    found = grouped.mean().reset_index()
    found = found.assign(
        n=grouped.size().to_numpy(), **{key: one.repeat(len(found)).to_numpy() for key, one in empty.items()}
    )
    columns: pd.DataFrame = found[[*keys, "value", "n"]]
    return columns


def _with_totals(study: Study, cells: pd.DataFrame, cell: list[str], scores: Collection[str]) -> pd.DataFrame:
    """Cells and the questionnaires' totals without those that study.yaml excludes, in the order of the table."""
    rows, totals = cells, list(_totals(cells, cell, scores))
    if totals:
        columns = [*cell, "factors", "measure", "value", "n"]
        rows = pd.concat([cells, pd.DataFrame(totals, columns=columns)]).reset_index(drop=True)
    for excluded in study.exclusions:
        if excluded.session is None:
            rows = rows[~matches(excluded, rows)]
    return rows.sort_values(["measure", *CELL, "factors"], kind="stable")


def _totals(cells: pd.DataFrame, cell: list[str], scores: Collection[str]) -> Iterator[tuple[Any, ...]]:
    """`nasa_tlx/total`: a participant's plain sum over the scales; none where a scale is missing.

    A row is its cell, factors, name, value and n. Only instruments whose record says that a sum is reported have one.
    """
    parts = [str(measure).partition("/") for measure in cells["measure"]]
    keys = [*cell, "factors"]
    if not any(scale for _, _, scale in parts):
        return
    split = cells.assign(questionnaire=[part[0] for part in parts], scale=[part[2] for part in parts])
    ratings = split[(split["scale"] != "") & ~split["measure"].isin(list(scores))]
    for questionnaire, answered in ratings.groupby("questionnaire", sort=False):
        scales = set(answered["scale"])
        if "total" in scales or not has_total(str(questionnaire)):
            continue
        for key, rated in answered.groupby(keys, dropna=False, sort=False):
            if set(rated["scale"]) == scales:
                yield *key, f"{questionnaire}/total", rated["value"].sum(), rated["n"].min()


def _check_sources(values: pd.DataFrame) -> None:
    """PipelineError for a measure that comes from two places."""
    sources = values.groupby("measure")["source"].unique()
    for measure, places in sources.items():
        if len(places) > 1:
            raise PipelineError(f'"{measure}" is given both in {places[0]} and in {places[1]}; rename one of them')
