"""printed.yaml as frozen models: the figures of a publication, digit for digit. docs/audit.md is the reference."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    PlainValidator,
    ValidationInfo,
    model_validator,
)

from pipeline.errors import did_you_mean
from pipeline.study.fields import Frozen, Id, known, unique
from pipeline.study.rounded import Rounded, Rounding
from pipeline.study.yaml_text import parse, read_yaml

Symbol = Literal["t", "F", "chi2", "H", "z", "r"]
DEGREES_OF_FREEDOM: Mapping[Symbol, int] = {"t": 1, "F": 2, "chi2": 1, "H": 1, "z": 0, "r": 1}

BETWEEN = ("t_independent", "welch", "anova", "mann_whitney", "kruskal")
"""Tests of groups: each has participants of its own."""


def _listed(value: object) -> object:
    """A single text as a list with that text."""
    return (value,) if isinstance(value, str) else value


def _read(value: object, info: ValidationInfo) -> Rounded:
    """A printed figure; `rounding` in the validation's context says how it was rounded."""
    if isinstance(value, Rounded):
        return value
    if not isinstance(value, str):
        raise ValueError("should be a number with its digits as printed")
    return Rounded.read(value, (info.context or {}).get("rounding", "nearest"))


def _no_relation(value: Rounded) -> Rounded:
    if value.relation != "=":
        raise ValueError("should be a number; only p may have < or >")
    return value


_Text = PlainSerializer(lambda value: value.text, return_type=str)
PValue = Annotated[Rounded, PlainValidator(_read), _Text]
Number = Annotated[Rounded, PlainValidator(lambda value, info: _no_relation(_read(value, info))), _Text]
Count = Annotated[int, Field(ge=1, le=1_000_000)]
Names = Annotated[tuple[Id, ...], BeforeValidator(_listed), Field(min_length=1)]


_KNOWN_SCALES: Mapping[str, Mapping[str, str]] = {
    "sus": {"step": "2.5", "min": "0", "max": "100"},
    "raw_tlx": {"step": "5", "min": "0", "max": "100", "items": "6"},
}
"""Scores by name: what their makers' rules and sheets allow (Brooke 1996; Hart and Staveland 1988, 21 gradations)."""


def _scale(value: object) -> object:
    """A scale by its name, or as it is."""
    if isinstance(value, str):
        known("scale", value, _KNOWN_SCALES)
        return dict(_KNOWN_SCALES[value])
    return value


class Scale(Frozen):
    """What a participant's score can be: from `min` to `max` in steps; a mean of `items` such ratings."""

    step: Number | None = None
    items: Count = 1
    min: Number | None = None
    max: Number | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> Scale:
        if self.step is not None and self.step.value <= 0:
            raise ValueError("scale: step should be more than 0")
        if self.min is not None and self.max is not None:
            if self.min.value >= self.max.value:
                raise ValueError("scale: min should be less than max")
            if self.step is not None and ((self.max.value - self.min.value) / self.step.value).denominator != 1:
                raise ValueError("scale: from min to max should be a whole number of steps")
        return self


class Cell(Frozen):
    """One condition's printed figures; `rmse` is the root of `mean`, a mean of squares."""

    n: Count | None = None
    mean: Number | None = None
    sd: Number | None = None
    median: Number | None = None
    rmse: Number | None = None
    ci: tuple[Number, Number] | None = None
    ci_level: Number = Rounded.read("95")


class Reduction(Frozen):
    """A printed percentage by which `to` is less than `from`; negative for an increase."""

    model_config = ConfigDict(populate_by_name=False)

    before: Id = Field(alias="from")
    to: Id
    percent: Number
    of: Literal["mean", "median", "sd", "rmse", "participants"] = "mean"


_OF_ONE_TEST = {"W": "wilcoxon", "U": "mann_whitney", "H": "kruskal", "discordant": "mcnemar"}


