"""The values of every dependent variable, one row each: from logs, and from the study's own tables."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.engine.stage import Work
from pipeline.errors import PipelineError
from pipeline.sessions import movements
from pipeline.sessions.target_widths import widths_mm
from pipeline.sessions.trials import moved, selections_by_trial
from pipeline.statistics.arrays import FloatArray
from pipeline.study import given_tables
from pipeline.study.settings import Study
from pipeline.study.table_file import TableFile, table_file
from pipeline.tables import table as tables
from pipeline.tables.columns import S_PER_NS
from pipeline.tables.table import Row

CELL = ["participant", "condition"]

_FIGURES = ("duration_s", "amplitude_mm", "width_mm", "moved_mm", "along_mm")
"""Of a movement from one trial of a table to the next."""
_OF_A_MOVEMENT = (
    *("trial", "start_s", "selection_s", "target_width_mm"),
    *(f"{what}_{axis}_mm" for what in ("target", "selected") for axis in "xyz"),
)
"""What a trial of a table says of it."""


def given_table(work: Work, table: str) -> TableFile | None:
    """A table that study.yaml names, such as `participants`; None where it names none."""
    return table_file(work.study, work.folder, table, work.pseudonyms)


def typed_trials(work: Work) -> pd.DataFrame | None:
    """The rows of trials.csv; None where study.yaml names none."""
    file = given_table(work, "trials")
    return None if file is None else given_tables.read_trials(file)


def all_trials(work: Work, table: pd.DataFrame | None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The trials of all sessions as recorded and as each estimator would have shown, or `table`, those of trials.csv.

    Beside them their selections. Those of trials.csv have further columns: `factors`, and those of the study's own.
    """
    trials = tables.read("trials", work.entries["assess"])
    if table is None:
        return trials, tables.read("selections", work.entries["assess"])
    if len(trials):
        raise PipelineError(
            f"{Path(str(work.study.trials)).name}: the logs hold trials too, and would be mixed with these; take"
            " `trials:` or `events:` out of study.yaml"
        )
    squared = np.zeros(len(table))
    for axis in "xyz":
        # A trial counts over the axes its target has; a selection that lacks one of them cannot be measured.
        has_axis = table[f"target_{axis}_mm"].notna() if axis == "z" else pd.Series(True, index=table.index)
        difference = (table[f"selected_{axis}_mm"] - table[f"target_{axis}_mm"]) ** 2
        squared = squared + difference.where(has_axis, 0.0).to_numpy()
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
    own = table[given_tables.own_columns_of_trials(table)].assign(factors=factors_of_rows(work.study, table))
    return pd.concat([tables.as_table("trials", tabled), own], axis=1), tables.as_table("selections", selected)


def factors_of_rows(study: Study, table: pd.DataFrame) -> pd.Series:
    """The levels of the factors that are columns of a table, as JSON text; None for a row without any."""
    names = [name for name in study.factors if name in table and name not in CELL]
    if not names:
        return pd.Series(None, index=table.index, dtype="object")
    levels = [{k: v for k, v in zip(names, row, strict=True) if v} for row in table[names].to_numpy()]
    return pd.Series([json.dumps(facts) if facts else None for facts in levels], index=table.index, dtype="object")


def all_movements(work: Work, table: pd.DataFrame | None) -> pd.DataFrame:
    """The movements of all sessions, or of `table`, the trials of trials.csv, in the order of their starts."""
    if table is None:
        return tables.read("movements", work.entries["assess"])
    by_start = np.argsort(table["start_s"].to_numpy(np.float64), kind="stable")
    cell = table.groupby([*CELL, "session"], sort=True).ngroup().to_numpy()[by_start]
    order = by_start[np.argsort(cell, kind="stable")]
    # Cell by cell into whole columns, from arrays: a frame of a few trials takes forty times as long.
    given = {name: table[name].to_numpy(np.float64) for name in _OF_A_MOVEMENT}
    figures = {name: np.empty(len(table)) for name in _FIGURES}
    places = np.empty(len(table), np.int64)
    edges = [0, *np.cumsum(np.bincount(cell)).tolist()]
    for begin, end in pairwise(edges):
        own = {name: column[order[begin:end]] for name, column in given.items()}
        places[begin:end] = _places(own)
        for name, column in _movement_figures(work.study, own).items():
            figures[name][begin:end] = column
    who = table[[*CELL, "session", "trial"]].iloc[order]
    from_trials = who.assign(session=who["session"].replace("", None), order=places, **figures)
    factors = factors_of_rows(work.study, table).iloc[order]
    return tables.as_table("movements", from_trials).assign(factors=factors)


