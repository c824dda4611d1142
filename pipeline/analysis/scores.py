"""Scores of questionnaires: which instrument has a rule, what its rule makes of the answers, and what it lacks.

A rule is stated under `scoring:`, or goes without saying where a questionnaire bears the name of an instrument whose
range of answers is fixed (sus, ueq, ueq_s, ssq, ipq) and the data hold its items. Ratings that are no items of a rule
stay what they are, and get no total.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.scoring import MISSING, OUT_OF_RANGE, Fault, cronbach_alpha, scored
from pipeline.study.scoring import RULES, ScoringRule
from pipeline.study.scoring_settings import OWN_RULES
from pipeline.study.settings import Study
from pipeline.tables.table import Row
from pipeline.words import listing, number

_CELL = ["participant", "condition", "session"]
_WEIGHT = "weight"
_SHOWN = 6


@dataclass(frozen=True)
class Instrument:
    """A questionnaire of the data with its rule, its limits, and which rule's item each of its measures is."""

    questionnaire: str
    rule: ScoringRule
    limits: tuple[float, float]
    items: Mapping[str, str]
    weights: Mapping[str, str]

    @property
    def scores(self) -> list[str]:
        """The names of the measures that are its scores."""
        return [f"{self.questionnaire}/{scale.name}" for scale in self.rule.scales]


def instruments(study: Study, measures: Sequence[str]) -> list[Instrument]:
    """The questionnaires of the data that are scored; PipelineError for a rule that does not fit what is there."""
    scales: dict[str, list[str]] = {}
    for name in measures:
        questionnaire, slash, scale = name.partition("/")
        if slash:
            scales.setdefault(questionnaire, []).append(scale)
    for questionnaire in study.scoring:
        if questionnaire not in scales:
            hint = did_you_mean(questionnaire, sorted(scales))
            raise PipelineError(f'study.yaml: scoring: there is no questionnaire "{questionnaire}" in the data{hint}')
    found = (_instrument(study, questionnaire, given) for questionnaire, given in scales.items())
    return [one for one in found if one is not None]


def _instrument(study: Study, questionnaire: str, given: Sequence[str]) -> Instrument | None:
    entry = study.scoring.get(questionnaire)
    if entry is None:
        rule = RULES.get(questionnaire)
        if rule is None or rule.limits is None or rule.weighted:
            return None
        limits = rule.limits
    else:
        rule, limits = entry.rule_for([scale for scale in given if not _is_weight(scale)]), entry.limits
    own = entry is not None and entry.rule in OWN_RULES
    items = {scale: item for scale in given if not _is_weight(scale) and (item := scale if own else rule.item(scale))}
    weights = {scale: item for scale in given if _is_weight(scale) and (item := rule.item(_weighed(scale)))}
    missing = [item for item in rule.items if item not in set(items.values())]
    if missing and entry is None:
        return None  # scores that are made already, or another version: nothing says that this rule is meant
    for item in rule.reversed if own else ():
        if item not in items:
            hint = did_you_mean(item, list(items))
            raise PipelineError(f'study.yaml: scoring.{questionnaire}.reversed: there is no item "{item}"{hint}')
    if missing:
        named = listing(missing[:_SHOWN]) + (f" and {len(missing) - _SHOWN} more" if len(missing) > _SHOWN else "")
        raise PipelineError(
            f"study.yaml: scoring.{questionnaire}: rule {rule.name} needs {len(rule.items)} items, and the data lack"
            f" {named}; they have {listing(list(given)[:_SHOWN])}{' …' if len(given) > _SHOWN else ''}"
        )
    return Instrument(questionnaire, rule, limits, items, weights)


def _is_weight(scale: str) -> bool:
    """`weight_mental` and `mental_weight` are a participant's weights, not ratings."""
    return scale.startswith(f"{_WEIGHT}_") or scale.endswith(f"_{_WEIGHT}")


def _weighed(scale: str) -> str:
    return scale.removeprefix(f"{_WEIGHT}_").removesuffix(f"_{_WEIGHT}")


