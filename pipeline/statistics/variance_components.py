"""The linear model with several random intercepts, nested or crossed, by restricted maximum likelihood.

Theory of operation. y = Xβ + Σ Zₖuₖ + e with uₖ ~ N(0, σₖ²), e ~ N(0, σ²); Z = [Z₁ Z₂ …] (N, q), τₖ = σₖ² / σ² and
Θ the diagonal (q, q) of each column's τ. Restricted likelihood is the likelihood of what is left of y beside X. So X is
projected out of y and Z once, and only A = ZᵀZ (q, q) and b = Zᵀy of the projected remain:

    deviance(τ) = log|I + ΘA| + (N − p) log r² + constant,   r² = yᵀ(I + ZΘZᵀ)⁻¹y,   T = (I + AΘ)⁻¹

The rows (N) are met again only in r², as the penalised residual sum of squares, whose terms are all positive. After a
grid and a quasi-Newton search for τ, Newton's steps on the variances themselves bring the gradient to zero; their
second derivatives are what Satterthwaite's degrees of freedom need. A random intercept whose variance is estimated as
zero is left out (what is fitted is then the model without it), and so is one that the data cannot tell from another or
from the residual.

statsmodels' MixedLM is not used: where it says it converged (case mm_slope, powell) its t is .85524 for .85665, its p
is from the normal distribution, and crossed intercepts take N² memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from scipy import optimize

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray
from pipeline.statistics.satterthwaite import Fit

_STARTS = (0.01, 0.1, 0.5, 2.0, 10.0)  # of τ
_SINGULAR = 1e-8  # a τ so small is zero, as in lme4
_TRACE = 1e-3  # so small a τ may be what the search stopped at on its way to zero
_SAME_DEVIANCE = 1e-8
_LARGEST = 1e12
_DISTINCT = 1e-8  # of the least eigenvalue of the variances' correlations: below, two of them are one
_STEPS = 50


@dataclass(frozen=True)
class Problem:
    """Values (N,), their design (N, p) of full rank, and for each random intercept which group each row is of (N,)."""

    values: FloatArray
    design: FloatArray
    groupings: Mapping[str, IntArray]

    @property
    def free(self) -> int:
        """N − p."""
        return len(self.values) - int(self.design.shape[1])

    @cached_property
    def triangular(self) -> tuple[FloatArray, FloatArray]:
        """Q (N, p) and R (p, p) of the design."""
        orthogonal, triangle = np.linalg.qr(self.design)
        return orthogonal, triangle

    def projected(self, columns: FloatArray) -> FloatArray:
        """Columns (N, …) less what the design explains of them."""
        orthogonal, _ = self.triangular
        result: FloatArray = columns - orthogonal @ (orthogonal.T @ columns)
        return result

    def without(self, names: set[str]) -> Problem:
        """The model without some of its random intercepts."""
        return Problem(
            self.values, self.design, {name: codes for name, codes in self.groupings.items() if name not in names}
        )


def distinct(problem: Problem) -> tuple[Problem, list[str]]:
    """The model with the random intercepts that these data can tell apart, and the names of the others.

    One that is a function of the fixed effects, or has a group for every row, leaves nothing of its own.
    """
    identifiable: dict[str, IntArray] = {}
    for name, codes in problem.groupings.items():
        tried = Problem(problem.values, problem.design, {**identifiable, name: codes})
        if np.linalg.eigvalsh(_correlations(_Matrices(tried)))[0] > _DISTINCT:
            identifiable[name] = codes
    left_out = [name for name in problem.groupings if name not in identifiable]
    return problem.without(set(left_out)), left_out


def _correlations(matrices: _Matrices) -> FloatArray:
    """Of the variances' information at τ = 0, the residual's first: how alike two of them are."""
    parts, inner = matrices.parts, matrices.inner
    size = len(parts) + 1
    information = np.empty((size, size))
    information[0, 0] = matrices.free
    for i, first_part in enumerate(parts):
        information[0, i + 1] = information[i + 1, 0] = np.trace(inner[first_part, first_part])
        for j, second_part in enumerate(parts):
            information[i + 1, j + 1] = np.sum(inner[first_part, second_part] ** 2)
    spread = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    if np.any(np.diag(information) < _DISTINCT):
        return np.zeros((1, 1))  # an intercept that the fixed effects explain
    correlations: FloatArray = information / np.outer(spread, spread)
    return correlations


class _Matrices:
    """What of a problem does not depend on the variances; `parts` are each random intercept's columns of Z."""

    def __init__(self, problem: Problem) -> None:
        self.free = problem.free
        blocks = [(codes[:, None] == np.unique(codes)).astype(np.float64) for codes in problem.groupings.values()]
        edges = np.cumsum([0, *(block.shape[1] for block in blocks)])
        self.parts = [slice(int(low), int(high)) for low, high in pairwise(edges)]
        self.design = np.hstack([np.zeros((len(problem.values), 0)), *blocks])
        self.columns = problem.projected(self.design)
        self.values = problem.projected(problem.values)
        self.inner = self.columns.T @ self.columns
        self.along = self.columns.T @ self.values
        self.fixed = problem.triangular[0].T @ self.design
        self.sizes = [part.stop - part.start for part in self.parts]