class PrintedTest(Frozen):
    """A printed test: its statistic, degrees of freedom, p, and what the text says about it."""

    test: (
        Literal[
            "rm_anova",
            "t_paired",
            "wilcoxon",
            "friedman",
            "art_anova",
            "mixed_anova",
            "mixed_model",
            "mcnemar",
            "t_independent",
            "welch",
            "anova",
            "mann_whitney",
            "kruskal",
            "correlation",
        ]
        | None
    ) = None
    conditions: Names | None = None
    effect: str | None = None
    contrast: str | None = None
    n: Count | None = None
    t: Number | None = None
    F: Number | None = None
    chi2: Number | None = None
    z: Number | None = None
    r: Number | None = None
    H: Number | None = None
    W: Number | None = None
    U: Number | None = None
    discordant: tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]] | None = None
    partial_eta_squared: Number | None = None
    d: Number | None = None
    d_z: Number | None = None
    effect_r: Number | None = None
    df: Annotated[tuple[Number, ...], BeforeValidator(_listed)] = ()
    epsilon: Number | None = None
    p: PValue | None = None
    p_adjusted: PValue | None = None
    sides: Literal["1", "2"] | None = None
    method: Literal["exact", "normal"] | None = None
    significant: bool | None = None
    alpha: Number | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> PrintedTest:
        printed = [symbol for symbol in DEGREES_OF_FREEDOM if getattr(self, symbol) is not None]
        if len(printed) > 1:
            raise ValueError(f"has {' and '.join(printed)}; give each statistic a test of its own")
        for symbol in printed:
            needed = DEGREES_OF_FREEDOM[symbol]
            if len(self.df) not in (0, needed):
                raise ValueError(f"the statistic {symbol} has {needed} degrees of freedom, and df lists {len(self.df)}")
        for key, owner in _OF_ONE_TEST.items():
            if getattr(self, key) is not None and self.test != owner:
                raise ValueError(f"only test: {owner} has {'an' if key in 'HU' else 'a'} {key}")
        return self

    @property
    def statistic(self) -> tuple[Symbol, Rounded] | None:
        """The printed statistic that p follows from, if there is one."""
        return next(
            ((symbol, getattr(self, symbol)) for symbol in DEGREES_OF_FREEDOM if getattr(self, symbol) is not None),
            None,
        )


class Measure(Frozen):
    """The printed figures of one dependent variable. `measure` is the study's own name for it, if there is a study."""

    name: Id
    measure: Id | None = None
    n: Count | None = None
    scale: Annotated[Scale | None, BeforeValidator(_scale)] = None
    cells: Mapping[Id, Cell] = {}
    reductions: tuple[Reduction, ...] = ()
    tests: tuple[PrintedTest, ...] = ()

    @model_validator(mode="after")
    def _fits_together(self) -> Measure:
        for reduction in self.reductions:
            known("from", reduction.before, self.cells)
            known("to", reduction.to, self.cells)
        for test in self.tests:
            for condition in test.conditions or ():
                known("conditions", condition, self.cells)
        return self

    @property
    def between(self) -> bool:
        """Whether its conditions are groups of different participants."""
        return any(test.test in BETWEEN for test in self.tests)


class Total(Frozen):
    """A printed figure over several measures in one condition: `sum` over participants too, `mean` of the participants'
    sums, or `average` of the measures' means.
    """

    label: str
    measures: Names
    condition: Id
    sum: Number | None = None
    mean: Number | None = None
    average: Number | None = None

    @model_validator(mode="after")
    def _one_of(self) -> Total:
        if sum(figure is not None for figure in (self.sum, self.mean, self.average)) != 1:
            raise ValueError("needs one of sum, mean and average")
        return self

    @property
    def printed(self) -> Rounded:
        """The one of the three that is given."""
        (figure,) = (figure for figure in (self.sum, self.mean, self.average) if figure is not None)
        return figure


class Share(Frozen):
    """A printed percentage of a number of things; `count` is how many of them, where that is printed too."""

    label: str
    of: Count
    percent: Number
    count: Annotated[int, Field(ge=0)] | None = None


class Parts(Frozen):
    """Counts that add up to a printed total."""

    label: str
    parts: tuple[Annotated[int, Field(ge=0)], ...]
    total: Annotated[int, Field(ge=0)]


