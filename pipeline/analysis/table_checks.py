"""Are the values of a study's own tables what they are taken for? Amber with the reason; nothing is left out for it.

Each check looks for a value that its own column makes unlikely: the others of the same measure are the yardstick, so
that a slow task or a coarse scale is no alarm.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np
import pandas as pd

from pipeline.analysis.answer_ranges import remedy, shifted_range
from pipeline.sessions.checks.finding import Finding, Status, of, rows_of
from pipeline.statistics.arrays import FloatArray
from pipeline.study.guessing.codes import missing_codes
from pipeline.study.measures import measure
from pipeline.study.scoring_rules import RULES, ScoringRule, is_weight
from pipeline.study.scoring_settings import ScoringEntry
from pipeline.study.yaml_text import flow
from pipeline.tables.table import Row
from pipeline.words.phrases import counted, listing

UNIT, MISSING_CODE, SCALE, ITEMS, TARGETS, ORDER = (
    "unit of time",
    "code for missing",
    "range of the scale",
    "items of the questionnaire",
    "unit of the targets",
    "order of the conditions",
)

_LONG_S, _LONG_TRIAL_S = 10_000.0, 200.0  # median of a session's time, and of a single trial's or movement's
_OF_A_TRIAL = ("trial", "movement", "reaction", "response", "selection")
_IN_MS = ("start_ms", "selection_ms")
_SINCE_1970 = {1e9: "seconds", 1e12: "milliseconds", 1e15: "microseconds", 1e18: "nanoseconds"}
_OTHERS_MIN = 3
_TLX = (0.0, 100.0)  # however it was asked
_CENTRED = (-3.0, 3.0)  # answers of the UEQ that are coded around zero, and its scores
_SCORE = {"percent": (0.0, 100.0), "centred": _CENTRED}
_ROUNDED = 0.01  # of a step between two scores that were written with two decimals
_UNITS_APART = 50.0
_FARTHEST_MM = 20_000.0
_FAR_FROM_TARGET_MM, _UNDONE = 50.0, 0.2  # the middle distance, and how much of it a mistake leaves once undone
_SAME_NS = 60e9  # logs of one minute were not recorded one after the other
_NAMED_MAX = 3
_ITEMS_MIN = 2


def check_rows(
    values: pd.DataFrame,
    selections: pd.DataFrame | None,
    scoring: Mapping[str, ScoringEntry] = MappingProxyType({}),
    times: tuple[str, str] | None = None,
) -> list[Row]:
    """Rows of the table `checks`.

    `values` are those of tables, one a row: `participant`, `measure`, `value` and the `source` they stand in.
    `selections` have the targets and selections of trials.csv; None where there is none. `scoring` is study.yaml's.
    `times` are the headers of start and selection in trials.csv, if there is one.
    """
    findings: list[Finding] = []
    moved = dict(moved_ranges(values, scoring))
    findings += moved.values()
    findings += missing_items(values, scoring)
    for (name, source), rows in values[np.isfinite(values["value"])].groupby(["measure", "source"], sort=False):
        value = rows["value"].to_numpy(np.float64)
        findings += unit_of_time(str(name), str(source), value, times)
        findings += missing_code(str(name), str(source), value, rows["participant"])
        if str(name).partition("/")[0] not in moved:
            findings += rated_range(str(name), str(source), value, scoring)
    if selections is not None:
        findings += targets(selections)
    return rows_of(findings)


def unit_of_time(name: str, source: str, value: FloatArray, times: tuple[str, str] | None = None) -> Iterator[Finding]:
    """Seconds that are milliseconds, and times of day where a duration is expected.

    `times` are the headers of the columns that a trial's time is computed from.
    """
    middle = float(np.median(np.abs(value)))
    check = of(UNIT, name)
    for unit, what in _SINCE_1970.items():
        if np.all((value > unit) & (value < 3 * unit)) and np.all(value == np.round(value)):
            message = (
                f'"{name}" in {source} is near {value[0]:.3g} throughout: these are instants, in {what} since 1970, '
                "not durations; give the time from start to end"
            )
            yield Finding(check, "amber", f"{value[0]:.3g}", "a duration", message)
            return
    if measure(name).unit != "s":
        return
    limit = _LONG_TRIAL_S if any(word in name for word in _OF_A_TRIAL) else _LONG_S
    found, expected = f"median {middle:.4g} s", f"at most {limit:g} s"
    if middle <= limit:
        yield Finding(check, "green", found, expected)
        return
    keys = ""
    if times is not None and name == "trial_time_s":
        keys = f", or write columns: {{trials: {flow(dict(zip(times, _IN_MS, strict=True)))}}} in study.yaml"
    message = (
        f'"{name}" in {source} has a median of {middle:.4g} s: the values are probably milliseconds; divide them by '
        f"1000{keys}"
    )
    yield Finding(check, "amber", found, expected, message)


def missing_code(name: str, source: str, value: FloatArray, participants: pd.Series) -> Iterator[Finding]:
    """−99, 999 and their like, where all other values of the measure are far from them."""
    codes = missing_codes(value)
    check = of(MISSING_CODE, name)
    if not codes:
        yield Finding(check, "green", "none", "none")
        return
    rows = np.isin(value, codes)
    people = list(dict.fromkeys(participants[rows].astype(str)))
    who = listing(people[:_NAMED_MAX]) + (", …" if len(people) > _NAMED_MAX else "")
    named = listing([f"{code:g}" for code in codes])
    key = f"missing: [{', '.join(f'{code:g}' for code in codes)}]"
    rest = value[~rows]
    message = (
        f'"{name}" in {source} is {named} in {int(rows.sum())} rows ({who}) and {rest.min():.3g} to {rest.max():.3g}'
        f" in all others: {named} probably stands for a missing value, and counts as a number; write {key}"
        " in study.yaml, or leave the cell empty"
    )
    yield Finding(check, "amber", f"{named} in {int(rows.sum())} rows", "none", message)


def _by_questionnaire(values: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """The rows of each questionnaire: of what stands before the slash in a measure's name."""
    names = {name: str(name).partition("/")[0] for name in values["measure"].unique() if "/" in name}
    for questionnaire, rows in values.groupby(values["measure"].map(names), sort=False) if names else ():
        yield str(questionnaire), rows


