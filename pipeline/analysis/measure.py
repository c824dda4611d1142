"""Dependent variables: from each session's trials and events, and from the study's own tables, to rows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.analysis import orders
from pipeline.engine.stage import Outcome, Work
from pipeline.errors import PipelineError, did_you_mean
from pipeline.sessions import movements
from pipeline.sessions.trials import selections_by_trial, with_movements
from pipeline.study import csv_tables as study_tables
from pipeline.study.settings import Exclusion, Study
from pipeline.tables import table as tables

Row = dict[str, Any]
CELL = ["participant", "condition"]
ALL_DATA = "all_data"
"""The folder of `measures` and `observations` as they would be if study.yaml excluded nothing; where it does."""


def run(work: Work) -> Outcome:
    """The study's trials, measures and exclusions; PipelineError for a bad table."""
    study = work.study
    exclusions: list[Row] = []
    (trials, selections), moved = _trials(work), _movements(work)
    tabled = _measures_table(work)
    values = pd.concat(
        [
            _selection_values(study, trials),
            _completion_values(work, exclusions),
            *_movement_values(moved),
            *_rated_values(work),
            *_tabled_values(work, tabled),
        ]
    ).reset_index(drop=True)
    _check_sources(values)
    known, everything = _known(work, values, trials) if study.exclusions else values[:0], values
    for excluded in study.exclusions:
        _check_exclusion(excluded, known)
        values = values[~_matches(excluded, values)]
        if excluded.measure is None:
            trials, selections, moved = (rows[~_matches(excluded, rows)] for rows in (trials, selections, moved))
        exclusions.append({**excluded.model_dump(), "what": "excluded in study.yaml"})
    exclusions += _incomplete_trials(trials, moved)
    values = _finite(values, exclusions)
    measures = _with_totals(study, _cells(values, CELL), CELL)
    exclusions += _gaps(work, measures)
    run, sequences = _orders(work, tabled)
    _write_values(study, measures, orders.placed(values, run, sequences), work.out)
    if study.exclusions:
        whole, unfiltered = study.model_copy(update={"exclusions": ()}), _finite(everything, [])
        (work.out / ALL_DATA).mkdir()
        counted = _with_totals(whole, _cells(unfiltered, CELL), CELL)
        _write_values(whole, counted, orders.placed(unfiltered, run, sequences), work.out / ALL_DATA)
    tables.write("orders", run, work.out)
    tables.write("trials", trials, work.out)
    tables.write("selections", selections, work.out)
    tables.write("exclusions", tables.frame("exclusions", exclusions), work.out)
    return Outcome()


def _write_values(study: Study, measures: pd.DataFrame, placed: pd.DataFrame, folder: Path) -> None:
    """A study's values: a mean a cell, and the same with their session, period and sequence."""
    observed = [*CELL, "session", "period", "sequence"]
    tables.write("measures", measures, folder)
    tables.write("observations", _with_totals(study, _cells(placed, observed), observed), folder)


def _path(work: Work, field: str) -> Any:
    name = getattr(work.study, field)
    return None if name is None else work.folder / name


