"""Dependent variables: from each session's trials and events, and from the study's own tables, to rows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from pipeline import study_tables, tables
from pipeline.errors import PipelineError, did_you_mean
from pipeline.stage import Outcome, Work
from pipeline.study import Exclusion, Study

Row = dict[str, Any]
CELL = ["participant", "condition"]


def run(work: Work) -> Outcome:
    """The study's trials, measures and exclusions; PipelineError for a bad table."""
    study = work.study
    exclusions: list[Row] = []
    trials = _trials(work)
    values = pd.concat([_selection_values(study, trials), _completion_values(work), *_tabled_values(work)])
    values = _without_excluded(study, values, trials, exclusions)
    trials = _trials_without_excluded(study, trials)
    exclusions += _unselected(trials)
    values = _finite(values, exclusions)
    _check_sources(values)
    cells = _cells(values)
    measures = pd.concat([cells, _totals(cells)])
    exclusions += _gaps(work, measures)
    tables.write("trials", trials, work.out)
    tables.write("measures", measures.sort_values(["measure", *CELL, "factors"], kind="stable"), work.out)
    tables.write("exclusions", tables.frame("exclusions", exclusions), work.out)
    return Outcome()


def _path(work: Work, field: str) -> Any:
    name = getattr(work.study, field)
    return None if name is None else work.folder / name


def _trials(work: Work) -> pd.DataFrame:
    """The trials of all sessions and of trials.csv, as recorded and as each estimator would have shown."""
    trials = tables.read("trials", work.entries["assess"])
    path = _path(work, "trials")
    if path is None:
        return trials
    table = study_tables.read_trials(path, work.study.conditions)
    squared = np.zeros(len(table))
    for axis in "xyz":
        target, selected = f"target_{axis}_mm", f"selected_{axis}_mm"
        if target in table and table[target].notna().any():
            squared = squared + (table[selected] - table[target]).fillna(np.nan if axis in "xy" else 0.0) ** 2
    tabled = table[[*CELL, "trial"]].assign(
        session=table["session"].replace("", None),
        estimator="recorded",
        squared_error_mm2=squared,
        position_error_mm=np.sqrt(squared),
        duration_s=table["selection_s"] - table["start_s"],
    )
    return pd.concat([trials, tables.as_table("trials", tabled)])


def _values(rows: pd.DataFrame, measure: str, column: str, source: str) -> pd.DataFrame:
    """Rows of one measure: participant, condition, session, factors, measure, value, and where it stands."""
    return pd.DataFrame(
        {
            "participant": rows["participant"],
            "condition": rows["condition"],
            "session": rows["session"],
            "factors": None,
            "measure": measure,
            "value": rows[column].astype("float64"),
            "source": source,
        }
    ).astype({"factors": "object"})


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


def _completion_values(work: Work) -> pd.DataFrame:
    """From session_start to the last selection, a row a session that has both."""
    rows = []
    events = tables.read("events", work.entries["ingest"])
    sessions = {session.id: session for session in work.sessions}
    for session_id, happened in events.groupby("session"):
        starts = happened.loc[happened["type"] == "session_start", "time_ns"]
        selections = happened.loc[happened["type"] == "selection", "time_ns"]
        if len(starts) and len(selections):
            session = sessions[str(session_id)]
            seconds = float(selections.max() - starts.min()) * tables.NANOSECONDS
            rows.append((session.participant, session.condition, session.id, seconds))
    found = pd.DataFrame(rows, columns=[*CELL, "session", "seconds"])
    return _values(found, "completion_time_s", "seconds", "the events")


def _tabled_values(work: Work) -> Iterator[pd.DataFrame]:
    """Ratings and further dependent variables from the study's tables."""
    conditions = work.study.conditions
    questionnaires, measures = _path(work, "questionnaires"), _path(work, "measures")
    if questionnaires is not None:
        ratings = study_tables.read_questionnaires(questionnaires, conditions)
        ratings["session"] = ratings.get("session")
        names = ratings["questionnaire"] + "/" + ratings["scale"]
        yield _values(ratings, "", "rating", str(work.study.questionnaires)).assign(measure=names)
    if measures is not None:
        table, factors = study_tables.read_measures(measures, conditions)
        rows = _values(table.assign(session=None), "", "value", str(work.study.measures)).assign(
            measure=table["measure"]
        )
        if factors:
            told = [json.dumps(dict(zip(factors, row, strict=True))) for row in table[factors].to_numpy()]
            rows["factors"] = told
        yield rows


def _matches(excluded: Exclusion, rows: pd.DataFrame) -> pd.Series:
    """Which rows a decision to exclude takes out."""
    hit = pd.Series(True, index=rows.index)
    for column in ("participant", "condition", "session", "measure"):
        wanted = getattr(excluded, column)
        if wanted is not None and column in rows:
            hit &= (rows[column] == wanted).fillna(False)
    return hit.astype(bool)


