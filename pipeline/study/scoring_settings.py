"""`scoring:` in study.yaml: by which rule a questionnaire is scored."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal, cast

from pydantic import BeforeValidator, Field, model_validator

from pipeline.study.fields import Finite, Frozen, Id, known
from pipeline.study.scoring_rules import RULES, ScoringRule, own_rule

OWN_RULES = ("mean", "sum")
"""Rules of a study's own: the mean or the sum of all items."""


def _rule_alone(value: object) -> object:
    """`sus: sus` is short for `sus: {rule: sus}`."""
    return {"rule": value} if isinstance(value, str) else value


class ScoringEntry(Frozen):
    """How one questionnaire is scored. `range` is the lowest and the highest answer its sheet allows."""

    rule: str
    range: tuple[Finite, Finite] | None = None
    reversed: tuple[Id, ...] = ()
    better: Literal["lower", "higher"] | None = None

    @model_validator(mode="after")
    def _fits_the_rule(self) -> ScoringEntry:
        known("rule", self.rule, (*RULES, *OWN_RULES))
        if self.range is not None and self.range[0] >= self.range[1]:
            raise ValueError(f"range needs the lowest answer first, found {list(self.range)}")
        if self.range is None and (self.rule in OWN_RULES or RULES[self.rule].limits is None):
            raise ValueError(f"rule {self.rule} needs range, the lowest and the highest answer, such as range: [1, 7]")
        if self.reversed and self.rule not in OWN_RULES:
            raise ValueError(f"rule {self.rule} knows its reversed items; leave reversed out")
        return self

    def rule_for(self, items: Iterable[str]) -> ScoringRule:
        """The rule, for a questionnaire with these items."""
        if self.rule in RULES:
            return RULES[self.rule]
        reading = cast("Literal['mean', 'sum']", self.rule)
        return own_rule(items, reading, self.limits, self.reversed, self.better or "higher")

    @property
    def limits(self) -> tuple[float, float]:
        """The lowest and the highest answer."""
        limits = self.range if self.range is not None else RULES[self.rule].limits
        if limits is None:
            raise ValueError(f"rule {self.rule} has no range of its own")
        return limits


Scoring = Annotated[ScoringEntry, BeforeValidator(_rule_alone), Field()]