def _trials(work: Work) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The trials of all sessions, or of trials.csv, as recorded and as each estimator would have shown; selections."""
    trials = tables.read("trials", work.entries["assess"])
    path = _path(work, "trials")
    if path is None:
        return trials, tables.read("selections", work.entries["assess"])
    if len(trials):
        raise PipelineError(
            f"{path.name}: the logs hold trials too, and would be mixed with these; take `trials:` or `events:` out of "
            "study.yaml"
        )
    table = study_tables.read_trials(path, work.study.conditions)
    squared = np.zeros(len(table))
    for axis in "xyz":
        # A trial counts over the axes its target has; a selection that lacks one of them cannot be measured.
        aimed = table[f"target_{axis}_mm"].notna() if axis == "z" else pd.Series(True, index=table.index)
        apart = (table[f"selected_{axis}_mm"] - table[f"target_{axis}_mm"]) ** 2
        squared = squared + apart.where(aimed, 0.0).to_numpy()
    duration_s = table["selection_s"] - table["start_s"]
    tabled = table[[*CELL, "trial"]].assign(
        session=table["session"].replace("", None),
        estimator="recorded",
        squared_error_mm2=squared,
        position_error_mm=np.sqrt(squared),
        duration_s=duration_s.where(duration_s >= 0),
    )
    targets = table[["trial", *CELL, *(f"target_{axis}_mm" for axis in "xyz")]]
    selected = targets.assign(
        session=tabled["session"], **{f"{axis}_mm": table[f"selected_{axis}_mm"] for axis in "xyz"}
    )
    return tables.as_table("trials", tabled), tables.as_table("selections", selected)


def _movements(work: Work) -> pd.DataFrame:
    """The movements of all sessions, or of trials.csv in the order of their starts, and whose they are."""
    people = pd.DataFrame([session.ids for session in work.sessions], columns=[*CELL, "session"])
    logged = tables.read("movements", work.entries["assess"]).merge(people.astype("string"), on="session")
    path = _path(work, "trials")
    if path is None:
        return logged
    table = study_tables.read_trials(path, work.study.conditions).sort_values("start_s", kind="stable")
    table["left_s"] = table["selection_s"]
    for axis in "xyz":
        table[f"left_{axis}_mm"] = table[f"selected_{axis}_mm"]
    cells = [with_movements(rows) for _, rows in table.groupby([*CELL, "session"], sort=True)]
    told = pd.concat(cells).assign(session=lambda rows: rows["session"].replace("", None))
    return pd.concat([tables.as_table("movements", told), told[CELL].astype("string")], axis=1)


def _values(rows: pd.DataFrame, measure: str, column: str, source: str) -> pd.DataFrame:
    """Rows of one measure: participant, condition, session, factors, period, measure, value, and where it stands."""
    return pd.DataFrame(
        {
            "participant": rows["participant"],
            "condition": rows["condition"],
            "session": rows["session"],
            "factors": None,
            "period": pd.NA,
            "measure": measure,
            "value": rows[column].astype("float64"),
            "source": source,
        }
    ).astype({"factors": "object", "period": "Int64"})


def _selection_values(study: Study, trials: pd.DataFrame) -> pd.DataFrame:
    """Squared selection errors and durations, a row a trial; a cell's mean is its measure."""
    recorded = trials[trials["estimator"] == "recorded"]
    selected = recorded[recorded["squared_error_mm2"].notna()]
    timed = recorded[recorded["duration_s"].notna()]
    parts = [
        _values(selected, "selection_mse_mm2", "squared_error_mm2", "the trials"),
        _values(timed, "trial_time_s", "duration_s", "the trials"),
    ]
    if study.display is not None and study.display.unit == "px":
        in_px = parts[0].assign(measure="selection_mse_px2")
        parts.append(in_px.assign(value=in_px["value"] * study.display.px_per_mm**2))
    return pd.concat(parts)


