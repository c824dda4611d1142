"""The values whose normality the study's comparisons assume: differences, residuals, and members of groups."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pipeline.analysis import complete_cases, groups, model_rows
from pipeline.analysis.comparison_rows import tested
from pipeline.analysis.complete_cases import CompleteCases, Request
from pipeline.analysis.ratios import on_logarithms
from pipeline.analysis.within_tests import random_intercepts
from pipeline.statistics import pairs, residuals
from pipeline.statistics.anova import effect_name, effects_of
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mixed import Factor
from pipeline.statistics.normal_quantiles import normal_quantiles
from pipeline.statistics.result import IntArray, rounded_differences
from pipeline.tables.table import Row

OF_DIFFERENCES, OF_RESIDUALS, OF_GROUP = "differences", "residuals", "group"
"""What a sample is made of."""


@dataclass(frozen=True)
class Sample:
    """Values that a test takes as normal: what they are (`kind`, of what), whose, and in which cell of a design."""

    kind: str
    of: str
    values: FloatArray
    participants: Sequence[str]
    cells: Sequence[str | None]


def normality_rows(requests: Iterable[Request]) -> list[Row]:
    """A row for each value, beside the normal quantile of its rank; each sample once, however many tests take it."""
    rows: list[Row] = []
    seen: set[tuple[str, str, str, str, bool]] = set()
    for request in requests:
        for sample in _samples(request):
            whose = request.entry.test if sample.kind == OF_RESIDUALS else ""
            name = (request.measure, whose, sample.kind, sample.of, on_logarithms(request))
            if name not in seen:
                seen.add(name)
                rows += _rows(request, sample)
    return rows


def _samples(request: Request) -> Iterator[Sample]:
    make = _SAMPLES.get(request.entry.test)
    if make is not None and not (on_logarithms(request) and _has_no_logarithm(request)):
        yield from make(request)


def _has_no_logarithm(request: Request) -> bool:
    values = request.measures.loc[request.measures["measure"] == request.measure, "value"]
    return bool((values <= 0).any())


def _rows(request: Request, sample: Sample) -> Iterator[Row]:
    beside = normal_quantiles(sample.values)
    if beside is None:
        return
    columns = (sample.participants, sample.cells, sample.values, *vars(beside).values())
    for person, cell, value, standardised, quantile, low, high in zip(*columns, strict=True):
        yield {
            "measure": request.measure,
            "test": request.entry.test,
            "kind": sample.kind,
            "of": sample.of,
            "logarithms": int(on_logarithms(request)),
            "participant": str(person),
            "cell": cell,
            "value": float(value),
            "standardised": float(standardised),
            "quantile": float(quantile),
            "band_low": float(low),
            "band_high": float(high),
            "outside": int(not low <= standardised <= high),
        }


def _scaled(request: Request, values: FloatArray) -> FloatArray:
    """Values as they are tested: their logarithms, where the entry asks for these."""
    logs: FloatArray = np.log(values) if on_logarithms(request) else values
    return logs


def _difference(request: Request, pair: pairs.Pair, people: Sequence[str]) -> Sample:
    values = rounded_differences(*tested(request, pair))
    return Sample(OF_DIFFERENCES, pair.contrast, values, people, [None] * len(people))


def _of_pairs(request: Request) -> Iterator[Sample]:
    cases = complete_cases.by_condition(request)
    for pair in pairs.of_conditions(cases.values, cases.levels[0]):
        yield _difference(request, pair, cases.participants)


def _of_rm_anova(request: Request) -> Iterator[Sample]:
    """Of two conditions their differences; else the residuals of each effect, and the differences that follow up."""
    cases = complete_cases.by_factors_of(request)
    if cases.values.shape[1:] == (2,):
        yield from _of_pairs(request)
        return
    yield from _of_effects(request, cases, request.entry.within)
    if request.entry.follow_up != "none":
        for pair in pairs.follow_ups(cases.values, request.entry.within, cases.levels):
            yield _difference(request, pair, cases.participants)


def _of_effects(
    request: Request, cases: CompleteCases, factors: Sequence[str], codes: IntArray | None = None
) -> Iterator[Sample]:
    """The residuals of each effect within participants."""
    if not len(cases.values):
        return
    for effect in effects_of(cases.values.shape[1:]):
        left = residuals.of_effect(_scaled(request, cases.values), effect, codes)
        cells = [", ".join(names) for names in product(*(cases.levels[place] for place in effect))]
        yield _residuals(effect_name(factors, effect), left, cases.participants, cells[: left.shape[1]])


def _residuals(of: str, left: FloatArray, participants: Sequence[str], cells: Sequence[str]) -> Sample:
    """Residuals (n, c); a single one of each participant is of no cell."""
    people = [person for person in participants for _ in cells]
    where: list[str | None] = [None] * len(people) if len(cells) == 1 else [*cells] * len(participants)
    return Sample(OF_RESIDUALS, of, left.ravel(), people, where)


def _of_mixed_anova(request: Request) -> Iterator[Sample]:
    """The residuals of participants' means within their groups, and of each effect within participants."""
    cases = groups.mixed(request)
    n = len(cases.values)
    means = _scaled(request, cases.values).reshape(n, -1).mean(axis=1) if n else np.array([])
    left = residuals.in_groups(means, cases.codes)
    yield Sample(OF_RESIDUALS, cases.factor, left, cases.participants, [None] * n)
    within = CompleteCases(cases.values, cases.participants, cases.levels, [])
    yield from _of_effects(request, within, request.entry.within, cases.codes)


def _of_groups(request: Request) -> Iterator[Sample]:
    cases = groups.by_group(request)
    for name, values, people in zip(cases.names, cases.groups, cases.members, strict=True):
        yield Sample(OF_GROUP, f"{cases.factor}: {name}", _scaled(request, values), people, [None] * len(people))


def _of_crossover(request: Request) -> Iterator[Sample]:
    """The residuals, within the sequences, of the differences (treatment, period) and of the sums (carry-over)."""
    cases = model_rows.of_crossover(request)
    first, second = cases.values.T if len(cases.values) else (np.array([]), np.array([]))
    codes = np.array(cases.first_came_first, dtype=np.int64)
    for effects, values in (("treatment, period", first - second), ("carry-over", first + second)):
        left = residuals.in_groups(values, codes)
        yield Sample(OF_RESIDUALS, effects, left, cases.participants, [None] * len(left))


def _of_mixed_model(request: Request) -> Iterator[Sample]:
    model = model_rows.of_model(request)
    values = _scaled(request, model.values)
    left = residuals.of_mixed_model(values, model.participants, model.columns, model.terms, random_intercepts(model))
    condition = model.columns["condition"]
    if left is not None and isinstance(condition, Factor):
        cells = [condition.levels[code] for code in condition.codes]
        yield Sample(OF_RESIDUALS, ", ".join(model.terms), left, model.participants, cells)


_SAMPLES: Mapping[str, Callable[[Request], Iterator[Sample]]] = {
    "t_paired": _of_pairs,
    "tost": _of_pairs,
    "bayes_t": _of_pairs,
    "rm_anova": _of_rm_anova,
    "mixed_anova": _of_mixed_anova,
    "mixed_model": _of_mixed_model,
    "crossover": _of_crossover,
    "t_welch": _of_groups,
    "anova_welch": _of_groups,
}
"""What each test assumes to be normal; ranks, answers and counts need not be."""
