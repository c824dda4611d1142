"""Whether a table is wide, and which of its columns hold values: measures, scales, conditions, trials."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pipeline.study.guessing.headers import meaning
from pipeline.study.scoring_rules import RULES, is_weight, weighed_item

_NUMBER = re.compile(r"[-+−]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")
_NO_VALUE = ("", "NA", "N/A", "NaN", "nan", "-", "n/a", "k. A.", "k.A.")
_OF_PEOPLE = ("age", "sex", "participant", "condition", "session", "trial", "period", "sequence", "practice")
_SHARE_OF_NUMBERS = 0.8
_ITEMS_MIN = 4

Entry = dict[str, object]
"""An entry of `wide` in study.yaml."""


def numeric_columns(header: Sequence[str], cells: Sequence[Sequence[str]], decimal: str) -> list[str]:
    """The columns that hold numbers, in their order."""
    return [name for place, name in enumerate(header) if _are_numbers([row[place] for row in cells], decimal)]


def _are_numbers(cells: Sequence[str], decimal: str) -> bool:
    given = [cell for cell in cells if cell not in _NO_VALUE]
    other = "," if decimal == "." else "."
    numbers = sum(_NUMBER.fullmatch(cell) is not None and other not in cell for cell in given)
    return bool(given) and numbers >= _SHARE_OF_NUMBERS * len(given)


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
    what_word = "measure" if table == "measures" else "scale"
    for mark in ("_", " ", "-", ".", ":", "/"):
        for pattern in (f"{{condition}}{mark}{{{what_word}}}", f"{{{what_word}}}{mark}{{condition}}"):
            if _fits(pattern, values, conditions):
                return {"columns": pattern, **({} if table == "measures" else {"questionnaire": "nasa_tlx"})}
    return None


def _fits(pattern: str, values: Sequence[str], conditions: Sequence[str]) -> bool:
    """Does every condition stand in a column of the pattern, with the same words beside each?"""
    named = "|".join(re.escape(condition) for condition in conditions)
    expression = "".join(
        f"(?P<condition>{named})"
        if piece == "{condition}"
        else "(?P<what>.+)"
        if piece.startswith("{")
        else re.escape(piece)
        for piece in re.split(r"(\{\w+\})", pattern)
    )
    found = [match for match in (re.fullmatch(expression, value) for value in values) if match]
    words = {
        condition: {match["what"] for match in found if match["condition"] == condition} for condition in conditions
    }
    return bool(found) and all(one and one == words[conditions[0]] for one in words.values())