def _without_excluded(study: Study, values: pd.DataFrame, trials: pd.DataFrame, exclusions: list[Row]) -> pd.DataFrame:
    """The values that stay; an exclusion that fits nothing in the data is an error, for it is likely misspelt."""
    values = values.reset_index(drop=True)
    for excluded in study.exclusions:
        for column in ("participant", "session", "measure"):
            wanted, known = getattr(excluded, column), set(values[column].dropna())
            if column in ("participant", "session"):
                known |= set(trials[column].dropna())
            if wanted is not None and wanted not in known:
                hint = did_you_mean(wanted, sorted(known))
                raise PipelineError(f'study.yaml: exclusions: there is no {column} "{wanted}" in the data{hint}')
        values = values[~_matches(excluded, values)]
        exclusions.append(
            {
                "participant": excluded.participant,
                "condition": excluded.condition,
                "session": excluded.session,
                "measure": excluded.measure,
                "what": "excluded in study.yaml",
                "reason": excluded.reason,
            }
        )
    return values


def _trials_without_excluded(study: Study, trials: pd.DataFrame) -> pd.DataFrame:
    """Trials stay in their table unless whole participants, cells or sessions were excluded."""
    trials = trials.reset_index(drop=True)
    for excluded in study.exclusions:
        if excluded.measure is None:
            trials = trials[~_matches(excluded, trials)]
    return trials


def _unselected(trials: pd.DataFrame) -> list[Row]:
    """Trials without a measurable selection, counted by session or cell."""
    recorded = trials[trials["estimator"] == "recorded"]
    missing = recorded[recorded["squared_error_mm2"].isna()]
    rows = []
    cell: Any
    for cell, found in missing.groupby([*CELL, "session"], dropna=False, sort=True):
        participant, condition, session = cell
        named = ", ".join(str(trial) for trial in found["trial"][:10]) + (", …" if len(found) > 10 else "")
        rows.append(
            {
                "participant": participant,
                "condition": condition,
                "session": None if pd.isna(session) else session,
                "measure": "selection_mse_mm2",
                "what": "trials without a measurable selection",
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


def _cells(values: pd.DataFrame) -> pd.DataFrame:
    """A participant's mean in each condition and further factor: one row a cell and measure."""
    keys = [*CELL, "factors", "measure"]
    means: Any = values.groupby(keys, dropna=False, sort=False)["value"].mean().reset_index()
    return pd.DataFrame(means)


def _totals(cells: pd.DataFrame) -> pd.DataFrame:
    """`<questionnaire>/total`: a participant's sum over the scales; none where a scale is missing."""
    parts = [str(measure).partition("/") for measure in cells["measure"]]
    told = cells.assign(questionnaire=[part[0] for part in parts], scale=[part[2] for part in parts])
    ratings = told[told["scale"] != ""]
    rows = []
    for questionnaire, answered in ratings.groupby("questionnaire", sort=False):
        scales = set(answered["scale"])
        if "total" in scales:
            continue
        for (participant, condition, factors), cell in answered.groupby([*CELL, "factors"], dropna=False, sort=False):
            if set(cell["scale"]) == scales and len(scales) > 1:
                rows.append((participant, condition, factors, f"{questionnaire}/total", cell["value"].sum()))
    return pd.DataFrame(rows, columns=[*CELL, "factors", "measure", "value"])


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
            rows.append(
                {
                    "participant": participant,
                    "what": "not in participants",
                    "reason": f"kept; check its spelling{hint}",
                }
            )
        listed |= set(named)
    excluded = {e.participant for e in work.study.exclusions if e.participant and not (e.measure or e.session)}
    seen = set(zip(measures["participant"], measures["condition"], strict=True))
    seen |= {(session.participant, session.condition) for session in work.sessions}
    for participant in sorted(listed):
        absent = [condition for condition in work.study.conditions if (participant, condition) not in seen]
        if participant not in excluded:
            for condition in absent:
                rows.append(
                    {
                        "participant": participant,
                        "condition": condition,
                        "what": "no data",
                        "reason": "the participant has nothing in this condition",
                    }
                )
    rows += _missing_cells(work.study, measures, seen, excluded)
    return rows


def _missing_cells(study: Study, measures: pd.DataFrame, seen: set[Any], excluded: set[Any]) -> list[Row]:
    rows = []
    for measure, values in measures.groupby("measure", sort=True):
        have = set(zip(values["participant"], values["condition"], strict=True))
        for participant, condition in sorted(seen - have):
            if participant not in excluded:
                rows.append(
                    {
                        "participant": participant,
                        "condition": condition,
                        "measure": measure,
                        "what": "missing cell",
                        "reason": "others have this measure",
                    }
                )
    return rows
