"""In which order people met the conditions: from the logs, the measures or the participants table."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

import pandas as pd

from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.fields import identifier
from pipeline.study.session import Session
from pipeline.tables import table as tables
from pipeline.tables.table import Row

LOGS, MEASURES, PARTICIPANTS = "the logs", "the measures", "the participants table"
SOURCES = (LOGS, MEASURES, PARTICIPANTS)
"""From what was run to what was planned: where two sources say it, the first of them counts."""

_BETWEEN = r"[\s,;|/>→+–_-]*"
_LONGEST = 7  # digits from which on a number is no session's number but, say, a date
_PERIOD = re.compile(r"period_([1-9]\d{0,3})")


def conditions_in_order(text: str, conditions: Sequence[str]) -> list[str] | None:
    """The conditions a text lists (`fusion > kinect`), or its letters where each condition has its own (`FK`).

    None for a mere label (`group 1`), and where it names a single condition, or one of them twice.
    """
    names = "|".join(re.escape(name) for name in sorted(conditions, key=len, reverse=True))
    letters = {name[0].casefold(): name for name in conditions}
    plain = re.sub(_BETWEEN, "", text).casefold()
    listed: list[str] = []
    if re.fullmatch(f"(?:(?:{names}){_BETWEEN})+", text):
        listed = re.findall(names, text)
    elif len(letters) == len(conditions) and all(letter in letters for letter in plain):
        listed = [letters[letter] for letter in plain]
    return listed if len(listed) > 1 and len(set(listed)) == len(listed) else None


def gathered(
    conditions: Sequence[str],
    sessions: Iterable[Session],
    session_orders: pd.DataFrame,
    measures: pd.DataFrame | None,
    participants: pd.DataFrame | None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The tables `orders` and `sequences`: each participant's conditions by period, from every source that says it.

    A period counts from 1; a sequence is the label that the study gives to an order.
    """
    rows = [*_of_logs(conditions, sessions, session_orders), *_of_measures(measures)]
    labels: dict[str, str] = {}
    for table, source in ((participants, PARTICIPANTS), (measures, MEASURES)):
        if table is None:
            continue
        periods = source == MEASURES and "period" in table
        if source == PARTICIPANTS and any(_PERIOD.fullmatch(str(name)) for name in table):
            rows += _of_periods(conditions, table)
            periods = True
        if "sequence" in table:
            own_labels = _labels(table, source)
            labels = {**own_labels, **labels}
            rows += [] if periods else _of_labels(conditions, own_labels, source)
    sequences = [{"participant": participant, "sequence": label} for participant, label in labels.items()]
    return tables.frame("orders", rows).drop_duplicates(), tables.frame("sequences", sequences)


def _of_periods(conditions: Sequence[str], participants: pd.DataFrame) -> Iterator[Row]:
    """Columns period_1, period_2, … of the participants table, each naming a condition."""
    for name in participants:
        column = _PERIOD.fullmatch(str(name))
        if column is None:
            continue
        for line, participant, condition in zip(
            participants.index, participants["participant"], participants[name], strict=True
        ):
            if condition and condition not in conditions:
                hint = did_you_mean(condition, conditions)
                raise PipelineError(
                    f'the participants table, row {line}: "{name}": condition "{condition}" is not in study.yaml{hint}'
                )
            if condition:
                period = int(column.group(1))
                yield {"participant": participant, "condition": condition, "period": period, "source": PARTICIPANTS}


def _labels(table: pd.DataFrame, source: str) -> dict[str, str]:
    """The sequence of each participant who has one; PipelineError for two."""
    labelled = table[table["sequence"] != ""][["participant", "sequence"]].drop_duplicates()
    for participant, rows in labelled.groupby("participant", sort=True):
        if len(rows) > 1:
            two = " and ".join(f'"{label}"' for label in rows["sequence"].iloc[:2])
            raise PipelineError(
                f'{source}: participant "{participant}" has the sequences {two}; give each participant one'
            )
    return dict(zip(labelled["participant"], labelled["sequence"], strict=True))


def _of_labels(conditions: Sequence[str], labels: Mapping[str, str], source: str) -> Iterator[Row]:
    """The orders of labels that list the conditions; other labels are mere names."""
    for participant, label in labels.items():
        for period, condition in enumerate(conditions_in_order(label, conditions) or [], 1):
            yield {"participant": participant, "condition": condition, "period": period, "source": source}


def _of_logs(conditions: Sequence[str], sessions: Iterable[Session], session_orders: pd.DataFrame) -> list[Row]:
    """A log's fact `order`: the session's number in the participant's order, or the whole order by name."""
    order_facts = dict(zip(session_orders["session"], session_orders["order"], strict=True))
    rows: list[Row] = []
    for session in sessions:
        text = str(identifier(str(order_facts.get(session.id, "")).strip()))
        whole = conditions_in_order(text, conditions) or []
        period = int(text) if text.isdecimal() and len(text) < _LONGEST else 0
        if session.condition in whole:
            period = whole.index(session.condition) + 1
        if period:
            rows.append({**session.ids, "period": period, "source": LOGS})
    return rows


def _of_measures(measures: pd.DataFrame | None) -> list[Row]:
    if measures is None or "period" not in measures:
        return []
    with_period = measures[measures["period"].notna()][["participant", "condition", "period"]].drop_duplicates()
    names = ("participant", "condition", "period", "source")
    return [dict(zip(names, (*row, MEASURES), strict=True)) for row in with_period.itertuples(index=False)]


def run_orders(orders: pd.DataFrame) -> pd.DataFrame:
    """Each participant's rows from the source that comes first in SOURCES."""
    if orders.empty:
        return orders
    ranked = orders.assign(rank=orders["source"].map({source: at for at, source in enumerate(SOURCES)}).astype(int))
    kept: pd.DataFrame = ranked[ranked["rank"] == ranked.groupby("participant")["rank"].transform("min")]
    return kept.drop(columns="rank")


def with_periods(values: pd.DataFrame, orders: pd.DataFrame, sequences: pd.DataFrame) -> pd.DataFrame:
    """Values with their period (their own, their session's, or that of their condition) and their sequence."""
    labels = dict(zip(sequences["participant"], sequences["sequence"], strict=True))
    run = run_orders(orders)
    if len(run):
        values = values.assign(period=_periods(values, run))
        labels = {**orders_as_text(run), **labels}
    return values.assign(sequence=values["participant"].map(labels).astype("string"))


def _periods(values: pd.DataFrame, run: pd.DataFrame) -> pd.Series:
    by_session = run.dropna(subset="session").drop_duplicates("session").set_index("session")["period"]
    once = run.drop_duplicates(["participant", "condition", "period"])
    once = once[~once.duplicated(["participant", "condition"], keep=False)]
    by_cell = once.set_index(["participant", "condition"])["period"]
    cells = pd.MultiIndex.from_frame(values[["participant", "condition"]])
    period = values["period"].astype("Int64")
    period = period.fillna(values["session"].map(by_session).astype("Int64"))
    return period.fillna(pd.Series(by_cell.reindex(cells).to_numpy(), index=values.index).astype("Int64"))


def orders_as_text(run: pd.DataFrame) -> dict[str, str]:
    """Each participant's conditions in the order they were met, as text: `kinect, fusion`."""
    ordered = run.sort_values("period", kind="stable").drop_duplicates(["participant", "condition", "period"])
    return {
        str(participant): ", ".join(rows["condition"])
        for participant, rows in ordered.groupby("participant", sort=False)
    }