class _Solved:
    """The model at one τ for each random intercept."""

    def __init__(self, matrices: _Matrices, ratios: FloatArray) -> None:
        self._at = matrices
        self.theta = np.repeat(ratios, matrices.sizes)
        q = len(self.theta)
        self.inverse = np.linalg.inv(np.eye(q) + matrices.inner * self.theta)  # T
        self.scores = self.inverse @ matrices.along  # Tb
        self.effects = self.theta * self.scores
        self.residuals = matrices.values - matrices.columns @ self.effects
        self.squares = float(self.residuals @ self.residuals + self.effects @ self.scores)
        self.weighted = self.inverse @ matrices.inner  # TA

    @property
    def deviance(self) -> float:
        """−2 log restricted likelihood, without its constants."""
        return float(self._at.free * np.log(self.squares) - np.linalg.slogdet(self.inverse)[1])

    @property
    def slope(self) -> FloatArray:
        """Derivatives of the deviance in each τ."""
        return np.array(
            [
                np.trace(self.weighted[part, part])
                - self._at.free * float(self.scores[part] @ self.scores[part]) / self.squares
                for part in self._at.parts
            ]
        )

    def derivatives(self, residual: float) -> tuple[FloatArray, FloatArray]:
        """First and second derivatives (m,), (m, m) of the deviance in σ², σ₁², …: tr(PGᵢ) − yᵀPGᵢPy and
        −tr(PGᵢPGⱼ) + 2yᵀPGᵢPGⱼPy, with G₀ = I and Gₖ = ZₖZₖᵀ."""
        parts, at = self._at.parts, self._at
        twice = self.weighted @ self.inverse.T  # TATᵀ
        again = self.inverse @ self.scores
        moved = self.residuals - at.columns @ (self.theta * (self.inverse @ (at.columns.T @ self.residuals)))
        extra = at.free - len(self.theta)
        first = np.empty(len(parts) + 1)
        second = np.empty((len(parts) + 1, len(parts) + 1))
        first[0] = (extra + np.trace(self.inverse)) / residual - self.residuals @ self.residuals / residual**2
        second[0, 0] = -(extra + np.sum(self.inverse * self.inverse.T)) / residual**2
        second[0, 0] += 2 * (self.residuals @ moved) / residual**3
        for i, part in enumerate(parts, start=1):
            first[i] = np.trace(self.weighted[part, part]) / residual - np.sum(self.scores[part] ** 2) / residual**2
            second[0, i] = second[i, 0] = -np.trace(twice[part, part]) / residual**2
            second[0, i] = second[i, 0] = second[0, i] + 2 * (again[part] @ self.scores[part]) / residual**3
            for j, other_part in enumerate(parts, start=1):
                block = self.weighted[part, other_part]
                second[i, j] = -np.sum(block**2) / residual**2
                second[i, j] += 2 * (self.scores[part] @ block @ self.scores[other_part]) / residual**3
        return first, second


def fit(problem: Problem) -> Fit | None:
    """The fit, with variances of zero where an intercept was left out for it; None where no maximum was found."""
    matrices = _Matrices(problem)
    ratios = _highest(matrices)
    zero = {name for name, ratio in zip(problem.groupings, ratios, strict=True) if ratio <= _SINGULAR}
    if zero:
        reduced = fit(problem.without(zero))
        if reduced is None:
            return None
        variances = {name: reduced.variances.get(name, 0.0) for name in problem.groupings}
        return Fit(**{**vars(reduced), "variances": variances})
    polished = _polished(matrices, ratios)
    return None if polished is None else _fitted(problem, matrices, polished)


