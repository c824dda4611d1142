"""Scores of questionnaires: which instrument has a scoring rule, its scores, and why a score is undefined.

A rule is stated under `scoring:`, or follows from the name of a questionnaire whose range of answers is fixed (sus,
ueq, ueq_s, ssq, ipq), if the data hold its items. Ratings that are no items of a rule are kept as they are, without a
total.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from pipeline.analysis.answer_ranges import remedy, shifted_range
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.questionnaire_scores import MISSING, OUT_OF_RANGE, Fault, cronbach_alpha, participant_scores
from pipeline.study.comparison import matching_measures
from pipeline.study.scoring_rules import RULES, ScoringRule, is_weight, weighed_item
from pipeline.study.scoring_settings import OWN_RULES
from pipeline.study.settings import Study
from pipeline.tables.table import Row
from pipeline.words.phrases import listing

_CELL = ["participant", "condition", "session"]
_SHOWN = 6
_REASONS_MAX = 3
UNDEFINED = "score undefined"
"""What the table `exclusions` calls a score that could not be made."""


@dataclass(frozen=True)
class Instrument:
    """A questionnaire of the data with its rule, the range of its answers, and the rule's item that each measure is."""

    questionnaire: str
    rule: ScoringRule
    limits: tuple[float, float]
    items: Mapping[str, str]
    weights: Mapping[str, str]
    range_is_stated: bool

    @property
    def scores(self) -> list[str]:
        """The names of the measures that are its scores."""
        return [f"{self.questionnaire}/{scale.name}" for scale in self.rule.scales]


def instruments(study: Study, measures: Sequence[str]) -> list[Instrument]:
    """The questionnaires of the data that are scored; PipelineError for a rule that does not fit the data."""
    scales: dict[str, list[str]] = {}
    for name in measures:
        questionnaire, slash, scale = name.partition("/")
        if slash:
            scales.setdefault(questionnaire, []).append(scale)
    for questionnaire in study.scoring:
        if questionnaire not in scales:
            hint = did_you_mean(questionnaire, sorted(scales))
            raise PipelineError(f'study.yaml: scoring: there is no questionnaire "{questionnaire}" in the data{hint}')
    candidates = (_instrument(study, questionnaire, given) for questionnaire, given in scales.items())
    return [instrument for instrument in candidates if instrument is not None]


def _instrument(study: Study, questionnaire: str, given: Sequence[str]) -> Instrument | None:
    entry = study.scoring.get(questionnaire)
    if entry is None:
        _refuse_unused_weights(questionnaire, given)
        rule = RULES.get(questionnaire)
        if rule is None or rule.limits is None or rule.weighted:
            return None
        limits = rule.limits
    else:
        rule, limits = entry.rule_for([scale for scale in given if not is_weight(scale)]), entry.limits
    own = entry is not None and entry.rule in OWN_RULES
    items = {scale: item for scale in given if not is_weight(scale) and (item := scale if own else rule.item(scale))}
    weights = {scale: item for scale in given if is_weight(scale) and (item := rule.item(weighed_item(scale)))}
    missing = [item for item in rule.items if item not in set(items.values())]
    if missing and entry is None:
        return None  # scores already computed, or another version: nothing says that this rule is meant
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
    return Instrument(questionnaire, rule, limits, items, weights, entry is not None and entry.range is not None)


def _refuse_unused_weights(questionnaire: str, given: Sequence[str]) -> None:
    """Raise PipelineError for the weights of a NASA-TLX that no rule uses: they would be compared as if rated."""
    tlx = RULES["weighted_tlx"]
    weights = [scale for scale in given if is_weight(scale) and tlx.item(weighed_item(scale))]
    if len(weights) == len(tlx.items):
        raise PipelineError(
            f'study.yaml: scoring: "{questionnaire}" has the weights {listing(weights[:_SHOWN])}, and no rule says what'
            f" to do with them; write scoring: {{{questionnaire}: {{rule: weighted_tlx, range: [0, 100]}}}}, with the"
            " lowest and the highest answer of your sheet"
        )


def items_of(scored_by: Sequence[Instrument]) -> dict[str, list[str]]:
    """For each measure that is an item, the scores to which it contributes (none for some items)."""
    return {
        f"{instrument.questionnaire}/{given}": [
            f"{instrument.questionnaire}/{scale.name}" for scale in instrument.rule.scales if item in scale.items
        ]
        for instrument in scored_by
        for given, item in {**instrument.items, **instrument.weights}.items()
    }


