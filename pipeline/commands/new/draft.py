"""The text of a new study.yaml: every line with a comment that says what it does, or how it was guessed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pipeline.commands.new.found import Found
from pipeline.commands.new.plan import Plan
from pipeline.study.guessing.kind import TableGuess
from pipeline.study.guessing.written import Form
from pipeline.study.yaml_text import flow

_COMMENT_AT = 60  # the column of comments, where the line is not longer


@dataclass(frozen=True)
class Line:
    """A line of study.yaml, and the comment beside it."""

    text: str
    comment: str


def written(lines: Sequence[Line]) -> str:
    """The lines as text, comments in one column as far as the lines allow."""
    return "".join(f"{line.text:<{_COMMENT_AT}}  # {line.comment}\n" for line in lines)


def draft(title: str, conditions: Sequence[str], found: Found, plan: Plan, extra: Mapping[str, object]) -> list[Line]:
    """study.yaml for what was found. `extra` are further keys, such as display, with what they are for as a comment."""
    lines = [
        Line(f"title: {flow(title)}", "stands above the report"),
        Line("data_origin: recorded", "recorded, simulated or reconstructed: shown on the first page"),
        Line(f"conditions: {flow(list(conditions))}", "what is compared; the first is the baseline of all differences"),
        *_logs(found),
        *(
            Line(f"{key}: {flow(value)}", "how many pixels one millimetre of the display is")
            for key, value in extra.items()
        ),
        *_tables(found.tables),
        *_columns(found.tables),
        *_formats(found.tables),
        *_wide(found.tables),
    ]
    if plan.missing:
        lines.append(Line(f"missing: {flow(list(plan.missing))}", "cells that stand for a missing value"))
    if plan.practice is not None:
        lines.append(
            Line(f"practice: {flow({'column': plan.practice})}", "trials that this column marks count nowhere")
        )
    lines += [*_factors(plan), *_scoring(plan), *_comparisons(plan)]
    return lines


def _logs(found: Found) -> Iterator[Line]:
    if found.names is None or found.streams is None:
        return
    yield Line(f"sessions: {flow(found.names.pattern)}", f"{len(found.logs)} logs; a placeholder stands for any text")
    if found.streams.streams:
        yield Line("streams:", f"the logs' sensors, by {found.streams.looked_at} of them; `steadyhand fit` says more")
    for name, stream in found.streams.streams.items():
        yield Line(f"  {name}: {flow(dict(stream))}", found.streams.remarks[name])
    if found.streams.events is not None:
        yield Line(f"events: {flow({'topic': found.streams.events})}", "trials and selections")
    yield from _estimators(found.streams.streams)


def _estimators(streams: Mapping[str, Mapping[str, object]]) -> Iterator[Line]:
    """Estimators of the tracker, and of it and the phone; of the first ones, where there are several."""
    of_kind = {
        kind: [name for name, stream in streams.items() if stream["kind"] == kind]
        for kind in ("position", "acceleration")
    }
    first = [names[0] for names in of_kind.values() if names]
    several = any(len(names) > 1 for names in of_kind.values())

    def line(name: str, kind: str, use: list[str], about: str) -> Line:
        chosen: dict[str, object] = {"use": use} if several else {}
        return Line(f"  {name}: {flow({'type': kind, **chosen})}", about)

    if of_kind["position"]:
        yield Line("estimators:", "what each would have shown is computed; rename them as you like")
        yield line("raw", "raw", first[:1], "the newest reading of the tracker, held")
        yield line("kalman", "position_kalman", first[:1], "a Kalman filter of the tracker alone")
    if all(of_kind.values()):
        about = "tracker and phone, by the noise and latency stated above"
        yield line("kalman_fusion", "fusion_kalman", first, about)
        yield line("adaptive", "fusion_adaptive", first, "the same, which finds noise, clock and mounting itself")


_HOLDS = {
    "participants": "who took part",
    "trials": "targets and selections",
    "questionnaires": "ratings",
    "measures": "further dependent variables",
}


def _tables(tables: Mapping[str, TableGuess]) -> Iterator[Line]:
    for kind, table in tables.items():
        people = len(set(table.column("participant")))
        rows = len(table.written.cells)
        yield Line(f"{kind}: {flow(table.written.name)}", f"{_HOLDS[kind]}: {rows} rows of {people} participants")


def _columns(tables: Mapping[str, TableGuess]) -> Iterator[Line]:
    renamed = {kind: dict(table.columns) for kind, table in tables.items() if table.columns}
    if renamed:
        yield Line("columns:", "your headers, and the column that each means")
    for kind, columns in renamed.items():
        yield Line(f"  {kind}:", f"of {tables[kind].written.name}")
        for header, column in columns.items():
            yield Line(f"    {flow(header)}: {flow(column)}", _about(column))


_ABOUT = {
    "participant": "who",
    "condition": "under which condition",
    "trial": "the trial's number",
    "session": "which session",
    "period": "in which place the condition came, from 1",
    "start": "when the trial began",
    "selection": "when its target was selected",
    "target_width": "the target's diameter",
}
_UNIT_NAMES = {"mm": "mm", "cm": "cm", "m": "metres", "px": "pixels", "s": "seconds", "ms": "milliseconds"}


def _about(column: str) -> str:
    """What a column holds, and in which unit."""
    base, _, unit = column.rpartition("_")
    if unit not in _UNIT_NAMES:
        return _ABOUT.get(column, "the name that is used below")
    what = _ABOUT.get(base) or {"target": "where the target was", "selected": "where the selection was"}.get(
        base.partition("_")[0], "measured"
    )
    return f"{what}, in {_UNIT_NAMES[unit]}"


def _formats(tables: Mapping[str, TableGuess]) -> Iterator[Line]:
    forms: dict[str, Form] = {kind: dict(table.written.form) for kind, table in tables.items()}
    if not any(forms.values()):
        return
    first = next(iter(forms.values()))
    if all(form == first for form in forms.values()):
        yield Line(f"format: {flow(first)}", "how the tables are written")
        return
    yield Line("format:", "how the tables are written")
    for kind, form in forms.items():
        if form:
            yield Line(f"  {kind}: {flow(form)}", f"of {tables[kind].written.name}")


def _wide(tables: Mapping[str, TableGuess]) -> Iterator[Line]:
    wide = {kind: table.wide for kind, table in tables.items() if table.wide}
    if wide:
        yield Line("wide:", "tables with several values in a row: which columns hold them, and what they are")
    for kind, entries in wide.items():
        for entry in entries:
            yield Line(f"  {kind}: {flow(entry)}", f"{len(tables[kind].values)} columns")


def _factors(plan: Plan) -> Iterator[Line]:
    factors = {**({"condition": "between"} if plan.between else {}), **plan.factors}
    if factors:
        yield Line("factors:", "columns that tell people or cells apart")
    for name, kind in factors.items():
        said = {
            "condition": "each participant met one condition",
            "between": "groups of participants; levels in order: {between: [a, b]}",
            "within": "everybody meets each level; levels in order: [a, b, c]",
        }
        yield Line(f"  {flow(name)}: {kind}", said["condition"] if name == "condition" else said[kind])


def _scoring(plan: Plan) -> Iterator[Line]:
    if plan.scoring:
        yield Line("scoring:", "how questionnaires are scored")
    for questionnaire, rule in plan.scoring.items():
        yield Line(f"  {flow(questionnaire)}: {flow(rule)}", "range: the lowest and the highest answer of your sheet")


def _comparisons(plan: Plan) -> Iterator[Line]:
    if plan.comparisons:
        yield Line("comparisons:", "what is tested; studies/README.md lists the tests and their options")
    for comparison in plan.comparisons:
        yield Line(f"  - {flow(dict(comparison.entry))}", comparison.remark)
