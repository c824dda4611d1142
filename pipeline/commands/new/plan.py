"""What a new study would compare, by which tests, and by which factors: a first proposal for a person to change."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.analysis.practice_trials import MARKS
from pipeline.commands.new.found import Found
from pipeline.study.guessing.codes import missing_codes, number_of
from pipeline.study.guessing.headers import meaning
from pipeline.study.guessing.kind import TableGuess
from pipeline.study.scoring_rules import RULES, is_weight

_LEVELS_MAX = 8
_NUMBERED_LEVELS_MAX = 4


@dataclass(frozen=True)
class Comparison:
    """An entry of `comparisons`, and why it is proposed."""

    entry: Mapping[str, object]
    remark: str


@dataclass(frozen=True)
class Plan:
    """What study.yaml says beside the tables and logs themselves."""

    between: bool
    missing: tuple[float | str, ...]
    practice: str | None
    factors: Mapping[str, str]
    scoring: Mapping[str, Mapping[str, object]]
    comparisons: tuple[Comparison, ...]


def plan(found: Found, conditions: Sequence[str]) -> Plan:
    """The proposal for what was found."""
    between = _one_condition_each(found)
    tables = found.tables
    factors = dict(_factors(tables["measures"])) if "measures" in tables else {}
    scoring = dict(_scoring(tables["questionnaires"])) if "questionnaires" in tables else {}
    practice = next((name for table in tables.values() for name in _practice(table)), None)
    factors.pop(practice or "", None)
    comparisons = list(_comparisons(found, scoring, factors, _Tests.of(len(conditions), between)))
    return Plan(
        between,
        tuple(dict.fromkeys(code for table in tables.values() for code in _missing(table))),
        practice,
        factors,
        scoring,
        tuple(comparisons) if len(conditions) > 1 else (),
    )


def _one_condition_each(found: Found) -> bool:
    """Does nobody meet two conditions?"""
    met: dict[str, set[str]] = {}
    for table in found.tables.values():
        if "condition" in table.header:
            for person, condition in zip(table.column("participant"), table.column("condition"), strict=True):
                met.setdefault(person, set()).add(condition)
        elif table.conditions:
            met.setdefault("of a table with a column each", set()).update(table.conditions)
    if found.names is not None and found.names.participants and found.names.every_condition:
        for person, condition in zip(found.names.participants, found.names.every_condition, strict=True):
            met.setdefault(person, set()).add(condition)
    people_of = Counter(condition for own in met.values() for condition in own)
    return len(people_of) > 1 and min(people_of.values()) > 1 and max(map(len, met.values())) == 1


@dataclass(frozen=True)
class _Tests:
    """The tests that suit the design: of figures, of ratings, and of single answers of 0 or 1."""

    figures: str
    ratings: str
    answers: str

    @staticmethod
    def of(conditions: int, between: bool) -> _Tests:
        if between:
            return _Tests("t_welch" if conditions == 2 else "anova_welch", "mann_whitney", "gee_logit")
        figures = "t_paired" if conditions == 2 else "rm_anova"
        return _Tests(figures, "wilcoxon", "mcnemar" if conditions == 2 else "cochran_q")


def _comparisons(
    found: Found, scoring: Mapping[str, Mapping[str, object]], factors: Mapping[str, str], tests: _Tests
) -> Iterator[Comparison]:
    trials, events = found.tables.get("trials"), found.streams.event_types if found.streams is not None else frozenset()
    if trials is not None or {"trial_start", "selection"} <= events:
        yield Comparison(
            {"measure": "selection_mse_mm2", "test": tests.figures}, "how far selections are off their targets"
        )
    if (trials is not None and _has_times(trials)) or {"trial_start", "selection"} <= events:
        yield Comparison({"measure": "trial_time_s", "test": tests.figures}, "from a trial's start to its selection")
    if {"session_start", "selection"} <= events:
        yield Comparison(
            {"measure": "completion_time_s", "test": tests.figures}, "from the session's start to its last selection"
        )
    if "measures" in found.tables:
        yield from _of_measures(found.tables["measures"], factors, tests)
    if "questionnaires" in found.tables:
        yield from _of_questionnaires(found.tables["questionnaires"], scoring, tests)


def _has_times(trials: TableGuess) -> bool:
    bases = {name.rpartition("_")[0] for name in trials.header}
    return {"start", "selection"} <= bases


def _of_measures(table: TableGuess, factors: Mapping[str, str], tests: _Tests) -> Iterator[Comparison]:
    for measure, cells in _values(table).items():
        numbers = {number for cell in cells if (number := number_of(cell, table.written.decimal)) is not None}
        if numbers and numbers <= {0.0, 1.0}:
            once = len(cells) == len({(table.column("participant")[at]) for at in range(len(table.written.cells))})
            test = tests.answers if once or ("condition" in table.header and _once_each(table)) else "gee_logit"
            yield Comparison({"measure": measure, "test": test}, "answers of 0 or 1")
        else:
            yield _of_figures(measure, factors, tests)


def _of_figures(measure: str, factors: Mapping[str, str], tests: _Tests) -> Comparison:
    """The test of a measure's means, by the further factors too."""
    within = [name for name, kind in factors.items() if kind == "within"][:2]
    groups = [name for name, kind in factors.items() if kind == "between" and name != "condition"]
    further: dict[str, object] = {"within": ["condition", *within]} if within else {}
    if tests.figures in ("t_welch", "anova_welch") or not (within or groups):
        return Comparison({"measure": measure, "test": tests.figures}, "participants' means")
    if groups:
        entry = {"measure": measure, "test": "mixed_anova", "between": groups[0], **further}
        return Comparison(entry, "conditions within participants, groups between them")
    return Comparison({"measure": measure, "test": "rm_anova", **further}, "conditions by a further factor")