def _scale(name: str) -> str:
    return name.partition("/")[2]


def moved_ranges(values: pd.DataFrame, scoring: Mapping[str, ScoringEntry]) -> Iterator[tuple[str, Finding]]:
    """Questionnaires whose answers seem to run on another range than their rule takes: one finding for all items."""
    for questionnaire, rows in _by_questionnaire(values):
        entry = scoring.get(questionnaire)
        rule = RULES.get(entry.rule if entry is not None else questionnaire)
        if rule is None or rule.limits is None or (entry is not None and entry.range is not None):
            continue
        scales = [_scale(name) for name in rows["measure"]]
        answers = rows[[rule.item(scale) is not None and not is_weight(scale) for scale in scales]]
        moved = shifted_range(answers, rule.limits)
        if moved is not None:
            sources = listing(list(dict.fromkeys(answers["source"].astype(str))))
            message = f'"{questionnaire}" in {sources}: {remedy(questionnaire, rule, rule.limits, moved)}'
            low, high = answers["value"].min(), answers["value"].max()
            expected = f"{rule.limits[0]:g} to {rule.limits[1]:g}"
            check = of(SCALE, questionnaire)
            yield questionnaire, Finding(check, "amber", f"{low:g} to {high:g}", expected, message)


def missing_items(values: pd.DataFrame, scoring: Mapping[str, ScoringEntry]) -> Iterator[Finding]:
    """Known instruments of which the data have some items and not all: without a word they would not be scored."""
    for name, rows in _by_questionnaire(values):
        rule = RULES.get(name)
        if name in scoring or rule is None or rule.limits is None:
            continue
        there = {item for measured in rows["measure"].unique() if (item := rule.item(_scale(measured))) is not None}
        missing = [item for item in rule.items if item not in there]
        if len(there) < _ITEMS_MIN or not missing:
            continue
        named = listing(missing) if len(missing) <= _NAMED_MAX else f"{', '.join(missing[:_NAMED_MAX])}, …"
        (low, high), sources = rule.limits, listing(list(rows["source"].astype(str).unique()))
        message = (
            f'"{name}" in {sources} has {len(there)} of {len(rule.items)} items'
            f" ({named} missing), so no score is made of them and nothing is turned; give all items, or state a rule of"
            f" your own: scoring: {{{name}: {{rule: mean, range: [{low:g}, {high:g}], reversed: [the items to turn]}}}}"
        )
        yield Finding(of(ITEMS, name), "amber", f"{len(there)} items", f"{len(rule.items)} items", message)