def _movement_figures(study: Study, trials: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The figures of the movements of one session of trials.csv.

    A trial ends with its selection, which is the only one that a table has.
    """
    left = {f"left_{axis}_mm": trials[f"selected_{axis}_mm"] for axis in "xyz"}
    target = np.column_stack([trials[f"target_{axis}_mm"] for axis in "xyz"])
    stated, known = trials["target_width_mm"], widths_mm(study.task, target)
    figures = moved({**trials, **left, "left_s": trials["selection_s"]})
    return {**figures, "width_mm": np.where(np.isnan(stated), known, stated)}


def _places(trials: Mapping[str, FloatArray]) -> np.ndarray:
    """The place of each trial in its session.

    Trials whose starts do not tell their order, as where each has a clock of its own, go by their numbers.
    """
    starts = trials["start_s"]
    told = not np.isnan(starts).any() and len(np.unique(starts)) == len(starts)
    places = np.empty(len(starts), np.int64)
    places[np.argsort(starts if told else trials["trial"], kind="stable")] = np.arange(1, len(starts) + 1)
    return places


def _values(rows: pd.DataFrame, measure: str, column: str, source: str) -> pd.DataFrame:
    """Rows of one measure: participant, condition, session, trial, factors, period, measure, value, and source."""
    none = pd.Series(pd.NA, index=rows.index, dtype="Int64")
    return pd.DataFrame(
        {
            "participant": rows["participant"],
            "condition": rows["condition"],
            "session": rows["session"],
            "trial": rows["trial"].astype("Int64") if "trial" in rows else none,
            "factors": rows["factors"].astype("object") if "factors" in rows else _of_all(None, rows),
            "period": none,
            "measure": _of_all(measure, rows),
            "value": rows[column].astype("float64"),
            "source": _of_all(source, rows),
        }
    )


def no_values() -> pd.DataFrame:
    """What a study has that measured nothing."""
    return _values(tables.frame("trials", ()), "", "squared_error_mm2", "").assign(target=None)


def _of_all(text: str | None, rows: pd.DataFrame) -> np.ndarray:
    """A text for every row, of which there is one in memory."""
    return np.full(len(rows), text, dtype=object)


def selection_values(study: Study, trials: pd.DataFrame, selections: pd.DataFrame) -> list[pd.DataFrame]:
    """Squared selection errors (mm², px²) and durations (s), one row per trial, with the trial's `target` by its place.

    Each by itself.

    A place in mm is what two trials have in common if they are of one target; None where the target is not known.
    """
    if trials.empty:
        return []
    recorded = _chosen(trials, trials["estimator"] == "recorded")
    recorded = recorded.assign(target=_targets(recorded, selections))
    selected = _chosen(recorded, recorded["squared_error_mm2"].notna())
    timed = _chosen(recorded, recorded["duration_s"].notna())
    parts = [
        _values(selected, "selection_mse_mm2", "squared_error_mm2", "the trials"),
        _values(timed, "trial_time_s", "duration_s", "the trials"),
    ]
    if study.display is not None and study.display.unit == "px":
        in_px = parts[0].assign(measure="selection_mse_px2")
        parts.append(in_px.assign(value=in_px["value"] * study.display.px_per_mm**2))
    return [part.assign(target=recorded["target"].reindex(part.index)) for part in parts]


def _chosen(rows: pd.DataFrame, which: pd.Series) -> pd.DataFrame:
    """Some rows; no copy of a large table of which all are."""
    return rows if which.all() else rows[which]


def _targets(trials: pd.DataFrame, selections: pd.DataFrame) -> pd.Series:
    """`(550, 500)`, the place in mm of each trial's target, with the index of the trials."""
    key, places = [*CELL, "session", "trial"], [f"target_{axis}_mm" for axis in "xyz"]
    label = _labels(selections[places].to_numpy(np.float64))
    of_one_table = selections.index.equals(trials.index) and selections[key].equals(trials[key])
    if of_one_table and (label != "()").all() and not trials.duplicated(key).any():
        return pd.Series(label, index=trials.index)
    known = selections[key].assign(target=label)
    known = known[known["target"] != "()"].drop_duplicates(key)
    joined = trials[key].merge(known, on=key, how="left")
    return pd.Series(joined["target"].to_numpy(object), index=trials.index).where(lambda place: place.notna(), None)


def _labels(places: FloatArray) -> np.ndarray:
    """The texts (n,) of places (n, d) in mm, of which the same ones are one object."""
    number = np.zeros(len(places), np.int64)
    for column in places.T:
        codes, values = pd.factorize(column, use_na_sentinel=False)
        number = pd.factorize(number * len(values) + codes)[0]
    _, first = np.unique(number, return_index=True)
    texts = ["(" + ", ".join(f"{value:.6g}" for value in place if not np.isnan(value)) + ")" for place in places[first]]
    labels: np.ndarray = np.array(texts, dtype=object)[number]
    return labels


def movement_values(moved: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Throughput (bits/s), one row per sequence of a session, and measures of the hand's path, one row per trial."""
    if moved.empty:
        return
    figures = ("amplitude_mm", "moved_mm", "along_mm", "duration_s", "width_mm")
    cell = [*CELL, "session", *(["factors"] if "factors" in moved else [])]
    rows = [
        (*key, throughput)
        for key, trials in moved.groupby(cell, dropna=False, sort=True)
        for throughput in movements.throughputs(*(trials[name].to_numpy(np.float64) for name in figures))
    ]
    sequences = pd.DataFrame(rows, columns=[*cell, "throughput"])
    yield _values(sequences, "throughput_bits_s", "throughput", "the trials")
    covered = moved["path_length_mm"].where(moved["path_length_mm"] > 0)
    for_measures = moved.assign(efficiency=moved["shortest_mm"] / covered)
    for measure, column in (
        ("path_efficiency", "efficiency"),
        ("overshoot_mm", "overshoot_mm"),
        ("corrections", "corrections"),
    ):
        yield _values(for_measures[for_measures[column].notna()], measure, column, "the trials")


def completion_values(work: Work, exclusions: list[Row]) -> list[pd.DataFrame]:
    """Seconds from session_start to the last selection, one row per session with both; `exclusions` lists the rest.

    Where a session's first trials are practice, from the start of the first trial after them.
    """
    rows = []
    practised = 0 if work.study.practice is None else work.study.practice.trials or 0
    for session, folder in sorted(zip(work.sessions, work.entries["ingest"], strict=True), key=lambda pair: pair[0].id):
        events = tables.read_arrow("events", folder).to_pylist()
        who: Row = session.ids
        begins, selections = (
            [event["time_ns"] for event in events if event["type"] == kind] for kind in ("session_start", "selection")
        )
        starts, placed = selections_by_trial(events)
        if practised:
            begins = [event["time_ns"] for event in starts[practised:]]
        stray = sum(place < 0 for _, place in placed)
        if stray:
            reason = f"{stray} without the trial_start of their trial"
            exclusions.append({**who, "what": "selections outside any trial", "reason": reason})
        if begins and selections:
            seconds = float(max(selections) - min(begins)) * S_PER_NS
            if seconds < 0:
                reason = "the last selection comes before session_start"
                exclusions.append({**who, "measure": "completion_time_s", "what": "impossible time", "reason": reason})
            else:
                rows.append((session.participant, session.condition, session.id, seconds))
    durations = pd.DataFrame(rows, columns=[*CELL, "session", "seconds"])
    return [_values(durations, "completion_time_s", "seconds", "the events")] if rows else []


def rated_values(work: Work) -> Iterator[pd.DataFrame]:
    """Ratings from questionnaires."""
    file = given_table(work, "questionnaires")
    if file is not None:
        ratings = given_tables.read_questionnaires(file)
        ratings["session"] = ratings.get("session")
        ratings["factors"] = factors_of_rows(work.study, ratings)
        names = ratings["questionnaire"] + "/" + ratings["scale"]
        yield _values(ratings, "", "rating", str(work.study.questionnaires)).assign(measure=names)


def measures_table(work: Work) -> tuple[pd.DataFrame, list[str]] | None:
    """The table of measures and its further factors, if the study has one."""
    file = given_table(work, "measures")
    return None if file is None else given_tables.read_measures(file)


def tabled_values(work: Work, tabled: tuple[pd.DataFrame, list[str]] | None) -> Iterator[pd.DataFrame]:
    """Further dependent variables from the study's table of measures."""
    if tabled is None:
        return
    table, factors = tabled
    numbered = pd.to_numeric(table["trial"], errors="coerce") if "trial" in table else pd.Series(np.nan, table.index)
    trial = numbered.where(numbered == numbered.round())
    own = table[["participant", "condition", "value"]].assign(session=None, trial=trial)
    rows = _values(own, "", "value", str(work.study.measures)).assign(measure=table["measure"])
    if "period" in table:
        rows["period"] = table["period"]
    if factors:
        levels = [{k: v for k, v in zip(factors, row, strict=True) if v} for row in table[factors].to_numpy()]
        rows["factors"] = [json.dumps(facts) if facts else None for facts in levels]
    yield rows
