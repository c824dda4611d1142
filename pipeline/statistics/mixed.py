"""Terms of a linear mixed model: from named columns to a design, from each term to the hypotheses that test it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import combinations, product
from typing import Any

import numpy as np

from pipeline.statistics import (
    ALIASED,
    ALL_ZERO,
    CONFOUNDED,
    NO_COMPLETE,
    NO_ERROR,
    NO_VARIATION,
    ONE_COMPLETE,
    TOO_FEW_VALUES,
)
from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.effect_size import partial_eta_squared_interval
from pipeline.statistics.random_intercept import PARTICIPANT, Rows
from pipeline.statistics.random_intercepts import Fitted, fitted, method_text
from pipeline.statistics.result import IntArray, Result, negligible
from pipeline.statistics.satterthwaite import Fit, degrees_of_freedom, f_test
from pipeline.statistics.tails import f_above, t_above, t_quantile


@dataclass(frozen=True)
class Factor:
    """A column of K levels: which of them each row has (N,)."""

    levels: tuple[str, ...]
    codes: IntArray

    @property
    def columns(self) -> FloatArray:
        """Indicators (N, K − 1) of all levels but the first: R's treatment contrasts."""
        indicators: FloatArray = (self.codes[:, None] == np.arange(1, len(self.levels))).astype(np.float64)
        return indicators


@dataclass(frozen=True)
class Covariate:
    """A column of numbers (N,)."""

    values: FloatArray

    @property
    def columns(self) -> FloatArray:
        """The numbers (N, 1)."""
        return self.values[:, None]


Column = Factor | Covariate


def mixed_model(
    values: FloatArray,
    participants: Sequence[str],
    columns: Mapping[str, Column],
    terms: Sequence[str],
    random: Mapping[str, IntArray] | None = None,
) -> list[Result]:
    """Test each term, a column's name or factors' names joined by ":", of values (N,) with all rows that there are.

    A term of one degree of freedom gives one row, its t; a larger one its F, and for a factor the t of every two of
    its levels. Estimates are first minus second level, averaged over the levels of the other factors; a covariate's
    is its slope. Effect size: the estimate, of an F partial η² (from F and its degrees of freedom).

    Beside (1 | participant) the model has a random intercept for each of `random`, by name which group each row is of
    (N,). Where participants have several rows in a condition it takes `cells_of`, as "participant:condition": without
    it the rows of a cell count as if each had met the condition anew. Intercepts without variance, or that the data
    cannot tell apart, are left out, and the method says so.
    """
    model = model_of(values, participants, columns, terms, random)
    fitted_model, exponent = model.fitted, model.exponent
    blank = Result("", "t", method_text(model.groupings), "estimate", len(set(participants)))
    if isinstance(fitted_model, str):
        return [replace(blank, effect=term, contrast=_contrast(columns, term), status=fitted_model) for term in terms]
    details = _shared_details(fitted_model.fit, len(values), exponent, model.rows.free)
    blank = replace(blank, method=method_text(model.groupings, fitted_model), details=details)
    results = [
        result for term in terms for result in _tested(fitted_model.fit, columns, terms, replace(blank, effect=term))
    ]
    return [_unscaled(result, exponent) for result in results]


@dataclass(frozen=True)
class Model:
    """Rows at unit scale (values · 2⁻ᵉ), the groups of each random intercept (N,), and the fit or why there is none."""

    rows: Rows
    exponent: int
    groupings: Mapping[str, IntArray]
    fitted: Fitted | str


def model_of(
    values: FloatArray,
    participants: Sequence[str],
    columns: Mapping[str, Column],
    terms: Sequence[str],
    random: Mapping[str, IntArray] | None = None,
) -> Model:
    """The fitted model of `mixed_model`."""
    people = {name: index for index, name in enumerate(dict.fromkeys(participants))}
    index = np.array([people[name] for name in participants], dtype=np.int64)
    (scaled,), exponent = at_unit_scale([values])
    rows = Rows(scaled, design(columns, terms, len(values)), index)
    groupings = {PARTICIPANT: index, **(random or {})}
    return Model(rows, exponent, groupings, _undefined(rows, columns) or fitted(rows, groupings))


def cells_of(participants: Sequence[str], condition: Factor) -> IntArray:
    """Which participant's which condition each row is of (N,): the groups of (1 | participant:condition)."""
    people = np.unique(np.asarray(participants), return_inverse=True)[1]
    cells: IntArray = people * len(condition.levels) + condition.codes
    return cells


def _shared_details(model: Fit, count: int, exponent: int, free: int) -> dict[str, Any]:
    """Details that every term shares, in the unit of the values."""
    variances = {name: _power(variance, 2 * exponent) for name, variance in model.variances.items()}
    return {
        "singular": bool(model.zero),
        "log_likelihood": model.log_likelihood - free * exponent * float(np.log(2)),
        "variance_participant": variances.get(PARTICIPANT),
        "variance_residual": _power(model.variance_residual, 2 * exponent),
        "variances": variances,
        "n_observations": count,
    }


def _power(value: float | None, exponent: int) -> float | None:
    """value · 2ᵉ; None beyond the largest number."""
    with np.errstate(over="ignore", under="ignore"):
        result = float(np.ldexp(value or 0.0, exponent))
    return result if np.isfinite(result) else None


def _unscaled(result: Result, exponent: int) -> Result:
    """A row in the values' own unit; an F and its η² have none."""
    if result.effect_size_name != "estimate":
        return result
    estimate, low, high, error = (
        _power(value, exponent) for value in (result.effect_size, result.ci_low, result.ci_high, result.details["se"])
    )
    return replace(result, effect_size=estimate, ci_low=low, ci_high=high, details={**result.details, "se": error})


