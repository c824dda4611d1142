"""What an analysis of variance or a mixed model leaves unexplained, whose normality it assumes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.statistics.anova import contrasts
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mixed import Column, model_of
from pipeline.statistics.result import IntArray, from_first


def of_effect(values: FloatArray, effect: tuple[int, ...], codes: IntArray | None = None) -> FloatArray:
    """The errors (n, c) against which an effect within participants is tested, of values (n, k₁, k₂, …).

    What the effect's contrasts see of each participant, less the mean of the participant's group (`codes`) or of all,
    as deviations of the cells of the effect's factors. One contrast alone gives one number each (n, 1), that of the
    effect's first cell, since the others are the same but for the sign.
    """
    n, levels = values.shape[0], values.shape[1:]
    seen = contrasts(levels, effect)
    scores = from_first(values.reshape(n, -1)) @ seen
    outside = tuple(place + 1 for place in range(len(levels)) if place not in effect)
    cells: FloatArray = (in_groups(scores, codes) @ seen.T).reshape(values.shape).mean(axis=outside).reshape(n, -1)
    return cells[:, :1] if seen.shape[1] == 1 else cells


def in_groups(values: FloatArray, codes: IntArray | None = None) -> FloatArray:
    """Values (n, …) less the mean of their group, of groups 0 … (n,); less the mean of all without groups."""
    groups = np.zeros(len(values), dtype=np.int64) if codes is None else codes
    apart = np.empty_like(values)
    for code in np.unique(groups):
        apart[groups == code] = values[groups == code] - values[groups == code].mean(axis=0)
    return apart


def of_mixed_model(
    values: FloatArray,
    participants: Sequence[str],
    columns: Mapping[str, Column],
    terms: Sequence[str],
    random: Mapping[str, IntArray] | None = None,
) -> FloatArray | None:
    """Values (N,) less what the fixed terms and the predicted random intercepts say of them; None without a fit.

    Arguments as for `mixed_model`. The intercepts are the best linear unbiased predictions, by Henderson's equations
    at the estimated variances (Robinson 1991).
    """
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    model = model_of(values, participants, columns, terms, random)
    if isinstance(model.fitted, str):
        return None
    fit, left = model.fitted.fit, model.rows.values - model.rows.design @ model.fitted.fit.coefficients
    blocks, ratios = [], []
    for name, variance in fit.variances.items():
        if variance > 0:
            codes = np.unique(model.groupings[name], return_inverse=True)[1]
            count = int(codes.max()) + 1
            blocks.append(sparse.csr_matrix((np.ones(len(codes)), (np.arange(len(codes)), codes)), (len(codes), count)))
            ratios.append(np.full(count, fit.variance_residual / variance))
    if blocks:
        groups = sparse.hstack(blocks).tocsc()
        predicted = spsolve((groups.T @ groups + sparse.diags(np.concatenate(ratios))).tocsc(), groups.T @ left)
        left = left - groups @ predicted
    residuals: FloatArray = np.ldexp(left, model.exponent)
    return residuals