class Peak(Frozen):
    """The peak of the cross-correlation of two equally long signals, and the lag it is printed to stand for.

    `at` is its place, from 1 on, in the sequence of `of` lags, in whose middle the lag is zero.
    """

    label: str
    at: Count
    of: Count
    rate_hz: Number
    lag_s: Number

    @model_validator(mode="after")
    def _lies_within(self) -> Peak:
        if self.of % 2 == 0:
            raise ValueError("of: two signals of n samples have 2 n − 1 lags, an odd number")
        if self.at > self.of:
            raise ValueError(f"at: should be at most {self.of}, the number of lags")
        if self.rate_hz.value <= 0:
            raise ValueError("rate_hz: should be more than 0")
        return self


class Family(Frozen):
    """Tests that belong together; `adjust` is how the publication judged them, from p values printed unadjusted."""

    label: str
    measures: Names
    adjust: Literal["none", "holm", "bonferroni", "benjamini_hochberg"] = "none"


class PrintedAccuracy(Frozen):
    """What is printed of an estimator's error, beside what the study's recordings give for one of its estimators.

    `percent_below` is by how much its RMSE is printed to be below that of the estimator `than`.
    """

    estimator: Id
    label: str
    rmse_mm: Number | None = None
    sd_mm: Number | None = None
    percent_below: Number | None = None
    than: Id | None = None

    @model_validator(mode="after")
    def _says_than_what(self) -> PrintedAccuracy:
        if (self.percent_below is None) != (self.than is None):
            raise ValueError("accuracy: percent_below and than go together: by how much below which estimator")
        return self


class Publication(Frozen):
    """printed.yaml. `n` participants stand behind every mean and test unless it says otherwise.

    `note` says in the report what a reader should know of the figures and the study's own, such as why they differ.
    """

    source: str
    n: Count | None = None
    alpha: Number = Rounded.read("0.05")
    rounding: Literal["nearest", "cut_off"] = "nearest"
    sd: Literal["sample", "population"] = "sample"
    intervals: Literal["t", "any"] = "any"
    measures: tuple[Measure, ...] = ()
    accuracy: tuple[PrintedAccuracy, ...] = ()
    note: str = ""
    totals: tuple[Total, ...] = ()
    shares: tuple[Share, ...] = ()
    counts: tuple[Parts, ...] = ()
    peaks: tuple[Peak, ...] = ()
    families: tuple[Family, ...] = ()

    @model_validator(mode="after")
    def _fits_together(self) -> Publication:
        if not self.measures and not self.accuracy:
            listed = "measures" in self.model_fields_set
            raise ValueError("measures: needs one or more" if listed else '"measures" is missing')
        names = tuple(measure.name for measure in self.measures)
        unique("measures: name", names)
        for field, entries in (("totals", self.totals), ("families", self.families)):
            for entry in entries:
                for pattern in entry.measures:
                    if not any(matches(pattern, name) for name in names):
                        raise ValueError(f'{field}: there is no measure "{pattern}"{did_you_mean(pattern, names)}')
        for total in self.totals:
            for measure in self.named(total.measures):
                known(f'totals: condition of "{measure.name}"', total.condition, measure.cells)
        return self

    def named(self, patterns: tuple[str, ...]) -> list[Measure]:
        """The measures whose names fit, in the file's order."""
        return [measure for measure in self.measures if any(matches(pattern, measure.name) for pattern in patterns)]

    def n_of(self, measure: Measure, test: PrintedTest) -> int | None:
        """How many participants a test took, as far as the file says."""
        return test.n or measure.n or self.n

    def tests(self) -> Iterator[tuple[Measure, PrintedTest]]:
        """Every test with its measure."""
        return ((measure, test) for measure in self.measures for test in measure.tests)

    def as_read(self, rounding: Rounding) -> Publication:
        """The same figures, taken to be rounded in another way."""
        content = self.model_dump(by_alias=True, exclude_defaults=True)
        return Publication.model_validate(content, context={"rounding": rounding})


def matches(pattern: str, name: str) -> bool:
    """Whether a name matches a pattern, in which * stands for any text."""
    return re.fullmatch(".*".join(re.escape(piece) for piece in pattern.split("*")), name) is not None


def load_publication(path: Path) -> Publication:
    """A file of printed figures. Raises PipelineError, naming the file, the field, the fault and the remedy."""
    content: dict[str, Any] = read_yaml(path, as_text=True)
    publication = parse(Publication, content, path)
    return publication.as_read("cut_off") if publication.rounding == "cut_off" else publication