def _values(table: TableGuess) -> dict[str, list[str]]:
    """The cells of each measure of a table, long or wide."""
    if not table.wide:
        by_measure: dict[str, list[str]] = {}
        for measure, cell in zip(table.column("measure"), table.column("value"), strict=True):
            by_measure.setdefault(measure, []).append(cell)
        return by_measure
    entry = table.wide[0]
    if "measure" in entry and isinstance(entry["measure"], list):
        return {name: table.column(name) for name in table.values}
    if "measure" in entry:
        return {str(entry["measure"]): [cell for name in table.values for cell in table.column(name)]}
    return _of_pattern(table, str(entry["columns"]))


def _of_pattern(table: TableGuess, pattern: str) -> dict[str, list[str]]:
    from pipeline.study.table_settings import headers_of_pattern

    expression = headers_of_pattern(pattern, table.conditions, ())
    by_measure: dict[str, list[str]] = {}
    for name in table.values:
        match = expression.fullmatch(name)
        if match:
            by_measure.setdefault(match["measure"], []).extend(table.column(name))
    return by_measure


def _once_each(table: TableGuess) -> bool:
    """Has each participant one row in each condition?"""
    cells = list(zip(table.column("participant"), table.column("condition"), strict=True))
    return len(set(cells)) == len(cells)


# Questionnaires -----------------------------------------------------------------------------------------------------


def _items(table: TableGuess) -> dict[str, dict[str, list[str]]]:
    """The cells of each item, by questionnaire."""
    items: dict[str, dict[str, list[str]]] = {}
    if table.wide:
        for entry in table.wide:
            for name in table.values:
                items.setdefault(str(entry["questionnaire"]), {})[name] = table.column(name)
        return items
    rows = zip(table.column("questionnaire"), table.column("scale"), table.column("rating"), strict=True)
    for questionnaire, scale, rating in rows:
        items.setdefault(questionnaire, {}).setdefault(scale, []).append(rating)
    return items


