"""Practice trials: which ones `practice` in study.yaml means, and the tables without them.

They are left out before anything is computed, and so of every figure; the exclusions list them. A trial is known by its
participant, condition, session and number, and, as logs may use a number again, by how often it came before.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import pandas as pd

from pipeline.analysis.values import CELL
from pipeline.errors import PipelineError
from pipeline.study.settings import Study
from pipeline.study.table_settings import Practice
from pipeline.tables.table import Row

MARKS = frozenset(
    (
        *("1", "true", "yes", "y", "x", "practice", "practise", "training"),
        *("ja", "wahr", "übung", "uebung", "oui", "vrai", "si", "sí", "verdadero"),
    )
)
"""What a cell says of a practice trial, where study.yaml does not list it under `marks`."""
_NO_MARKS = frozenset(
    (
        *("", "0", "false", "no", "n", "-", "main", "test", "real", "experiment"),
        *("nein", "falsch", "non", "faux", "falso"),
    )
)
_NAMED_MAX = 10
_KEY = (*CELL, "session", "trial")
_Session = tuple[str, str, str]
_Key = tuple[str, str, str, object, int]


@dataclass(frozen=True)
class Tables:
    """Trials, their selections and movements, and the study's measures with their further factors, if there are any."""

    trials: pd.DataFrame
    selections: pd.DataFrame
    movements: pd.DataFrame
    measures: tuple[pd.DataFrame, list[str]] | None


def without_practice(study: Study, tables: Tables) -> tuple[Tables, list[Row]]:
    """The tables without practice trials, and a row of `exclusions` for each session that had some.

    Raises PipelineError where nothing says which trials are meant.
    """
    if study.practice is None:
        return tables, []
    _require_trials(study.practice, tables)
    keys = _of_sessions(study.practice, tables)
    kept = replace(
        tables,
        trials=tables.trials[~_are(tables.trials, keys)],
        selections=tables.selections[~_are(tables.selections, keys)],
        movements=tables.movements[~_are(tables.movements, keys)],
    )
    rows = _listed((((key[0], key[1], key[2]), key[3]) for key in keys), "practice trials")
    if tables.measures is not None:
        table, factors = tables.measures
        practised = _in_measures(study.practice, table)
        kept = replace(kept, measures=(table[~practised], [name for name in factors if name != study.practice.column]))
        left = table[practised].to_dict("records")
        of_measures = [((row["participant"], row["condition"], ""), row.get("trial", "")) for row in left]
        rows += _listed(of_measures, "practice trials in the measures")
    return kept, rows


def _require_trials(practice: Practice, tables: Tables) -> None:
    """Raise PipelineError where no table has the column, or none has trials."""
    measures = tables.measures[0] if tables.measures is not None else pd.DataFrame()
    if practice.column is not None and practice.column not in tables.trials and practice.column not in measures:
        raise PipelineError(
            f'study.yaml: practice: neither the trials nor the measures have a column "{practice.column}"; in logs'
            " practice trials are counted: practice: {trials: 2}"
        )
    if practice.trials is not None and tables.movements.empty and "trial" not in measures:
        raise PipelineError(
            "study.yaml: practice: there are no trials to leave out: no log has any, there is no table of trials, and"
            ' the measures have no column "trial"'
        )


def _of_sessions(practice: Practice, tables: Tables) -> set[_Key]:
    """The keys of the practice trials of all sessions."""
    if practice.trials is not None:
        moved = tables.movements
        return _keys(moved, (moved["order"] <= practice.trials).fillna(False).astype(bool))
    if practice.column not in tables.trials:
        return set()
    return _keys(tables.trials, _marked(practice, tables.trials[practice.column]))


def _marked(practice: Practice, cells: pd.Series) -> pd.Series:
    """Which cells of the column mark a practice trial. Raises PipelineError for one that says neither yes nor no."""
    if practice.marks:
        return cells.isin(practice.marks)
    plain = cells.str.casefold()
    for line, cell in cells[~plain.isin(MARKS | _NO_MARKS)].items():
        raise PipelineError(
            f'study.yaml: practice: row {line} has "{cell}" in the column {practice.column}, which says neither yes nor'
            f' no; write which values mark practice: practice: {{column: {practice.column}, marks: ["{cell}"]}}'
        )
    return plain.isin(MARKS)


def _in_measures(practice: Practice, table: pd.DataFrame) -> pd.Series:
    """Which rows of the measures are of practice trials: those marked, or of a participant's first ones."""
    if practice.column is not None:
        if practice.column not in table:
            return pd.Series(False, index=table.index)
        return _marked(practice, table[practice.column])
    if "trial" not in table:
        return pd.Series(False, index=table.index)
    numbers = pd.to_numeric(table["trial"], errors="coerce")
    place = numbers.groupby([table[name] for name in CELL]).rank(method="dense")
    return (place <= practice.trials).fillna(False)


def _keys(rows: pd.DataFrame, chosen: pd.Series) -> set[_Key]:
    return {key for key, one in zip(_all_keys(rows), chosen, strict=True) if one}


def _are(rows: pd.DataFrame, keys: set[_Key]) -> pd.Series:
    return pd.Series([key in keys for key in _all_keys(rows)], index=rows.index, dtype=bool)


def _all_keys(rows: pd.DataFrame) -> Iterable[_Key]:
    """Each row's trial: participant, condition, session ("" for none), number, and how often it came before."""
    parts = [*_KEY, *(["estimator"] if "estimator" in rows else [])]
    again = rows.groupby(parts, dropna=False).cumcount()
    named = (rows[name].astype("object").where(rows[name].notna(), "") for name in _KEY)
    return zip(*named, again, strict=True)


def _listed(trials: Iterable[tuple[_Session, object]], what: str) -> list[Row]:
    """One row of `exclusions` per session, or cell of a table, with its trials."""
    by_session: dict[_Session, list[str]] = {}
    for cell, trial in sorted(trials, key=lambda one: (one[0], len(str(one[1])), str(one[1]))):
        by_session.setdefault(cell, []).append(str(trial))
    rows: list[Row] = []
    for (participant, condition, session), of_session in by_session.items():
        numbers = list(dict.fromkeys(of_session))
        named = ", ".join(numbers[:_NAMED_MAX]) + (", …" if len(numbers) > _NAMED_MAX else "")
        rows.append(
            {
                "participant": participant,
                "condition": condition,
                "session": session or None,
                "what": what,
                "reason": f"left out, as study.yaml says under practice: {named}" if named else "left out",
            }
        )
    return rows
