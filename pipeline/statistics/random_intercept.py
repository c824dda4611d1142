"""The linear model with a random intercept for each participant, by restricted maximum likelihood, solved exactly.

With one variance ratio the likelihood has one dimension: y = Xβ + b + e, b ~ N(0, σ_b²) a participant, e ~ N(0, σ_e²)
a row, V = σ_e²I + σ_b²ZZᵀ. General optimisers stop early or fail on it, and their normal-theory p is too small for a
dozen people; here degrees of freedom are Satterthwaite's (1946), as lmerTest computes them (Kuznetsova et al. 2017).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import optimize

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray
from pipeline.statistics.satterthwaite import Fit

PARTICIPANT = "participant"

_RATIOS = np.concatenate([[0.0], np.logspace(-6, 25, 125)])  # of σ_b² to σ_e²: among them the search begins
_AT_ONCE = 2**18  # numbers of designs at several ratios, to stay within a processor's cache
_SINGULAR = 1e-8  # a ratio so small is zero, as in lme4


@dataclass(frozen=True)
class Rows:
    """Values (N,), their design (N, p) of full rank, and which of G participants, from 0, each row is of (N,)."""

    values: FloatArray
    design: FloatArray
    participants: IntArray

    @property
    def free(self) -> int:
        """N − p."""
        return len(self.values) - int(self.design.shape[1])

    @cached_property
    def sizes(self) -> FloatArray:
        """Rows of each participant (G,)."""
        return np.bincount(self.participants).astype(np.float64)

    @cached_property
    def means(self) -> tuple[FloatArray, FloatArray]:
        """Each row's mean over its participant, of the values and of the design."""
        sizes = self.sizes[self.participants]
        return self.sums(self.values) / sizes, self.sums(self.design) / sizes[:, None]

    def sums(self, columns: FloatArray) -> FloatArray:
        """ZZᵀA: each row's sum over its participant, for columns (N, …)."""
        total = np.zeros((len(self.sizes), *columns.shape[1:]))
        np.add.at(total, self.participants, columns)
        return total[self.participants]


def fit(rows: Rows) -> Fit:
    """The fit. Rows within and between participants must each leave a degree of freedom, or nothing determines it."""
    ratio = _variance_ratio(rows)
    criterion, solved = _profile(rows, ratio), _Solved(rows, ratio)
    if ratio == 0:
        derivatives, uncertainty = solved.derivatives[:1], np.array([[2 * solved.residual**2 / rows.free]])
    else:
        derivatives, uncertainty = solved.derivatives, 2 * np.linalg.inv(solved.curvature)
    return Fit(
        solved.coefficients,
        solved.covariance,
        derivatives,
        uncertainty,
        solved.residual,
        {PARTICIPANT: solved.participant},
        -criterion / 2,
    )


