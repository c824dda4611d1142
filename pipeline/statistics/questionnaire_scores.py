"""The scores of one participant's questionnaire from its ratings, and Cronbach's α of a scale's items."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from math import comb, isfinite

import numpy as np
from scipy import stats

from pipeline.statistics import NO_TOTAL_VARIES, NO_VARIATION, ONE_ITEM, with_pingouin
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.instrument import Scale
from pipeline.statistics.result import Result, negligible, too_few

MISSING, OUT_OF_RANGE, IMPOSSIBLE_WEIGHTS = "missing", "out of range", "weights that no comparison of pairs gives"


@dataclass(frozen=True)
class Fault:
    """Why `scores` are undefined: an item's rating or weight is missing or out of range, or the weights do not add up.

    `value` is the offending rating or weight, None where it is missing. Where the weights as a whole are at fault,
    `item` is empty and `value` is their sum.
    """

    item: str
    what: str
    value: float | None
    scores: tuple[str, ...]


@dataclass(frozen=True)
class ParticipantScores:
    """A participant's scores in one condition, None where one is undefined, and every reason for that."""

    scores: Mapping[str, float | None]
    faults: tuple[Fault, ...]


def participant_scores(
    ratings: Mapping[str, float | None],
    scales: Sequence[Scale],
    limits: tuple[float, float],
    reversed_items: Collection[str] = (),
    weights: Mapping[str, float | None] | None = None,
) -> ParticipantScores:
    """The scores of one participant in one condition from ratings by item; items of no scale are ignored.

    A score is undefined where one of its items is missing (absent, None or NaN) or outside the `limits`, the lowest
    and the highest answer. A weighted score also needs `weights` by item: how often each item was chosen when every
    two were compared. Weights that no such comparison can give leave it undefined.
    """
    rating_of = {item: _number(ratings.get(item)) for scale in scales for item in scale.items}
    faults = [
        Fault(item, what, value, tuple(scale.name for scale in scales if item in scale.items))
        for item, value in rating_of.items()
        if (what := _fault(value, limits)) is not None
    ]
    weight_of = {item: _number(value) for item, value in (weights or {}).items()}
    faults += [fault for scale in scales if scale.weighted for fault in _weight_faults(scale, weight_of)]
    undefined = {name for fault in faults for name in fault.scores}
    aligned = {
        item: sum(limits) - value if item in reversed_items else value
        for item, value in rating_of.items()
        if value is not None
    }
    scores = {
        scale.name: None if scale.name in undefined else _score(scale, aligned, weight_of, limits) for scale in scales
    }
    return ParticipantScores(scores, tuple(faults))


def _number(value: float | None) -> float | None:
    return None if value is None or not isfinite(value) else float(value)


def _fault(value: float | None, limits: tuple[float, float]) -> str | None:
    if value is None:
        return MISSING
    return None if limits[0] <= value <= limits[1] else OUT_OF_RANGE


def _weight_faults(scale: Scale, weights: Mapping[str, float | None]) -> Iterator[Fault]:
    """Weights of k items: whole numbers up to k − 1, and any j of them sum to at least j(j − 1)/2 (Landau 1953)."""
    by_item = [weights.get(item) for item in scale.items]
    most = len(scale.items) - 1
    single = [_fault(weight, (0, most)) for weight in by_item]
    yield from (
        Fault(item, f"weight {what}", weight, (scale.name,))
        for item, weight, what in zip(scale.items, by_item, single, strict=True)
        if what is not None
    )
    if any(single):
        return
    ascending = sorted(weight for weight in by_item if weight is not None)
    sums = list(accumulate(ascending))
    enough = all(total >= comb(count, 2) for count, total in enumerate(sums, 1))
    if sums[-1] != comb(len(ascending), 2) or not enough or any(weight % 1 for weight in ascending):
        yield Fault("", IMPOSSIBLE_WEIGHTS, sums[-1], (scale.name,))


def _score(
    scale: Scale,
    aligned: Mapping[str, float],
    weights: Mapping[str, float | None],
    limits: tuple[float, float],
) -> float:
    """A score from all its items, `aligned`: reversed items are turned already."""
    low, high = limits
    values = np.array([aligned[item] for item in scale.items])
    item_weights = np.array([weights.get(item) or 0.0 for item in scale.items]) if scale.weighted else None
    mean = float(np.average(values, weights=item_weights))
    by_reading = {
        "mean": mean,
        "sum": float(np.sum(values)),
        "centred": mean - (low + high) / 2,
        "percent": 100 * (mean - low) / (high - low),
        "points": float(np.sum(values - low)),
    }
    return scale.factor * by_reading[scale.reading]


def cronbach_alpha(items: FloatArray) -> Result:
    """Cronbach's (1951) α of ratings (n, k), reversed items turned already, with Feldt's (1965) 95 % interval.

    α = k/(k − 1) · (1 − Σ item variances / variance of the sums), as pingouin computes it. The interval is our own:
    pingouin rounds its bounds to three decimals.
    """
    n, k = items.shape
    blank = Result("items", "alpha", "Cronbach's alpha, interval by Feldt", "Cronbach's alpha", n)
    totals = items.sum(axis=1)
    status = too_few(n) or (ONE_ITEM if k < 2 else None)
    if status is None and negligible(float(np.sum((totals - totals.mean()) ** 2)), items):
        varies = not negligible(float(np.sum((items - items.mean(axis=0)) ** 2)), items)
        status = NO_TOTAL_VARIES if varies else NO_VARIATION
    if status is not None:
        return replace(blank, status=status)
    alpha = with_pingouin.cronbach_alpha(items)
    df1, df2 = n - 1, (n - 1) * (k - 1)
    low, high = (1 - (1 - alpha) * float(stats.f.ppf(level, df1, df2)) for level in (0.975, 0.025))
    return replace(
        blank, statistic=alpha, df1=df1, df2=df2, effect_size=alpha, ci_low=low, ci_high=high, details={"items": k}
    )