def _movement_values(moved: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Throughput, a row a sequence of a session, and what the hand's path says, a row a trial."""
    rows = [
        (*cell, throughput)
        for cell, trials in moved.groupby([*CELL, "session"], dropna=False, sort=True)
        for throughput in movements.throughputs(
            *(trials[name].to_numpy(np.float64) for name in ("amplitude_mm", "moved_mm", "along_mm", "duration_s"))
        )
    ]
    sequences = pd.DataFrame(rows, columns=[*CELL, "session", "throughput"])
    yield _values(sequences, "throughput_bits_s", "throughput", "the trials")
    covered = moved["path_length_mm"].where(moved["path_length_mm"] > 0)
    for_measures = moved.assign(efficiency=moved["shortest_mm"] / covered)
    for measure, column in (
        ("path_efficiency", "efficiency"),
        ("overshoot_mm", "overshoot_mm"),
        ("corrections", "corrections"),
    ):
        yield _values(for_measures[for_measures[column].notna()], measure, column, "the trials")


def _completion_values(work: Work, exclusions: list[Row]) -> pd.DataFrame:
    """From session_start to the last selection, a row a session that has both; what does not fit is listed."""
    rows = []
    for session, folder in sorted(zip(work.sessions, work.entries["ingest"], strict=True), key=lambda one: one[0].id):
        happened = tables.read_arrow("events", folder).to_pylist()
        who: Row = session.ids
        begins, selections = (
            [event["time_ns"] for event in happened if event["type"] == kind] for kind in ("session_start", "selection")
        )
        stray = sum(place < 0 for _, place in selections_by_trial(happened)[1])
        if stray:
            reason = f"{stray} without the trial_start of their trial"
            exclusions.append({**who, "what": "selections outside any trial", "reason": reason})
        if begins and selections:
            seconds = float(max(selections) - min(begins)) * tables.NANOSECONDS
            if seconds < 0:
                reason = "the last selection comes before session_start"
                exclusions.append({**who, "measure": "completion_time_s", "what": "impossible time", "reason": reason})
            else:
                rows.append((session.participant, session.condition, session.id, seconds))
    found = pd.DataFrame(rows, columns=[*CELL, "session", "seconds"])
    return _values(found, "completion_time_s", "seconds", "the events")


def _rated_values(work: Work) -> Iterator[pd.DataFrame]:
    """Ratings from questionnaires."""
    path = _path(work, "questionnaires")
    if path is not None:
        ratings = study_tables.read_questionnaires(path, work.study.conditions)
        ratings["session"] = ratings.get("session")
        names = ratings["questionnaire"] + "/" + ratings["scale"]
        yield _values(ratings, "", "rating", str(work.study.questionnaires)).assign(measure=names)


def _measures_table(work: Work) -> tuple[pd.DataFrame, list[str]] | None:
    """The table of measures and its further factors, if the study has one."""
    path = _path(work, "measures")
    return None if path is None else study_tables.read_measures(path, work.study.conditions)


def _tabled_values(work: Work, tabled: tuple[pd.DataFrame, list[str]] | None) -> Iterator[pd.DataFrame]:
    """Further dependent variables from the study's table of measures."""
    if tabled is None:
        return
    table, factors = tabled
    rows = _values(table.assign(session=None), "", "value", str(work.study.measures)).assign(measure=table["measure"])
    if "period" in table:
        rows["period"] = table["period"]
    if factors:
        told = [{k: v for k, v in zip(factors, row, strict=True) if v} for row in table[factors].to_numpy()]
        rows["factors"] = [json.dumps(facts) if facts else None for facts in told]
    yield rows


def _orders(work: Work, tabled: tuple[pd.DataFrame, list[str]] | None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """In which order people met the conditions, and the labels of their sequences."""
    path = _path(work, "participants")
    return orders.gathered(
        work.study.conditions,
        work.sessions,
        tables.read("session_orders", work.entries["ingest"]),
        None if tabled is None else tabled[0],
        None if path is None else study_tables.read_participants(path),
    )


def _matches(excluded: Exclusion, rows: pd.DataFrame) -> pd.Series:
    """Which rows a decision to exclude takes out."""
    hit = pd.Series(True, index=rows.index)
    for column in ("participant", "condition", "session", "measure"):
        wanted = getattr(excluded, column)
        if wanted is not None and column in rows:
            hit &= (rows[column] == wanted).fillna(False)
    return hit.astype(bool)


def _known(work: Work, values: pd.DataFrame, trials: pd.DataFrame) -> pd.DataFrame:
    """Every combination of ids that an exclusion may name: what is in the data, totals, and sessions set aside."""
    told = [session.ids for session in (*work.sessions, *(aside for aside, _ in work.set_aside))]
    columns = [*CELL, "session", "measure"]
    totals = values[values["measure"].str.contains("/")].copy()
    totals["measure"] = totals["measure"].str.partition("/")[0] + "/total" if len(totals) else totals["measure"]
    sessions = pd.DataFrame(told, columns=columns).astype("object")
    return pd.concat(
        [
            values[columns].astype("object"),
            totals[columns].astype("object"),
            sessions,
            trials.reindex(columns=columns).astype("object"),
        ]
    )


def _check_exclusion(excluded: Exclusion, known: pd.DataFrame) -> None:
    """An exclusion that fits nothing in the data is an error, for it is likely misspelt."""
    for column in ("participant", "session", "measure"):
        wanted, there = getattr(excluded, column), sorted(set(known[column].dropna()))
        if wanted is not None and wanted not in there:
            hint = did_you_mean(wanted, there)
            raise PipelineError(f'study.yaml: exclusions: there is no {column} "{wanted}" in the data{hint}')
    if not _matches(excluded, known).any():
        named = ", ".join(f"{key} {value}" for key, value in excluded.model_dump().items() if value and key != "reason")
        raise PipelineError(f"study.yaml: exclusions: nothing in the data fits {named}; there is nothing to exclude")


def _incomplete_trials(trials: pd.DataFrame, moved: pd.DataFrame) -> list[Row]:
    """Trials without a measurable selection, a duration or a path of the hand, counted by session or cell."""
    recorded = trials[trials["estimator"] == "recorded"]
    timed = moved[moved["duration_s"].notna()]
    rows = []
    cell: Any
    for measure, column, what, all_trials in (
        ("selection_mse_mm2", "squared_error_mm2", "trials without a measurable selection", recorded),
        ("trial_time_s", "duration_s", "trials without a duration", recorded),
        ("path_efficiency", "path_length_mm", "trials without a path of the hand", timed),
    ):
        missing = all_trials[all_trials[column].isna()]
        if len(missing) == len(all_trials):
            continue  # a study that does not measure this at all
        for cell, found in missing.groupby([*CELL, "session"], dropna=False, sort=True):
            participant, condition, session = cell
            named = ", ".join(str(trial) for trial in found["trial"][:10]) + (", …" if len(found) > 10 else "")
            rows.append(
                {
                    "participant": participant,
                    "condition": condition,
                    "session": None if pd.isna(session) else session,
                    "measure": measure,
                    "what": what,
                    "reason": f"{len(found)} of the cell's trials: {named}",
                }
            )
    return rows


def _finite(values: pd.DataFrame, exclusions: list[Row]) -> pd.DataFrame:
    """Values that are numbers; the others are listed."""
    bad = values[~np.isfinite(values["value"])]
    for row in bad.itertuples():
        what = "missing value" if pd.isna(row.value) else "infinite value"
        at = f" ({row.factors})" if isinstance(row.factors, str) else ""
        exclusions.append(
            {
                "participant": row.participant,
                "condition": row.condition,
                "measure": row.measure,
                "what": what,
                "reason": f"the cell is empty or not a finite number{at}",
            }
        )
    kept: pd.DataFrame = values.drop(index=bad.index)
    return kept


def _cells(values: pd.DataFrame, cell: list[str]) -> pd.DataFrame:
    """The mean of each cell and further factor, and of how many values: one row a cell and measure."""
    found: Any = values.groupby([*cell, "factors", "measure"], dropna=False, sort=False)["value"]
    return pd.DataFrame(found.agg(["mean", "size"]).reset_index()).rename(columns={"mean": "value", "size": "n"})


def _with_totals(study: Study, cells: pd.DataFrame, cell: list[str]) -> pd.DataFrame:
    """Cells and the questionnaires' totals, less those that study.yaml excludes, in the order of the table."""
    rows = pd.concat([cells, _totals(cells, cell)]).reset_index(drop=True)
    for excluded in study.exclusions:
        if excluded.session is None:
            rows = rows[~_matches(excluded, rows)]
    return rows.sort_values(["measure", *CELL, "factors"], kind="stable")


def _totals(cells: pd.DataFrame, cell: list[str]) -> pd.DataFrame:
    """`<questionnaire>/total`: a participant's sum over the scales; none where a scale is missing."""
    parts = [str(measure).partition("/") for measure in cells["measure"]]
    told = cells.assign(questionnaire=[part[0] for part in parts], scale=[part[2] for part in parts])
    ratings = told[told["scale"] != ""]
    rows = []
    keys = [*cell, "factors"]
    for questionnaire, answered in ratings.groupby("questionnaire", sort=False):
        scales = set(answered["scale"])
        if "total" in scales:
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


def _gaps(work: Work, measures: pd.DataFrame) -> list[Row]:
    """Participants without a condition, and cells without a measure that others have."""
    listed = set(measures["participant"]) | {str(session.participant) for session in work.sessions}
    rows: list[Row] = []
    path = _path(work, "participants")
    if path is not None:
        named = study_tables.read_participants(path)["participant"]
        for participant in sorted(listed - set(named)):
            hint = did_you_mean(participant, sorted(named)) if len(named) else ""
            reason = f"kept; check its spelling{hint}"
            rows.append({"participant": participant, "what": "not in participants", "reason": reason})
        listed |= set(named)
    seen = set(zip(measures["participant"], measures["condition"], strict=True))
    seen |= {(session.participant, session.condition) for session in work.sessions}
    for participant in sorted(listed):
        for condition in work.study.conditions:
            if (participant, condition) not in seen and not _decided(work.study, participant, condition, None):
                cell = {"participant": participant, "condition": condition}
                rows.append({**cell, "what": "no data", "reason": "the participant has nothing in this condition"})
    return rows + _missing_cells(work.study, measures, seen)


def _decided(study: Study, participant: str, condition: str, measure: str | None) -> bool:
    """Is the cell empty because study.yaml excludes it?"""
    return any(
        excluded.session is None and excluded.covers(participant=participant, condition=condition, measure=measure)
        for excluded in study.exclusions
    )


def _missing_cells(study: Study, measures: pd.DataFrame, seen: set[Any]) -> list[Row]:
    """Cells, and cells of a further factor, that others have."""
    rows = []
    for measure, values in measures.groupby("measure", sort=True):
        every = sorted({factors for factors in values["factors"] if isinstance(factors, str)})
        have: dict[Any, set[str]] = {}
        for row in values.itertuples():
            have.setdefault((row.participant, row.condition), set()).add(str(row.factors))
        for participant, condition in sorted(seen):
            if _decided(study, participant, condition, str(measure)):
                continue
            lacking = [factors for factors in every if factors not in have.get((participant, condition), set())]
            if (participant, condition) in have and not lacking:
                continue
            whole = (participant, condition) not in have
            at = "" if whole else f" ({'; '.join(lacking)})"
            cell = {"participant": participant, "condition": condition, "measure": measure}
            rows.append({**cell, "what": "missing cell", "reason": f"others have this measure{at}"})
    return rows
