"""What an exploration says: means at each tracker and estimator, differences between estimators, and what pays more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from pipeline.simulation.tracker import Tracker
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.descriptive import summarize
from pipeline.statistics.paired import t_paired
from pipeline.statistics.power import Design, difference_of_dz
from pipeline.statistics.sample_size import FEWEST, fewest
from pipeline.tables.table import Row

MEASURES = ("selection_mse_mm2", "completion_time_s")
"""What estimators are compared by, a value a person."""
POWER = 0.8
MOST = 1000
"""Participants, beyond which a difference counts as not to be shown."""
_CORRELATION = 0.5  # any: d_z alone decides a paired test
_COUNTS = ("selections", "misses", "not_selected")


_POINT = [*Tracker._fields, "estimator"]


@dataclass(frozen=True)
class Way:
    """One tracker with one estimator, and the mean there: of the error as the root of the mean square, in mm; or s."""

    tracker: Tracker
    estimator: str
    value: float

    def record(self) -> Row:
        """As an object for JSON; null where nobody selected anything."""
        value = self.value if np.isfinite(self.value) else None
        return {**self.tracker._asdict(), "estimator": self.estimator, "value": value}


@dataclass(frozen=True)
class Pays:
    """What changes a measure more from where the study is: the best other filter, or the best better tracker.

    `enough` is the least of the better trackers that does as much as that filter. `verdict` says "neither" where the
    better of the two is not clearly better than what is, and "equal" where they do not clearly differ: where the 95 %
    interval of the difference, person by person, includes zero.
    """

    measure: str
    now: Way
    by_filter: Way | None
    by_tracker: Way | None
    enough: Way | None
    verdict: Literal["filter", "tracker", "equal", "neither"] | None

    def record(self) -> Row:
        """As an object for JSON."""
        ways = {name: getattr(self, name) for name in ("now", "by_filter", "by_tracker", "enough")}
        shown = {name: way and way.record() for name, way in ways.items()}
        return {"measure": self.measure, "verdict": self.verdict, **shown}


def means(people: pd.DataFrame) -> list[Row]:
    """Rows of `explore` from `explore_people`, in its order: means with 95 % t intervals over people.

    The error is the root of the mean over people of their mean squares, never a mean of roots; so is its interval.
    """
    rows = []
    for point, sessions in people.groupby(_POINT, sort=False):
        row: Row = dict(zip(_POINT, point, strict=True)) | {"people": len(sessions), "n": 0}
        row |= {name: int(sessions[name].sum()) for name in _COUNTS}
        squares, times = (sessions[name].dropna().to_numpy(np.float64) for name in MEASURES)
        if len(times):
            row["n"] = len(times)
            row |= _with_interval("completion_time", "_s", times, lambda value: value)
            row |= _with_interval("selection_rmse", "_mm", squares, lambda value: float(np.sqrt(max(value, 0.0))))
        rows.append(row)
    return rows


def _with_interval(name: str, unit: str, values: FloatArray, shown: Callable[[float], float]) -> Row:
    found = summarize(values)
    columns = {"mean": f"{name}{unit}", "ci_low": f"{name}_low{unit}", "ci_high": f"{name}_high{unit}"}
    return {column: shown(found[key]) for key, column in columns.items() if key in found}


def differences(people: pd.DataFrame, alpha: float) -> list[Row]:
    """Rows of `explore_differences`: at each tracker the first estimator less each other one, person by person."""
    first, *others = dict.fromkeys(people["estimator"])
    rows = []
    for tracker, sessions in people.groupby(list(Tracker._fields), sort=False):
        for measure in MEASURES:
            for second in others:
                row = dict(zip(Tracker._fields, tracker, strict=True)) | {"measure": measure}
                row |= {"first": first, "second": second}
                of_first, of_second = (_values(sessions, estimator, measure) for estimator in (first, second))
                rows.append(row | _difference(of_first, of_second, alpha))
    return rows


def _difference(first: FloatArray, second: FloatArray, alpha: float) -> Row:
    """A paired t test's figures, and how many participants show such a difference, with what its interval allows."""
    complete = np.isfinite(first) & np.isfinite(second)
    first, second = first[complete], second[complete]
    row: Row = {"n": len(first)}
    if not len(first):
        return row | {"status": "nobody selected anything"}
    result = t_paired(first, second)
    row |= {"mean_difference": float(np.mean(first - second)), "status": result.status}
    row["reduction"] = 1 - float(np.mean(second) / np.mean(first)) if np.mean(first) > 0 else None
    if result.effect_size is None:
        return row
    row["ci_low"], row["ci_high"] = result.details["ci_difference"]
    row |= {"effect_size": result.effect_size, "participants_needed": _needed(result.effect_size, alpha)}
    low, high = result.ci_low, result.ci_high
    if low is not None and high is not None:
        row["participants_low"] = _needed(max(abs(low), abs(high)), alpha)
        row["participants_high"] = None if low <= 0 <= high else _needed(min(abs(low), abs(high)), alpha)
    return row