def rated_range(name: str, source: str, value: FloatArray, scoring: Mapping[str, ScoringEntry]) -> Iterator[Finding]:
    """Answers and scores that their instrument cannot have, whether or not a score is made of them."""
    limits = rated_limits(name, value, scoring)
    if limits is None:
        return
    low, high = limits
    outside = (value < low) | (value > high)
    message = ""
    if outside.any():
        are = "is" if outside.sum() == 1 else "are"
        message = (
            f'{counted(int(outside.sum()), "rating")} of "{name}" in {source} {are} outside {low:g} to {high:g}, such'
            f" as {value[outside][0]:g}: correct them, or leave the cell empty; if the sheet runs otherwise, "
            "state its range under scoring: in study.yaml"
        )
    status: Status = "amber" if outside.any() else "green"
    yield Finding(of(SCALE, name), status, f"{value.min():g} to {value.max():g}", f"{low:g} to {high:g}", message)


def rated_limits(name: str, value: FloatArray, scoring: Mapping[str, ScoringEntry]) -> tuple[float, float] | None:
    """The lowest and the highest value that a measure can have; None for what is no answer of a known instrument.

    A range under `scoring` counts more than the instrument's own. The UEQ is coded from 1 to 7 or from -3 to 3; values
    tell which.
    """
    questionnaire, slash, scale = name.partition("/")
    entry = scoring.get(questionnaire)
    rule = RULES.get(entry.rule if entry is not None else questionnaire)
    if not slash or is_weight(scale):
        return None
    if entry is not None and (rule is None or rule.item(scale) is not None):
        return None if rule is None and scale == "score" else entry.limits
    if questionnaire == "nasa_tlx":
        return None if scale == "total" else _TLX
    if rule is None or rule.limits is None or _is_points(rule, scale, value):
        return None
    if rule.item(scale) is not None:
        coded = rule.name.startswith("ueq") and value.min() < 0 and value.max() <= _CENTRED[1]
        return _CENTRED if coded else rule.limits
    return next((_SCORE[one.reading] for one in rule.scales if one.name == scale and one.reading in _SCORE), None)


def _is_points(rule: ScoringRule, scale: str, value: FloatArray) -> bool:
    """Are these scores of a scale that shares its name with an item, as nausea of the SSQ: points times a factor?"""
    factors = [one.factor for one in rule.scales if one.name == scale and one.reading == "points"]
    return any(bool(np.all(np.abs(value / factor - np.round(value / factor)) < _ROUNDED)) for factor in factors) and (
        bool(np.any(value != np.round(value)))
    )


