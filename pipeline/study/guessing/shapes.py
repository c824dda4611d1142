"""Whether a table is wide, and which of its columns hold values: measures, scales, conditions, trials."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pipeline.study.guessing.codes import number_of
from pipeline.study.guessing.headers import meaning
from pipeline.study.scoring_rules import RULES, is_weight, weighed_item

NO_VALUE = ("", "NA", "N/A", "NaN", "nan", "-", "n/a", "k. A.", "k.A.")
_OF_PEOPLE = ("age", "sex", "participant", "condition", "session", "trial", "period", "sequence", "practice")
_SHARE_OF_NUMBERS = 0.8
_NUMBERED = re.compile(r"(?P<stem>.*\D)\d+")
_NUMBERED_MIN = 3
_ITEM_WORDS = ("q", "item", "question", "frage", "f", "pregunta", "i")
_SUS_MAX = 5
_MEASURE_WORD = re.compile(
    "time|zeit|temps|tiempo|rt|mt|duration|dauer|error|fehler|erreur|score|rating|count|anzahl|number|accuracy|speed|"
    "throughput|value|wert|tlx|sus|mse|rmse|hits|clicks",
    re.IGNORECASE,
)
_ITEMS_MIN = 4

Entry = dict[str, object]
"""An entry of `wide` in study.yaml."""


def numeric_columns(header: Sequence[str], cells: Sequence[Sequence[str]], decimal: str) -> list[str]:
    """The columns that hold numbers, in their order."""
    return [name for place, name in enumerate(header) if _are_numbers([row[place] for row in cells], decimal)]


def _are_numbers(cells: Sequence[str], decimal: str) -> bool:
    given = [cell for cell in cells if cell not in NO_VALUE]
    numbers = sum(number_of(cell, decimal) is not None for cell in given)
    return bool(given) and numbers >= _SHARE_OF_NUMBERS * len(given)


_TLX_WORDS = {
    "mental": "mental|geistig|cognit",
    "physical": "phys|körper|koerper|korper|físic|fisic",
    "temporal": "tempor|zeit",
    "performance": "perform|leistung|rendim|réussite|reussite",
    "effort": "effort|anstreng|aufwand|esfuerz",
    "frustration": "frustr",
}


def tlx_names(names: Sequence[str]) -> dict[str, str]:
    """Headers of the six scales of a NASA-TLX in other words, each with its name; empty if not all are there."""
    found: dict[str, str] = {}
    for scale, words in _TLX_WORDS.items():
        fits = [name for name in names if re.search(words, name, re.IGNORECASE) and not is_weight(name)]
        if len(fits) != 1:
            return {}
        found[fits[0]] = scale
    return found if len(found) == len(_TLX_WORDS) else {}


def questionnaire_of(names: Sequence[str]) -> tuple[str, list[str]] | None:
    """The questionnaire of which columns are the items, by its name in our records, and these columns, weights too."""
    tlx = RULES["raw_tlx"]
    scales = [name for name in names if not is_weight(name) and tlx.item(name) and not name.strip("qQ").isdigit()]
    if len(scales) >= _ITEMS_MIN:
        weights = [name for name in names if is_weight(name) and tlx.item(weighed_item(name))]
        return "nasa_tlx", [*scales, *weights]
    for rule in RULES.values():
        items = [name for name in names if rule.name in name.casefold() and rule.item(name)]
        if len(items) == len(rule.items):
            return rule.name, items
    return None


@dataclass(frozen=True)
class Numbered:
    """What columns that differ in a number alone are: the kind of their table, and the entry of `wide` for them."""

    kind: str
    entry: Entry


def numbered_entry(names: Sequence[str], cells: Sequence[Sequence[str]]) -> Numbered | None:
    """The entry for columns such as q1, q2, … or rt_1, rt_2, …: items of a questionnaire, or trials, else None."""
    matches = [_NUMBERED.fullmatch(name) for name in names]
    stems = {match["stem"] for match in matches if match is not None}
    if len(names) < _NUMBERED_MIN or None in matches or len(stems) != 1:
        return None
    stem = stems.pop()
    if stem.strip("_ ").casefold() not in _ITEM_WORDS:
        return Numbered("measures", {"columns": f"{stem}{{trial}}", "measure": stem.strip("_ -.")})
    answers = [value for column in cells for cell in column if (value := number_of(cell, ".")) is not None]
    known = {(10, True): "sus", (26, False): "ueq"}
    name = known.get((len(names), max(answers, default=0) <= _SUS_MAX), "questionnaire")
    return Numbered("questionnaires", {"questionnaire": name, "scale": list(names)})


def wide_entry(
    table: str, header: Sequence[str], cells: Sequence[Sequence[str]], conditions: Sequence[str], decimal: str = "."
) -> Entry | None:
    """The entry of `wide` for a table of measures or questionnaires; None for one that is not wide."""
    long = {"measures": ("measure", "value"), "questionnaires": ("scale", "rating")}.get(table)
    if long is None or set(long) <= set(header):
        return None
    values = [
        name
        for name in (numeric_columns(header, cells, decimal) if cells else header)
        if name not in _OF_PEOPLE and meaning(name) not in _OF_PEOPLE
    ]
    if not values:
        return None
    if "condition" not in header:
        return _by_condition(table, values, conditions)
    items = questionnaire_of(values)
    if table == "questionnaires":
        name, columns = items or ("name_of_the_questionnaire", values)
        return {"questionnaire": name, "scale": columns}
    return {"measure": values}


def _by_condition(table: str, values: Sequence[str], conditions: Sequence[str]) -> Entry | None:
    """The entry for a table with one column a condition, or a column for each condition and measure."""
    if all(condition in values for condition in conditions):
        what: Entry = {"measure": "time_s"} if table == "measures" else {"questionnaire": "sus", "scale": "score"}
        return {"condition": list(conditions), **what}
    crossed = crossed_headers(values, conditions)
    return None if crossed is None else crossed.entry


@dataclass(frozen=True)
class Crossed:
    """Columns of which each is a condition and something else, the conditions, and the entry of `wide` for them."""

    headers: tuple[str, ...]
    conditions: tuple[str, ...]
    entry: Entry


def crossed_headers(values: Sequence[str], conditions: Sequence[str]) -> Crossed | None:
    """Columns such as time_kinect, time_fusion: each word before a mark with each one after it. None where none are.

    The conditions are those that are known, or else what stands on the side that does not look like measures.
    """
    for mark in ("_", " ", "-", ".", ":", "/"):
        for cut in (str.rpartition, str.partition):
            pairs = {name: (cut(name, mark)[0], cut(name, mark)[2]) for name in values if mark in name}
            found = _crossed(pairs, mark, conditions)
            if found is not None:
                return found
    return None


def _crossed(pairs: Mapping[str, tuple[str, str]], mark: str, conditions: Sequence[str]) -> Crossed | None:
    sides = tuple(tuple(dict.fromkeys(pair[side] for pair in pairs.values())) for side in (0, 1))
    if len(pairs) < 2 or len(pairs) != len(sides[0]) * len(sides[1]) or not all((*sides[0], *sides[1])):
        return None
    if conditions:
        side = next((side for side in (1, 0) if set(sides[side]) == set(conditions)), None)
    else:
        side = _side_of_conditions(sides)
    if side is None:
        return None
    others = sides[1 - side]
    what = "{measure}" if len(others) > 1 else others[0]
    pattern = f"{what}{mark}{{condition}}" if side else f"{{condition}}{mark}{what}"
    entry: Entry = {"columns": pattern, **({} if len(others) > 1 else {"measure": others[0]})}
    return Crossed(tuple(pairs), sides[side], entry)


def _side_of_conditions(sides: tuple[tuple[str, ...], ...]) -> int | None:
    """Which side of the headers names the conditions: the one with several words and no word of a measure."""
    measured = [any(_MEASURE_WORD.search(word) for word in side) for side in sides]
    several = [len(side) > 1 for side in sides]
    numbered = [all(word.isdigit() for word in side) for side in sides]
    fits = [several[side] and not measured[side] and not numbered[side] for side in (0, 1)]
    return 1 if fits == [False, True] else 0 if fits == [True, False] else None