def _needed(dz: float, alpha: float) -> int | None:
    """The fewest participants at which a paired t test finds d_z with a power of 80 %; None if more than `MOST`."""
    design = Design("t_paired", difference_of_dz(abs(dz), _CORRELATION), _CORRELATION, 2, alpha)
    near = (2.8 / max(abs(dz), 1e-3)) ** 2  # the normal approximation at the usual alpha
    return fewest(design, POWER, MOST, start=int(np.clip(near, FEWEST, MOST)))


def _values(people: pd.DataFrame, estimator: str, measure: str) -> FloatArray:
    """A measure of everybody with one estimator, by repeat and participant."""
    theirs = people[people["estimator"] == estimator].sort_values(["repeat", "participant"])
    return theirs[measure].to_numpy(np.float64)


def what_pays(people: pd.DataFrame, now: Tracker, measure: str) -> Pays:
    """A better filter at the tracker `now`, or a better tracker with the first estimator?"""
    estimators = list(dict.fromkeys(people["estimator"]))
    trackers = [Tracker(*row) for row in people[list(Tracker._fields)].drop_duplicates().itertuples(index=False)]
    values = {
        (tracker, estimator): _values(_under(people, tracker), estimator, measure)
        for tracker in trackers
        for estimator in estimators
        if estimator == estimators[0] or tracker == now
    }

    def way(point: tuple[Tracker, str]) -> Way:
        mean = float(np.nanmean(values[point])) if np.isfinite(values[point]).any() else np.inf
        return Way(*point, float(np.sqrt(mean)) if measure.startswith("selection_mse") else mean)

    here = way((now, estimators[0]))
    by_filter = [way((now, estimator)) for estimator in estimators[1:]]
    by_tracker = [way((other, here.estimator)) for other in trackers if other != now and other.at_least(now)]
    best = [min(ways, key=lambda one: one.value, default=None) for ways in (by_filter, by_tracker)]
    enough = None
    if best[0] is not None and best[0].value < here.value:
        as_good = [one for one in by_tracker if one.value <= best[0].value]
        enough = min(as_good, key=lambda one: _effort(one.tracker, now), default=None)
    return Pays(measure, here, best[0], best[1], enough, _verdict(here, best, values))


def _under(people: pd.DataFrame, tracker: Tracker) -> pd.DataFrame:
    same = [people[name] == value for name, value in tracker._asdict().items()]
    return people[np.logical_and.reduce(same)]


def _effort(tracker: Tracker, now: Tracker) -> tuple[int, float]:
    """How much better a tracker has to be: in how many respects, and by which factor in all."""
    factors = [(was or 1e-3) / (new or 1e-3) for new, was in zip(tracker, now, strict=True)]
    factors[2] = 1 / factors[2]  # of the rate, more is better
    return sum(factor != 1 for factor in factors), float(np.prod(factors))


def _verdict(
    here: Way, best: Sequence[Way | None], values: dict[tuple[Tracker, str], FloatArray]
) -> Literal["filter", "tracker", "equal", "neither"] | None:
    by_filter, by_tracker = best
    if by_filter is None or by_tracker is None:
        return None
    of_filter, of_tracker = (values[way.tracker, way.estimator] for way in (by_filter, by_tracker))
    better = of_filter if by_filter.value < by_tracker.value else of_tracker
    if _clearly(better, values[here.tracker, here.estimator]) >= 0:
        return "neither"
    sign = _clearly(of_filter, of_tracker)
    return "equal" if sign == 0 else "filter" if sign < 0 else "tracker"


def _clearly(first: FloatArray, second: FloatArray) -> int:
    """The sign of first less second, person by person; 0 where its 95 % interval includes zero or there is none."""
    less = first - second
    less = less[np.isfinite(less)]
    if len(less) < 2:
        return 0
    found = summarize(less)
    return int(found["ci_low"] > 0) - int(found["ci_high"] < 0)