def targets(selections: pd.DataFrame) -> Iterator[Finding]:
    """Targets and selections of another unit, with other axes, or beyond any room."""
    axes = [axis for axis in "xyz" if selections[f"target_{axis}_mm"].notna().any()]
    both = selections[[*(f"target_{axis}_mm" for axis in axes), *(f"{axis}_mm" for axis in axes)]].dropna()
    if len(both) < _OTHERS_MIN:
        return
    places = both.to_numpy(np.float64)
    halves = places[:, : len(axes)], places[:, len(axes) :]
    size, reached = (float(np.percentile(np.abs(half), 95)) for half in halves)
    found, expected = f"targets to {size:.3g} mm, selections to {reached:.3g} mm", "alike"
    cause = ""
    if max(size, reached) > _UNITS_APART * min(size, reached) > 0:
        larger, smaller = ("targets", "selections") if size > reached else ("selections", "targets")
        cause = f"{smaller} are probably in metres where {larger} are in millimetres; give both in millimetres"
    elif max(size, reached) > _FARTHEST_MM:
        cause = "no hand reaches so far: the unit is probably not millimetres; give millimetres"
    elif len(axes) > 1:
        cause = _of_axes(places, len(axes))
    message = (
        f"in the table of trials targets reach {size:.3g} mm and selections {reached:.3g} mm: {cause}" if cause else ""
    )
    yield Finding(TARGETS, "amber" if cause else "green", found, expected, message)


def _of_axes(both: FloatArray, axes: int) -> str:
    """What makes most selections far from their targets and can be undone: an axis or another frame; "" if nothing."""
    aimed, chosen = both[:, :2], both[:, axes : axes + 2]
    here = float(np.median(np.linalg.norm(aimed - chosen, axis=1)))
    shift = np.median(aimed - chosen, axis=0)

    def tried() -> Iterator[tuple[str, FloatArray]]:
        yield "the targets' x and y are exchanged; give them in the order of the selections", aimed[:, ::-1]
        turned_y = "the targets' y points the other way; give it in the frame of the selections"
        yield turned_y, aimed * np.array([1.0, -1.0])
        turned_x = "the targets' x points the other way; give it in the frame of the selections"
        yield turned_x, aimed * np.array([-1.0, 1.0])
        off = f"({shift[0]:.0f}, {shift[1]:.0f}) mm"
        yield f"all targets are off by {off}; give them in the frame of the selections", aimed - shift

    left = {cause: float(np.median(np.linalg.norm(points - chosen, axis=1))) for cause, points in tried()}
    likely = min(left, key=lambda one: left[one])
    return likely if here > _FAR_FROM_TARGET_MM and left[likely] < _UNDONE * here else ""


def order_rows(orders: pd.DataFrame, starts_ns: pd.DataFrame) -> list[Row]:
    """Rows of `checks`: the stated order of the conditions against when the logs began.

    `orders` has participant, condition, period and source; `starts_ns` participant, condition and start_ns.
    """
    rows = orders.merge(starts_ns, on=["participant", "condition"])
    findings = []
    for source, of_source in rows.groupby("source", sort=False):
        wrong = [
            str(person) for person, mine in of_source.groupby("participant") if len(mine) > 1 and _contradicts(mine)
        ]
        n = of_source["participant"].nunique()
        message = ""
        if wrong:
            who = listing(wrong[:_NAMED_MAX]) + (", …" if len(wrong) > _NAMED_MAX else "")
            message = (
                f"{source} state another order of the conditions than the dates of the logs for {len(wrong)} of {n} "
                f"participants ({who}): a label was exchanged or a session repeated; correct the table or the file name"
            )
        status: Status = "amber" if wrong else "green"
        findings.append(Finding(of(ORDER, str(source)), status, f"{len(wrong)} of {n}", "none", message))
    return rows_of(findings)


def _contradicts(mine: pd.DataFrame) -> bool:
    """Does a later period begin clearly before an earlier one?"""
    start = mine.sort_values("period", kind="stable")["start_ns"].to_numpy(np.float64)
    return bool(np.any(np.diff(start) < -_SAME_NS))