def _highest(matrices: _Matrices) -> FloatArray:
    """The τ of the lowest deviance: the best of a grid, then a quasi-Newton search in log τ, then zero where that is
    lower still."""
    count = len(matrices.parts)
    if not count:
        return np.zeros(0)
    grid = [np.array(ratios) for ratios in product((0.0, *_STARTS), repeat=count)]
    start = min(grid, key=lambda ratios: _Solved(matrices, ratios).deviance)

    def criterion(roots: FloatArray) -> tuple[float, FloatArray]:
        solved = _Solved(matrices, roots**2)
        return solved.deviance, 2 * roots * solved.slope

    roots = np.sqrt(start)
    for _ in range(_STEPS):
        bounds = [(0.0, np.sqrt(_LARGEST))] * count
        search = optimize.minimize(criterion, roots, jac=True, method="L-BFGS-B", bounds=bounds)
        roots = np.asarray(search.x)
        # At a root of zero the slope in the root is zero too; whether the variance should rise is in that of τ.
        rising = (roots**2 <= _SINGULAR) & (_Solved(matrices, np.where(roots**2 <= _SINGULAR, 0, roots**2)).slope < 0)
        if not np.any(rising):
            break
        roots = np.where(rising, 0.01, roots)
    return _without_traces(matrices, roots**2)


def _without_traces(matrices: _Matrices, ratios: FloatArray) -> FloatArray:
    """Zero for a τ that the search left just above it, where the deviance is no higher there but for round-off."""
    for place in np.flatnonzero((ratios > _SINGULAR) & (ratios < _TRACE)):
        at_zero = np.where(np.arange(len(ratios)) == place, 0.0, ratios)
        if _Solved(matrices, at_zero).deviance <= _Solved(matrices, ratios).deviance + _SAME_DEVIANCE:
            ratios = at_zero
    return ratios


def _polished(matrices: _Matrices, ratios: FloatArray) -> FloatArray | None:
    """Newton's steps from the search's τ to where the deviance's gradient in σ², σ₁², … is zero; None if that fails."""
    residual = _Solved(matrices, ratios).squares / matrices.free
    variances: FloatArray = np.array([residual, *(ratios * residual)])
    for _ in range(_STEPS):
        first, second = _Solved(matrices, variances[1:] / variances[0]).derivatives(variances[0])
        try:
            # In log variances, so that large and small ones count alike.
            curvature = second * np.outer(variances, variances)
            step = np.linalg.solve(curvature, -first * variances)
            if np.linalg.eigvalsh(curvature)[0] <= 0:
                return None
        except np.linalg.LinAlgError:
            return None
        variances *= 1 + np.clip(step, -0.5, 0.5)
        if np.max(np.abs(step)) < 1e-11:
            return variances
    return variances if np.max(np.abs(step)) < 1e-7 else None


def _fitted(problem: Problem, matrices: _Matrices, variances: FloatArray) -> Fit:
    residual, ratios = float(variances[0]), variances[1:] / variances[0]
    solved = _Solved(matrices, ratios)
    orthogonal, triangle = problem.triangular
    inverse = np.linalg.inv(triangle)

    def of_coefficients(inner: FloatArray) -> FloatArray:
        result: FloatArray = inverse @ inner @ inverse.T
        return result

    fixed, p = matrices.fixed, len(triangle)
    spread = solved.theta[:, None] * solved.inverse  # ΘT
    through = fixed @ spread  # what the coefficients' covariance owes to the intercepts'
    derivatives = [of_coefficients(np.eye(p) + through @ matrices.inner @ through.T)]
    for part in matrices.parts:
        columns = fixed @ solved.inverse.T[:, part]
        derivatives.append(of_coefficients(columns @ columns.T))
    _, second = solved.derivatives(residual)
    constant = matrices.free * (1 + np.log(2 * np.pi / matrices.free)) + 2 * np.sum(np.log(np.abs(np.diag(triangle))))
    return Fit(
        coefficients=inverse @ (orthogonal.T @ (problem.values - matrices.design @ solved.effects)),
        covariance=residual * of_coefficients(np.eye(p) + through @ fixed.T),
        derivatives=np.stack(derivatives),
        uncertainty=np.linalg.inv(second / 2).astype(np.float64),
        variance_residual=residual,
        variances=dict(zip(problem.groupings, (float(variance) for variance in variances[1:]), strict=True)),
        log_likelihood=float(-(solved.deviance + constant) / 2),
    )