def _undefined(rows: Rows, columns: Mapping[str, Column]) -> str | None:
    """Why nothing can be tested, or None."""
    people = len(rows.sizes)
    if people < 2:
        return ONE_COMPLETE if people else NO_COMPLETE
    mean_values, mean_design = rows.means
    within, design_within = rows.values - mean_values, rows.design - mean_design
    condition = columns["condition"].columns
    if not np.any(condition - (rows.sums(condition) / rows.sizes[rows.participants][:, None])):
        return CONFOUNDED
    terms, inside = rows.design.shape[1], int(np.linalg.matrix_rank(design_within))
    if np.linalg.matrix_rank(rows.design) < terms:
        return ALIASED
    if len(within) - people - inside < 1 or people + inside - terms < 1:
        return TOO_FEW_VALUES
    if negligible(float(np.sum(within**2)), rows.values):
        return NO_VARIATION if negligible(float(np.sum((mean_values - mean_values[0]) ** 2)), rows.values) else ALL_ZERO
    left = within - design_within @ np.linalg.lstsq(design_within, within, rcond=None)[0]
    return NO_ERROR if negligible(float(np.sum(left**2)), rows.values) else None


def design(columns: Mapping[str, Column], terms: Sequence[str], rows: int) -> FloatArray:
    """The intercept and each term's columns (N, p): products of its factors' indicators."""
    blocks = [np.ones((rows, 1))]
    for term in terms:
        parts = [columns[name].columns for name in term.split(":")]
        blocks.append(reduce(lambda first, second: (first[:, :, None] * second[:, None, :]).reshape(rows, -1), parts))
    return np.hstack(blocks)


def _contrast(columns: Mapping[str, Column], term: str) -> str | None:
    """What a row of one degree of freedom compares; None for a slope, an interaction or more than two levels."""
    column = columns.get(term)
    return " - ".join(column.levels) if isinstance(column, Factor) and len(column.levels) == 2 else None


def _tested(fitted: Fit, columns: Mapping[str, Column], terms: Sequence[str], blank: Result) -> list[Result]:
    """A term's rows."""
    term = blank.effect
    hypotheses = _hypotheses(columns, terms, term)
    if len(hypotheses) == 1:
        return [_t_row(fitted, hypotheses[0], replace(blank, contrast=_contrast(columns, term)))]
    rows = [_f_row(fitted, hypotheses, blank)]
    column = columns.get(term)
    if isinstance(column, Factor):
        # The hypotheses are first level minus each other one.
        means = np.vstack([np.zeros(hypotheses.shape[1]), -hypotheses])
        for i, j in combinations(range(len(column.levels)), 2):
            contrast = f"{column.levels[i]} - {column.levels[j]}"
            rows.append(_t_row(fitted, means[i] - means[j], replace(blank, contrast=contrast)))
    return rows


def _hypotheses(columns: Mapping[str, Column], terms: Sequence[str], term: str) -> FloatArray:
    """Combinations (q, p) of the coefficients that are zero if the term has no effect (type III).

    They are differences of the model's means over a grid of every combination of levels: of the term's factors the
    first level minus each other one, over the others the plain mean.
    """
    factors = {name: column for name, column in columns.items() if isinstance(column, Factor)}
    cells = np.array(list(product(*(range(len(factor.levels)) for factor in factors.values())))).astype(np.int64)
    grid: dict[str, Column] = {name: Covariate(np.zeros(len(cells))) for name in columns}
    grid |= {name: replace(factor, codes=cells[:, at]) for at, (name, factor) in enumerate(factors.items())}
    if isinstance(columns.get(term), Covariate):
        slope = design({**grid, term: Covariate(np.ones(len(cells)))}, terms, len(cells))
        return (slope - design(grid, terms, len(cells)))[:1]
    named = term.split(":")
    weights: FloatArray = np.ones((1, 1))
    for name, factor in factors.items():
        count = len(factor.levels)
        others = np.full((1, count), 1 / count)
        weights = np.kron(weights, np.eye(count)[0] - np.eye(count)[1:] if name in named else others)
    return weights @ design(grid, terms, len(cells))


def _t_row(fitted: Fit, hypothesis: FloatArray, blank: Result) -> Result:
    estimate = float(hypothesis @ fitted.coefficients)
    error = float(np.sqrt(hypothesis @ fitted.covariance @ hypothesis))
    df = degrees_of_freedom(fitted, hypothesis)
    margin = t_quantile(0.975, df) * error
    return replace(
        blank,
        statistic=estimate / error,
        df2=df,
        p=2 * t_above(abs(estimate) / error, df),
        effect_size=estimate,
        ci_low=estimate - margin,
        ci_high=estimate + margin,
        details={"se": error, **blank.details},
    )


def _f_row(fitted: Fit, hypotheses: FloatArray, blank: Result) -> Result:
    statistic, df1, df2 = f_test(fitted, hypotheses)
    low, high = partial_eta_squared_interval(statistic, df1, df2)
    details: dict[str, Any] = {"se": None, **blank.details}
    return replace(
        blank,
        statistic_name="F",
        statistic=statistic,
        df1=df1,
        df2=df2,
        p=f_above(statistic, df1, df2),
        effect_size_name="partial eta squared",
        effect_size=statistic * df1 / (statistic * df1 + df2),
        ci_low=low,
        ci_high=high,
        details=details,
    )
