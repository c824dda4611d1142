"""Values that are missing or left out, and why: excluded in study.yaml, incomplete, not finite, or absent."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np
import pandas as pd

from pipeline.analysis.factors import BETWEEN_FACTORS, factors_of, folded, missing_cells
from pipeline.analysis.groups import one_condition_each
from pipeline.analysis.values import CELL, given_table
from pipeline.engine.stage import Work
from pipeline.errors import PipelineError, did_you_mean
from pipeline.study import given_tables
from pipeline.study.settings import Exclusion, Study
from pipeline.tables.table import Row


def matches(excluded: Exclusion, rows: pd.DataFrame) -> pd.Series:
    """Which rows an exclusion of study.yaml removes: one flag per row.

    One of a trial removes none of rows that are of no single trial, such as means.
    """
    matching = pd.Series(excluded.trial is None or "trial" in rows, index=rows.index)
    for column in ("participant", "condition", "session", "trial", "measure"):
        wanted = getattr(excluded, column)
        if wanted is not None and column in rows:
            matching &= (rows[column] == wanted).fillna(False)
    return matching.astype(bool)


def excludable(work: Work, values: pd.DataFrame, trials: pd.DataFrame) -> pd.DataFrame:
    """Every combination of ids that an exclusion may name: what is in the data, totals, and sessions set aside."""
    session_ids = [session.ids for session in (*work.sessions, *(aside for aside, _ in work.set_aside))]
    columns = [*CELL, "session", "trial", "measure"]
    totals = values[values["measure"].str.contains("/")].copy()
    totals["measure"] = totals["measure"].str.partition("/")[0] + "/total" if len(totals) else totals["measure"]
    sessions = pd.DataFrame(session_ids, columns=columns).astype("object")
    return pd.concat(
        [
            values[columns].astype("object"),
            totals[columns].astype("object"),
            sessions,
            trials.reindex(columns=columns).astype("object"),
        ]
    )


def check_exclusion(excluded: Exclusion, known: pd.DataFrame) -> None:
    """PipelineError for an exclusion that matches nothing in the data: it is likely misspelt."""
    for column in ("participant", "session", "trial", "measure"):
        wanted, present = getattr(excluded, column), sorted(set(known[column].dropna()))
        if wanted is not None and wanted not in present:
            hint = did_you_mean(str(wanted), map(str, present))
            raise PipelineError(f'study.yaml: exclusions: there is no {column} "{wanted}" in the data{hint}')
    if not matches(excluded, known).any():
        raise PipelineError(
            f"study.yaml: exclusions: nothing in the data fits {excluded.named}; there is nothing to exclude"
        )


def incomplete_trials(trials: pd.DataFrame, movements: pd.DataFrame) -> list[Row]:
    """Trials without a measurable selection, a duration or a path of the hand, counted by session or cell."""
    recorded = trials[trials["estimator"] == "recorded"]
    timed = movements[movements["duration_s"].notna()]
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
        for cell, rows_of_cell in missing.groupby([*CELL, "session"], dropna=False, sort=True):
            participant, condition, session = cell
            named = ", ".join(str(trial) for trial in rows_of_cell["trial"][:10]) + (
                ", …" if len(rows_of_cell) > 10 else ""
            )
            rows.append(
                {
                    "participant": participant,
                    "condition": condition,
                    "session": None if pd.isna(session) else session,
                    "measure": measure,
                    "what": what,
                    "reason": f"{len(rows_of_cell)} of the cell's trials: {named}",
                }
            )
    return rows


def finite_values(values: pd.DataFrame, exclusions: list[Row]) -> pd.DataFrame:
    """The values that are finite; the others are added to `exclusions`."""
    bad = values[~np.isfinite(values["value"])]
    if bad.empty:
        return values
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


def gaps(work: Work, measures: pd.DataFrame) -> list[Row]:
    """Participants without a condition, and cells without a measure that others have."""
    listed = set(measures["participant"]) | {str(session.participant) for session in work.sessions}
    rows: list[Row] = []
    without: list[str] = []
    file = given_table(work, "participants")
    if file is not None:
        named = given_tables.read_participants(file)["participant"]
        for participant in sorted(listed - set(named)):
            guess = len(named) and work.pseudonyms is None  # P03 is no misspelt P02
            hint = did_you_mean(participant, sorted(named)) if guess else ""
            reason = f"kept; check its spelling{hint}"
            rows.append({"participant": participant, "what": "not in participants", "reason": reason})
        without = sorted(set(named) - listed)
        listed |= set(named)
    seen = set(zip(measures["participant"], measures["condition"], strict=True))
    seen |= {(session.participant, session.condition) for session in work.sessions}
    if one_condition_each(work.study, seen):
        reason = "the participant is listed in participants.csv and has no data"
        rows += [
            {"participant": participant, "what": "no data", "reason": reason}
            for participant in without
            if not _excluded(work.study, participant, None, None)
        ]
        return [*rows, *_look_alikes(listed, seen, ()), *_missing_cells(work.study, measures, seen)]
    for participant in sorted(listed):
        for condition in work.study.conditions:
            if (participant, condition) not in seen and not _excluded(work.study, participant, condition, None):
                cell = {"participant": participant, "condition": condition}
                rows.append({**cell, "what": "no data", "reason": "the participant has no data in this condition"})
    return [*rows, *_look_alikes(listed, seen, work.study.conditions), *_missing_cells(work.study, measures, seen)]


def _look_alikes(people: Iterable[str], seen: AbstractSet[tuple[Any, Any]], conditions: Sequence[str]) -> Iterator[Row]:
    """Ids that look alike (case, spaces, zeros) where one of them lacks a condition: likely one person."""
    alike: dict[str, list[str]] = {}
    for person in sorted(people):
        alike.setdefault(folded(person), []).append(person)
    for ids in alike.values():
        incomplete = any((person, condition) not in seen for person in ids for condition in conditions)
        if len(ids) > 1 and incomplete:
            named = " and ".join(f'"{person}"' for person in ids)
            reason = f"{named} differ only in case, spaces or zeros; if they are one person, give them one id"
            yield {"participant": ids[0], "what": "participants with similar ids", "reason": reason}


def _excluded(study: Study, participant: str, condition: str | None, measure: str | None) -> bool:
    """Is the cell empty because study.yaml excludes it?"""
    return any(
        excluded.session is None and excluded.covers(participant=participant, condition=condition, measure=measure)
        for excluded in study.exclusions
    )


def _missing_cells(study: Study, measures: pd.DataFrame, seen: set[Any]) -> list[Row]:
    """Rows for the cells, also of further factors, that others have and a participant lacks."""
    rows: list[Row] = []
    for measure, values in measures.groupby("measure", sort=True):
        have = set(zip(values["participant"], values["condition"], strict=True))
        crossed = factors_of(values).crossed
        partial = missing_cells(values, study.conditions, crossed) if crossed else {}
        for participant, condition in sorted(seen):
            if _excluded(study, participant, condition, str(measure)):
                continue
            row: Row = {"participant": participant, "condition": condition, "measure": measure, "what": "missing cell"}
            of_condition = f"{condition}{BETWEEN_FACTORS}"
            cells = [cell for cell in partial.get(participant, ()) if cell.startswith(of_condition)]
            if (participant, condition) not in have:
                rows.append({**row, "reason": "others have this measure"})
            elif cells:
                named = ", ".join(cell.removeprefix(of_condition) for cell in cells)
                rows.append({**row, "reason": f"others have this measure at {named}"})
    return rows