def _scoring(table: TableGuess) -> Iterator[tuple[str, dict[str, object]]]:
    """The rule of each questionnaire whose sheet has to be told: a NASA-TLX, by the range that its answers have."""
    for questionnaire, cells in _items(table).items():
        tlx = RULES["raw_tlx"]
        rated = {tlx.item(name): values for name, values in cells.items() if not is_weight(name)}
        if questionnaire == "nasa_tlx" and set(tlx.items) <= set(rated):
            numbers = [number_of(cell, table.written.decimal) for values in rated.values() for cell in values]
            rule = "weighted_tlx" if any(is_weight(name) for name in cells) else "raw_tlx"
            yield questionnaire, {"rule": rule, "range": _range([one for one in numbers if one is not None])}


def _range(numbers: Sequence[float]) -> list[int]:
    """The range of a NASA-TLX sheet: the smallest one in use that holds all answers."""
    low, high = min(numbers, default=0), max(numbers, default=100)
    for bounds in ([1, 7], [1, 10], [0, 10], [0, 20], [1, 21]):
        if bounds[0] <= low and high <= bounds[1]:
            return bounds
    return [0, 100]


def _of_questionnaires(
    table: TableGuess, scoring: Mapping[str, Mapping[str, object]], tests: _Tests
) -> Iterator[Comparison]:
    for questionnaire, cells in _items(table).items():
        rule = RULES.get(str(scoring.get(questionnaire, {}).get("rule", questionnaire)))
        scales = [name for name in cells if not is_weight(name)]
        scored = rule is not None and {rule.item(name) for name in scales} >= set(rule.items)
        if rule is not None and scored:
            first = f"{questionnaire}/{rule.scales[0].name}"
            named: object = (
                first
                if len(rule.scales) == 1 or rule.weighted
                else [f"{questionnaire}/{one.name}" for one in rule.scales]
            )
            adjusted: dict[str, object] = {} if isinstance(named, str) else {"adjust": "holm"}
            yield Comparison({"measure": named, "test": tests.figures, **adjusted}, f"scored by {rule.label}")
        if not scored or questionnaire == "nasa_tlx":
            listed = [f"{questionnaire}/{name}" for name in scales]
            entry = {"measure": listed, "test": tests.ratings, "adjust": "holm"}
            yield Comparison(entry, "scale by scale, adjusted for their number")


# Columns ------------------------------------------------------------------------------------------------------------


def _factors(table: TableGuess) -> Iterator[tuple[str, str]]:
    """Further columns of measures that tell groups of participants, or cells of everybody, apart."""
    people = table.column("participant")
    for name in table.further:
        levels: dict[str, set[str]] = {}
        for person, level in zip(people, table.column(name), strict=True):
            levels.setdefault(person, set()).add(level)
        every = set().union(*levels.values())
        numbered = all(number_of(level, table.written.decimal) is not None for level in every)
        if "" in every or not 1 < len(every) <= (_NUMBERED_LEVELS_MAX if numbered else _LEVELS_MAX):
            continue
        if all(len(own) == 1 for own in levels.values()):
            if min(sum(level in own for own in levels.values()) for level in every) > 1:
                yield name, "between"
        elif sum(own == every for own in levels.values()) > len(levels) / 2:
            yield name, "within"


def _practice(table: TableGuess) -> Iterator[str]:
    """A column that marks some trials as practice."""
    for name in table.header:
        if meaning(name) == "practice" and table.kind in ("trials", "measures"):
            marked = [cell.casefold() in MARKS for cell in table.column(name)]
            if any(marked) and not all(marked):
                yield name


def _missing(table: TableGuess) -> Iterator[float | str]:
    """Words and numbers that stand for a missing value in the table's columns of values."""
    yield from table.missing
    long = {"measures": "value", "questionnaires": "rating"}.get(table.kind)
    groups = (
        _values(table).values()
        if table.kind == "measures"
        else [table.column(n) for n in table.values or ([long] if long else [])]
    )
    for cells in groups:
        numbers = [number for cell in cells if (number := number_of(cell, table.written.decimal)) is not None]
        yield from (int(code) for code in missing_codes(np.array(numbers)))