def score_values(scored_by: Sequence[Instrument], values: pd.DataFrame, exclusions: list[Row]) -> pd.DataFrame:
    """Rows of scores, as those of `values`; a score that is undefined is left out, and listed in `exclusions`."""
    rows: list[Row] = []
    for instrument in scored_by:
        prefix = f"{instrument.questionnaire}/"
        names = {f"{prefix}{given}": (item, False) for given, item in instrument.items.items()}
        names |= {f"{prefix}{given}": (item, True) for given, item in instrument.weights.items()}
        answers = values[values["measure"].isin(list(names))]
        moved = _moved(instrument, answers)
        if moved is not None:
            reason = remedy(instrument.questionnaire, instrument.rule, instrument.limits, moved)
            exclusions += [{"measure": name, "what": UNDEFINED, "reason": reason} for name in instrument.scores]
            continue
        for cell, cell_answers in answers.groupby([*_CELL, "period"], dropna=False, sort=True):
            participant, condition, session, period = cell
            ratings: dict[str, float | None] = {}
            weights: dict[str, float | None] = {}
            for name, value in zip(cell_answers["measure"], cell_answers["value"], strict=True):
                item, is_weight = names[name]
                (weights if is_weight else ratings)[item] = float(value)
            result = participant_scores(
                ratings, instrument.rule.scales, instrument.limits, instrument.rule.reversed, weights or None
            )
            who: Row = {"participant": participant, "condition": condition, "session": _or_none(session)}
            for score, value in result.scores.items():
                if value is not None:
                    rows.append({**who, "period": period, "measure": f"{prefix}{score}", "value": value})
            exclusions += _undefined(who, instrument, result.faults)
    columns = [*_CELL, "period", "measure", "value"]
    scores = pd.DataFrame(rows, columns=columns).assign(factors=None, trial=None, source="the scores")
    return scores.astype({"value": "float64", "factors": "object", "period": "Int64", "trial": "Int64"})


def _moved(instrument: Instrument, answers: pd.DataFrame) -> tuple[float, float] | None:
    """The range on which an instrument's answers seem to run instead of that of its rule; None where one was stated."""
    if instrument.range_is_stated:
        return None
    items = [f"{instrument.questionnaire}/{given}" for given in instrument.items]
    return shifted_range(answers[answers["measure"].isin(items)], instrument.limits)


def refuse_undefined(study: Study, known: Sequence[str], exclusions: pd.DataFrame) -> None:
    """PipelineError where an entry of `comparisons` asks for scores of which not one is defined, saying why.

    `known` are the measures that there are, `exclusions` the table of what is missing.
    """
    undefined = exclusions[exclusions["what"] == UNDEFINED]
    for wanted in (pattern for entry in study.comparisons for pattern in entry.measures):
        asked = matching_measures(wanted, undefined["measure"].unique())
        if asked and not matching_measures(wanted, known):
            reasons = list(undefined.loc[undefined["measure"].isin(asked), "reason"].unique())
            why = "; ".join(reasons[:_REASONS_MAX]) + ("; …" if len(reasons) > _REASONS_MAX else "")
            raise PipelineError(f'study.yaml: comparisons: nobody has a score of "{wanted}": {why}')


def _or_none(session: object) -> object:
    return None if pd.isna(session) else session  # type: ignore[call-overload]


def _undefined(who: Row, instrument: Instrument, faults: Sequence[Fault]) -> Iterator[Row]:
    """One exclusion per undefined score, with every reason."""
    for score in dict.fromkeys(name for fault in faults for name in fault.scores):
        reasons = [_reason(fault, instrument) for fault in faults if score in fault.scores]
        reason = "; ".join(dict.fromkeys(reasons))
        yield {**who, "measure": f"{instrument.questionnaire}/{score}", "what": UNDEFINED, "reason": reason}


def _reason(fault: Fault, instrument: Instrument) -> str:
    if fault.what == OUT_OF_RANGE and fault.value is not None:
        low, high = instrument.limits
        remedy_of_range = "" if instrument.range_is_stated else "; state the range under scoring"
        return f"{fault.item} is {fault.value:g}, outside {low:g} to {high:g}{remedy_of_range}"
    if fault.what == MISSING:
        return f"{fault.item} is missing"
    return f"{fault.item} {fault.what}".strip()


def reliability(scored_by: Sequence[Instrument], values: pd.DataFrame) -> Iterator[Row]:
    """Cronbach's α of every score of several items, over all participants and conditions that answered all of them."""
    for instrument in scored_by:
        prefix = f"{instrument.questionnaire}/"
        given = {f"{prefix}{scale}": item for scale, item in instrument.items.items()}
        answers = values[values["measure"].isin(list(given))]
        if _moved(instrument, answers) is not None:
            continue
        wide = answers.pivot_table(
            index=["participant", "condition"], columns="measure", values="value", aggfunc="mean"
        )
        wide = wide.rename(columns=given)
        for item in instrument.rule.reversed & set(wide.columns):
            wide[item] = sum(instrument.limits) - wide[item]
        for scale in instrument.rule.scales:
            items = list(dict.fromkeys(scale.items))
            if len(items) < 2 or not set(items) <= set(wide.columns):
                continue
            complete = wide[items].dropna().to_numpy("float64")
            result = cronbach_alpha(complete)
            yield {
                "measure": f"{prefix}{scale.name}",
                "rule": instrument.rule.label or f"{instrument.rule.scales[0].reading} of {len(items)} items",
                "items": len(items),
                "n": result.n,
                "alpha": result.statistic,
                "ci_low": result.ci_low,
                "ci_high": result.ci_high,
                "assumes": instrument.rule.assumes or None,
                "status": result.status,
            }
