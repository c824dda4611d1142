"""Figures of a mixed model that other programs derive from second derivatives of its likelihood.

The model is the one with an intercept for each participant: y = Xβ + u + e, with Var(u) = θ²σ² and Var(e) = σ², its
restricted likelihood as in Bates et al. (2015), Fitting linear mixed-effects models using lme4, eq. 36 to 42. Our own
standard errors and degrees of freedom come from closed forms instead; where data are unbalanced, or their scale is
extreme, that is not the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pipeline.analysis.against import ways
from pipeline.analysis.against.problems import Model, Problem
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mixed import design, mixed_model
from pipeline.statistics.result import Result

_ROWS_MAX = 500  # matrices of rows × rows, for each of some twenty derivatives
_STEP = 1e-4  # of a derivative, relative
_FLAT = 1e-8  # lmerTest takes an eigenvalue of this size for zero
_SAME_LIKELIHOOD = 1e-7

Likelihood = Callable[[FloatArray], float]


def of_observed_information(problem: Problem, theirs: ways.Figures, quantity: str) -> float | None:
    """Standard error and z of a coefficient from the information of coefficients and variance together.

    statsmodels inverts the matrix of all second derivatives. Ours, as lme4's, is that of generalized least squares,
    which takes the variances as known; in balanced data the two are the same.
    """
    data: Any = problem.data
    found = _alone(problem)
    if "df1" in theirs or found is None or data.levels is None or len(data.values) > _ROWS_MAX:
        return None
    result, ratio = found
    at = _column(data)
    x = design(data.columns, data.terms, len(data.values))
    beta = _least_squares(data, x, ratio)
    information = -_hessian(lambda point: _profiled(data, x, point[:-1], point[-1]), np.append(beta, ratio))
    se = float(np.sqrt(np.linalg.inv(information)[at, at]))
    return se if quantity == "se" else -float(result.effect_size or 0.0) / se


def where_it_is_flat(problem: Problem, theirs: ways.Figures, quantity: str) -> float | None:
    """The other program's figure, where lmerTest's second derivatives by θ and σ have an eigenvalue like zero.

    It leaves that direction out of the degrees of freedom, and its search may stop anywhere along it.
    """
    data: Any = problem.data
    found = _alone(problem)
    if "df1" not in theirs or found is None or len(data.values) > _ROWS_MAX:
        return None
    result, ratio = found
    own, other = result.details["log_likelihood"], theirs.get("log_likelihood")
    if other is None or abs(other.value - own) > _SAME_LIKELIHOOD * max(1.0, abs(own)):
        return None
    x = design(data.columns, data.terms, len(data.values))
    sigma = float(np.sqrt(result.details["variance_residual"]))
    hessian = _hessian(lambda point: _deviance(data, x, point[0], point[1]), np.array([np.sqrt(ratio), sigma]))
    flat = bool(np.min(np.abs(np.linalg.eigvalsh(hessian))) < _FLAT)
    return theirs[quantity].value if flat else None


def _alone(problem: Problem) -> tuple[Result, float] | None:
    """The row of the model with intercepts of participants alone, and its variance of them over the residual one."""
    data: Any = problem.data
    results = mixed_model(data.values, data.participants, data.columns, data.terms)
    (result,) = (one for one in results if (one.effect, one.contrast) == (data.term, problem.row["contrast"]))
    variances = result.details.get("variances", {})
    if not variances.get("participant") or not result.details.get("variance_residual"):
        return None
    return result, variances["participant"] / result.details["variance_residual"]


def _column(data: Model) -> int:
    """The place of the coefficient of the row's second level among the columns of the design."""
    before = data.terms[: list(data.terms).index(data.term)]
    second = 1 if data.levels is None else data.levels[1]
    return int(sum(data.columns[term].columns.shape[1] for term in before) + second)


def _covariance(data: Model, ratio: float) -> FloatArray:
    """Of the rows, over the residual variance (N, N)."""
    people = np.unique(np.asarray(data.participants), return_inverse=True)[1]
    return np.asarray(np.eye(len(people)) + ratio * (people[:, None] == people[None, :]))


def _least_squares(data: Model, x: FloatArray, ratio: float) -> FloatArray:
    weighted = np.linalg.solve(_covariance(data, ratio), np.column_stack([x, data.values]))
    return np.asarray(np.linalg.solve(x.T @ weighted[:, :-1], x.T @ weighted[:, -1]), dtype=np.float64)


def _parts(data: Model, x: FloatArray, beta: FloatArray, ratio: float) -> tuple[float, float]:
    """log |V| + log |X'V⁻¹X|, and the weighted squares of the residuals."""
    v = _covariance(data, ratio)
    residuals = data.values - x @ beta
    weighted = np.linalg.solve(v, np.column_stack([x, residuals]))
    logs = np.linalg.slogdet(v)[1] + np.linalg.slogdet(x.T @ weighted[:, :-1])[1]
    return float(logs), float(residuals @ weighted[:, -1])


def _profiled(data: Model, x: FloatArray, beta: FloatArray, ratio: float) -> float:
    """The restricted log-likelihood with the residual variance at its best, less what is constant."""
    logs, squares = _parts(data, x, beta, ratio)
    return float(-((len(x) - x.shape[1]) * np.log(squares) + logs) / 2)


def _deviance(data: Model, x: FloatArray, theta: float, sigma: float) -> float:
    """−2 times the restricted log-likelihood, the coefficients being at their best, less what is constant."""
    logs, squares = _parts(data, x, _least_squares(data, x, theta**2), theta**2)
    return float(2 * (len(x) - x.shape[1]) * np.log(sigma) + logs + squares / sigma**2)


def _hessian(function: Likelihood, at: FloatArray) -> FloatArray:
    """Second derivatives by central differences."""
    steps = np.diag(_STEP * np.where(at == 0, 1.0, np.abs(at)))
    size = len(at)
    found = np.empty((size, size))
    for i in range(size):
        for j in range(size):
            corners = (function(at + a * steps[i] + b * steps[j]) * a * b for a in (1, -1) for b in (1, -1))
            found[i, j] = sum(corners) / (4 * steps[i, i] * steps[j, j])
    return found
