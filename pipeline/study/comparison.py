"""An entry of `comparisons:` in study.yaml: which measure, which test, which options."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from pipeline.study.fields import Finite, Frozen, Id, known
from pipeline.study.statistical_tests import ADJUSTMENTS, TESTS, TUKEY, Design, tests_that_take


def _known_test(name: str) -> str:
    known("test", name, TESTS)
    return name


def _known_adjustment(name: str) -> str:
    if name == TUKEY:
        raise ValueError(
            "tukey adjusts no p values that are there: it is a test of every two groups. Write test: anova_welch,"
            " follow_up: tukey; within participants adjust: holm"
        )
    known("adjustment", name, ("none", *ADJUSTMENTS))
    return name


def _known_follow_up(name: str) -> str:
    known("way to follow up", name, ("none", *ADJUSTMENTS, TUKEY))
    return name


TestName = Annotated[str, AfterValidator(_known_test)]
AdjustmentName = Annotated[str, AfterValidator(_known_adjustment)]
FollowUpName = Annotated[str, AfterValidator(_known_follow_up)]


_PERIOD_AS_FACTOR = "factor(period)"
OPTIONS = {option for test in TESTS.values() for option in test.options}
"""The keys that only some tests take."""


_OTHER_ERRORS = (
    "is not followed up by tukey, whose p is of groups of measurements with one SD: it is for anova_welch; take"
    " follow_up: holm"
)
_NO_TUKEY: Mapping[Design, str] = {
    "within": "is not followed up by tukey: within participants all pairs would need one standard error, which they"
    " have with sphericity alone; take follow_up: holm, each pair with an error of its own",
    "mixed": "is not followed up by tukey: its pairs within participants would need sphericity; take follow_up: holm,"
    " or test: anova_welch for the groups alone",
}


class Comparison(Frozen):
    """What to test. A key that the test does not take is an error, since the user must have meant something else."""

    measure: Id | Annotated[tuple[Id, ...], Field(min_length=1)]
    test: TestName
    within: tuple[Id, ...] = ("condition",)
    adjust: AdjustmentName = "none"
    follow_up: FollowUpName = "holm"
    between: Id | None = None
    family: Id | None = None
    missing: Literal["listwise", "available"] = "listwise"
    zeros: Literal["dropped", "pratt"] = "dropped"
    bounds: tuple[Finite, Finite] | None = None
    prior_scale: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = 0.707
    fixed: tuple[Id, ...] = ("condition",)
    random: Id | None = None
    transform: Literal["none", "log"] = "none"
    exposure: Id | None = None
    bootstrap: bool = False
    permutation: bool = False
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    hypothesis: Annotated[str, Field(min_length=1)] | None = None
    direction: Literal["less", "greater"] | None = None

    @model_validator(mode="after")
    def _fits_the_test(self) -> Comparison:
        for key in OPTIONS - set(TESTS[self.test].options):
            if getattr(self, key) != type(self).model_fields[key].default:
                *others, last = tests_that_take(key)
                named = f"{', '.join(others)} and {last}" if others else last
                raise ValueError(f"{self.test} does not take {key}; it is for {named}")
        if self.family is not None and self.adjust == "none":
            raise ValueError(f'family "{self.family}" needs an adjustment, such as adjust: holm')
        for key, names in (("within", self.within), ("fixed", self.terms)):
            if "condition" not in names or len(set(names)) < len(names):
                raise ValueError(f'{key} of "{self.title}" must contain "condition", and no name twice')
        if len(self.within) > 3:
            raise ValueError(f"{self.test} does not take within: {list(self.within)}; three factors are the most")
        for term in self.terms:
            parts = term.split(":")
            for name in parts:
                if len(parts) > 1 and name not in self.terms:
                    raise ValueError(f'fixed: "{term}" needs "{name}" as a term too')
            if len(parts) > 1 and "period" in parts and self.period_is_slope:
                raise ValueError(f'fixed: "{term}" needs factor(period) in the place of period')
        return self

    @model_validator(mode="after")
    def _tukey_is_of_groups(self) -> Comparison:
        if self.follow_up == TUKEY and self.test != "anova_welch":
            raise ValueError(f"{self.test} {_NO_TUKEY.get(TESTS[self.test].design, _OTHER_ERRORS)}")
        return self

    @model_validator(mode="after")
    def _bounds_hold_no_difference(self) -> Comparison:
        if self.test == "tost" and self.bounds is None:
            raise ValueError("tost needs bounds, in the unit of the measure, such as bounds: [-5, 5]")
        if self.bounds is not None and self.bounds[0] >= self.bounds[1]:
            raise ValueError(f"bounds need the lower one first, found {list(self.bounds)}")
        if self.bounds is not None and not self.bounds[0] < 0 < self.bounds[1]:
            raise ValueError(
                f"bounds must have 0, no difference, between them, found {list(self.bounds)}: they say from which"
                " difference on, in either direction, two conditions are not equivalent"
            )
        return self

    @model_validator(mode="after")
    def _options_fit_together(self) -> Comparison:
        if "seed" in self.model_fields_set and not self.draws_at_random:
            raise ValueError(
                "seed is for the chance of a bootstrap or permutation; add bootstrap: true, or leave it out"
            )
        if self.random in {name for term in self.terms for name in term.split(":")}:
            raise ValueError(f'random: "{self.random}" is a fixed term already; leave it out of one of them')
        return self

    @model_validator(mode="after")
    def _has_a_direction(self) -> Comparison:
        if self.direction is not None and TESTS[self.test].question == "equivalence":
            raise ValueError(f"{self.test} supposes that there is no difference, so direction has no meaning there")
        return self

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures that the entry names, each a name or a pattern."""
        return (self.measure,) if isinstance(self.measure, str) else self.measure

    @property
    def title(self) -> str:
        """The measures as an error names them."""
        return ", ".join(self.measures)

    @property
    def draws_at_random(self) -> bool:
        """Does it compute anything by chance, so that its seed means something?"""
        return self.bootstrap or self.permutation

    @property
    def is_within(self) -> bool:
        """Does its test compare conditions within participants?"""
        return TESTS[self.test].design == "within"

    @property
    def options(self) -> tuple[str, ...]:
        """The keys of the entry that its test takes and some others do not."""
        return TESTS[self.test].options

    @property
    def terms(self) -> tuple[str, ...]:
        """The names in `fixed`; factor(period) is the period too."""
        return tuple(term.replace(_PERIOD_AS_FACTOR, "period") for term in self.fixed)

    @property
    def period_is_slope(self) -> bool:
        """Whether the period is a number, with the same effect from each period to the next, rather than a factor."""
        return _PERIOD_AS_FACTOR not in self.fixed


def matching_measures(wanted: str, known: Iterable[str]) -> list[str]:
    """The measures that a name or pattern of an entry stands for; `*` stands for anything, but never for a total."""
    expression = re.compile(".*".join(re.escape(piece) for piece in wanted.split("*")))
    is_pattern = "*" in wanted
    return [name for name in known if expression.fullmatch(name) and not (is_pattern and name.endswith("/total"))]
