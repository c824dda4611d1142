"""Covariances of readings under the paper's prior: each a polynomial of the lag times exp(−inverse_scale·lag²)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray
from fusion_core.sensors import Term

IntArray = npt.NDArray[np.int64]
_POSITION = (Term(1.0),)


class Covariances(NamedTuple):
    """The terms whose sum is the covariance of two readings, for each pair of s sensors; the last is the position."""

    inverse_scale_s2: float
    begins: IntArray  # (s, s + 1): those of sensors i and j are begins[i, j] : begins[i, j + 1]
    shift_s: FloatArray  # (terms,): what is added to the lag
    polynomial: FloatArray  # (terms, 5): coefficients of its rising powers, in the units of the two readings
    shared: FloatArray  # (s,): variance of the bias that all readings of a sensor share


def covariances(
    sensors: Sequence[Sequence[Term]], signal_variance_mm2: float, inverse_scale_s2: float, shared: Sequence[float]
) -> Covariances:
    """The covariances of sensors that each observe a sum of terms: eqs. (3) and (10) of the paper."""
    observed = [*sensors, _POSITION]
    begins = np.zeros((len(observed), len(observed) + 1), np.int64)
    shifts: list[float] = []
    polynomials: list[FloatArray] = []
    for i, j in product(range(len(observed)), repeat=2):
        begins[i, j] = len(shifts)
        for own, other in product(observed[i], observed[j]):
            weight = own.weight * other.weight * (-1) ** other.derivative * signal_variance_mm2
            shifts.append(own.at_s - other.at_s)
            polynomials.append(weight * _polynomial(own.derivative + other.derivative, inverse_scale_s2))
        begins[i, j + 1] = len(shifts)
    return Covariances(
        float(inverse_scale_s2), begins, np.array(shifts), np.array(polynomials), np.array([*shared, 0.0])
    )


def _polynomial(order: int, inverse_scale_s2: float) -> FloatArray:
    """p with dᵒʳᵈᵉʳ/dtᵒʳᵈᵉʳ exp(−w t²) = p(t)·exp(−w t²), (5,): each derivative makes p′ − 2wt·p of p."""
    polynomial = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    for _ in range(order):
        slope = np.append(np.arange(1, 5) * polynomial[1:], 0.0)
        polynomial = slope - 2 * inverse_scale_s2 * np.append(0.0, polynomial[:-1])
    return polynomial


@compiled(inner=True)
def covariance(
    inverse_scale_s2: float,
    begins: IntArray,
    shift_s: FloatArray,
    polynomial: FloatArray,
    shared: FloatArray,
    own: int,
    other: int,
    lag: float,
) -> float:
    """Covariance of a reading of sensor `own` with one of sensor `other` taken `lag` s before it; without the noise.

    cov(f⁽ⁱ⁾(t), f⁽ʲ⁾(t')) = (−1)ʲ k⁽ⁱ⁺ʲ⁾(t − t') with k of eq. (3), without a factor ½: exact in place of the paper's
    second difference (18). Takes the fields of `Covariances` one by one: handing on the whole costs ten times as much.
    """
    total = shared[own] if own == other else 0.0
    for term in range(begins[own, other], begins[own, other + 1]):
        t = lag + shift_s[term]
        factor = polynomial[term, 4]
        for power in range(3, -1, -1):
            factor = factor * t + polynomial[term, power]
        total += factor * np.exp(-inverse_scale_s2 * t * t)
    return total