def items_of(scored_by: Sequence[Instrument]) -> dict[str, list[str]]:
    """For each measure that is an item, the scores that it counts in; items that are no scale of their own."""
    return {
        f"{one.questionnaire}/{given}": [
            f"{one.questionnaire}/{scale.name}" for scale in one.rule.scales if item in scale.items
        ]
        for one in scored_by
        for given, item in {**one.items, **one.weights}.items()
    }


def score_values(scored_by: Sequence[Instrument], values: pd.DataFrame, exclusions: list[Row]) -> pd.DataFrame:
    """Rows of scores, as those of `values`; why one is undefined is listed, and leaves its participant out of it."""
    rows: list[Row] = []
    for one in scored_by:
        prefix = f"{one.questionnaire}/"
        names = {f"{prefix}{given}": (item, False) for given, item in one.items.items()}
        names |= {f"{prefix}{given}": (item, True) for given, item in one.weights.items()}
        mine = values[values["measure"].isin(list(names))]
        for cell, answers in mine.groupby([*_CELL, "period"], dropna=False, sort=True):
            participant, condition, session, period = cell
            ratings: dict[str, float | None] = {}
            weights: dict[str, float | None] = {}
            for name, value in zip(answers["measure"], answers["value"], strict=True):
                item, is_weight = names[name]
                (weights if is_weight else ratings)[item] = float(value)
            result = scored(ratings, one.rule.scales, one.limits, one.rule.reversed, weights or None)
            who: Row = {"participant": participant, "condition": condition, "session": _known(session)}
            for score, value in result.scores.items():
                if value is not None:
                    rows.append({**who, "period": period, "measure": f"{prefix}{score}", "value": value})
            exclusions += _undefined(who, one, result.faults)
    columns = [*_CELL, "period", "measure", "value"]
    found = pd.DataFrame(rows, columns=columns).assign(factors=None, source="the scores")
    return found.astype({"value": "float64", "factors": "object", "period": "Int64"})


def _known(session: object) -> object:
    return None if pd.isna(session) else session  # type: ignore[call-overload]


def _undefined(who: Row, one: Instrument, faults: Sequence[Fault]) -> Iterator[Row]:
    """An exclusion a score that is undefined, with every reason."""
    for score in dict.fromkeys(name for fault in faults for name in fault.scores):
        reasons = [_reason(fault, one) for fault in faults if score in fault.scores]
        reason = "; ".join(dict.fromkeys(reasons))
        yield {**who, "measure": f"{one.questionnaire}/{score}", "what": "score undefined", "reason": reason}


def _reason(fault: Fault, one: Instrument) -> str:
    if fault.what == OUT_OF_RANGE and fault.value is not None:
        low, high = one.limits
        return f"{fault.item} is {number(fault.value)}, outside {low:g} to {high:g}; state the range under scoring"
    if fault.what == MISSING:
        return f"{fault.item} is missing"
    return f"{fault.item} {fault.what}".strip()


def reliability(scored_by: Sequence[Instrument], values: pd.DataFrame) -> Iterator[Row]:
    """Cronbach's α of every score of several items, over all participants and conditions that answered all of them."""
    for one in scored_by:
        prefix = f"{one.questionnaire}/"
        given = {f"{prefix}{scale}": item for scale, item in one.items.items()}
        mine = values[values["measure"].isin(list(given))]
        wide = mine.pivot_table(index=["participant", "condition"], columns="measure", values="value", aggfunc="mean")
        wide = wide.rename(columns=given)
        for item in one.rule.reversed & set(wide.columns):
            wide[item] = sum(one.limits) - wide[item]
        for scale in one.rule.scales:
            items = list(dict.fromkeys(scale.items))
            if len(items) < 2 or not set(items) <= set(wide.columns):
                continue
            answers = wide[items].dropna().to_numpy("float64")
            result = cronbach_alpha(answers)
            yield {
                "measure": f"{prefix}{scale.name}",
                "rule": one.rule.label or f"{one.rule.scales[0].reading} of {len(items)} items",
                "items": len(items),
                "n": result.n,
                "alpha": result.statistic,
                "ci_low": result.ci_low,
                "ci_high": result.ci_high,
                "assumes": one.rule.assumes or None,
                "status": result.status,
            }