def _variance_ratio(rows: Rows) -> float:
    """σ_b² / σ_e² of the highest restricted likelihood: where its slope crosses zero next to the best of a grid."""
    together = max(1, _AT_ONCE // rows.design.size)
    parts = [_profiles(rows, _RATIOS[begin : begin + together]) for begin in range(0, len(_RATIOS), together)]
    lowest = int(np.argmin(np.concatenate(parts)))
    if lowest == 0 and _Solved(rows, 0.0).slope >= 0:
        return 0.0
    low, high = np.sqrt(_RATIOS[max(lowest - 1, 0)]), np.sqrt(_RATIOS[min(lowest + 1, len(_RATIOS) - 1)])

    def slope(root: float) -> float:
        return _Solved(rows, root**2).slope

    if slope(low) < 0 < slope(high):
        ratio = float(optimize.brentq(slope, low, high, xtol=1e-300, rtol=1e-14) ** 2)
        return ratio if ratio > _SINGULAR else 0.0
    # So large a ratio that round-off hides the slope; nothing but σ_b² depends on where exactly it is.
    minimum = optimize.minimize_scalar(lambda root: _profile(rows, root**2), bounds=(low, high), method="bounded")
    return float(minimum.x**2)


def _independent(rows: Rows, ratio: float | FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The values and the design less a part of their participant's mean: rows that are independent (Fuller and
    Battese 1973); and 1 + ratio · rows a participant (G,). Of ratios (r, 1) as many of each: (r, N), (r, N, p), (r, G).
    """
    stretch = 1 + ratio * rows.sizes
    part = (1 - stretch**-0.5)[..., rows.participants]
    mean_values, mean_design = rows.means
    return rows.values - part * mean_values, rows.design - part[..., None] * mean_design, stretch


def _profile(rows: Rows, ratio: float) -> float:
    """−2 log restricted likelihood of a ratio at its best σ_e²."""
    return float(_profiles(rows, np.array([ratio]))[0])


def _profiles(rows: Rows, ratios: FloatArray) -> FloatArray:
    """−2 log restricted likelihood of each ratio (r,) at its best σ_e², of a few rows in a tenth of the time."""
    values, design, stretch = _independent(rows, ratios[:, None])
    orthogonal, triangle = np.linalg.qr(design)
    column = values[..., None]
    squares = np.sum((column - orthogonal @ (orthogonal.transpose(0, 2, 1) @ column)) ** 2, axis=(1, 2))
    diagonal = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
    determinants = np.sum(np.log(stretch), axis=1) + 2 * np.sum(np.log(diagonal), axis=1)
    profiles: FloatArray = rows.free * (1 + np.log(2 * np.pi * squares / rows.free)) + determinants
    return profiles


class _Solved:
    """The model at one ratio of variances. P = V⁻¹ − V⁻¹X C XᵀV⁻¹, C = (XᵀV⁻¹X)⁻¹; G is I for σ_e², ZZᵀ for σ_b²."""

    def __init__(self, rows: Rows, ratio: float) -> None:
        self._rows = rows
        values, design, _ = _independent(rows, ratio)
        orthogonal, triangle = np.linalg.qr(design)
        inverse = np.linalg.inv(triangle)
        self.coefficients = inverse @ (orthogonal.T @ values)
        self.residual = float(np.sum((values - design @ self.coefficients) ** 2) / rows.free)
        self.participant = ratio * self.residual
        self.covariance = inverse @ inverse.T * self.residual
        self._total = self.residual + self.participant * rows.sizes
        weighted = self._weighted(rows.design)
        self._parts = (weighted, rows.sums(weighted))  # G V⁻¹X
        self._inner = np.stack([weighted.T @ part for part in self._parts])  # XᵀV⁻¹ G V⁻¹X
        score = self._weighted(rows.values - rows.design @ self.coefficients)
        self._moved = (score, rows.sums(score))  # G P y

    def _weighted(self, columns: FloatArray) -> FloatArray:
        """V⁻¹A of columns (N, …)."""
        share = (self.participant / self._total)[self._rows.participants]
        weighted: FloatArray = columns - share.reshape(-1, *[1] * (columns.ndim - 1)) * self._rows.sums(columns)
        return weighted / self.residual

    @property
    def slope(self) -> float:
        """Derivative of −2 log restricted likelihood in σ_b²: tr(PG) − yᵀPGPy."""
        trace = np.sum(self._rows.sizes / self._total) - np.trace(self.covariance @ self._inner[1])
        return float(trace - self._moved[0] @ self._moved[1])

    @property
    def derivatives(self) -> FloatArray:
        """Of the coefficients' covariance in σ_e² and σ_b² (2, p, p)."""
        return self.covariance @ self._inner @ self.covariance

    @property
    def curvature(self) -> FloatArray:
        """Second derivatives (2, 2) of −2 log restricted likelihood: −tr(P Gᵢ P Gⱼ) + 2 yᵀP Gᵢ P Gⱼ P y."""
        sizes, total = self._rows.sizes, self._total
        within, mixed, between = total**-2.0 + (sizes - 1) / self.residual**2, sizes / total**2, (sizes / total) ** 2
        traces = np.array([[within.sum(), mixed.sum()], [mixed.sum(), between.sum()]])
        weighted = [self._weighted(part) for part in self._parts]
        projected = [
            self._weighted(moved) - self._parts[0] @ self.covariance @ (self._parts[0].T @ moved)
            for moved in self._moved
        ]
        curvature = np.empty((2, 2))
        for i in range(2):
            for j in range(2):
                trace = traces[i, j] - 2 * np.trace(self.covariance @ self._parts[i].T @ weighted[j])
                trace += np.trace(self.covariance @ self._inner[i] @ self.covariance @ self._inner[j])
                curvature[i, j] = 2 * self._moved[i] @ projected[j] - trace
        return curvature
