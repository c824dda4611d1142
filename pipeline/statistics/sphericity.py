"""Sphericity: whether the differences between any two levels vary alike. Mauchly's test, and the corrections of F."""

from __future__ import annotations

import numpy as np

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.tails import chi2_above, f_above

NAMES = ("p_gg", "p_hf", "epsilon_gg", "epsilon_hf", "mauchly_w", "mauchly_p")


def sphericity(
    covariance: FloatArray, error_df: int, cells: int, statistic: float, df1: float, df2: float
) -> dict[str, float | None]:
    """ε of Greenhouse and Geisser (1959) and of Huynh and Feldt (1976), the p of F by each, and Mauchly's test.

    `covariance` (d, d) is that of the scores on d orthonormal contrasts within groups, with `error_df` degrees of
    freedom: participants less groups. None of it applies to a single contrast.
    """
    d = len(covariance)
    if d == 1:
        return dict.fromkeys(NAMES)
    relative = covariance / np.trace(covariance)
    gg = 1 / (d * float(np.sum(relative**2)))
    # Huynh and Feldt as corrected by Lecoutre (1991); without groups both are the same.
    room = error_df - d * gg
    hf = None  # with one degree of freedom there is one contrast, and 0 / 0
    if error_df > 1:
        hf = min(1.0, ((error_df + 1) * d * gg - 2) / (d * room)) if room > 0 else 1.0
    w = p = None
    if error_df >= d:
        w = float(np.linalg.det(relative * d))
        p = _mauchly_p(w, d, error_df, cells)
    return {
        "p_gg": f_above(statistic, gg * df1, gg * df2),
        "p_hf": None if hf is None else f_above(statistic, hf * df1, hf * df2),
        "epsilon_gg": gg,
        "epsilon_hf": hf,
        "mauchly_w": w,
        "mauchly_p": p,
    }


def _mauchly_p(w: float, d: int, df: int, cells: int) -> float | None:
    """χ² approximation to second order (Anderson 1958, section 10.7), as R's mauchly.test computes it.

    R puts the number of cells for d in one term of the second order; followed here, so that figures compare. The
    difference is below 1e-4.
    """
    if w <= 0:
        return None
    rho = 1 - (2 * d**2 + d + 2) / (6 * d * df)
    second = (d + 2) * (d - 1) * (d - 2) * (2 * d**3 + 6 * d**2 + 3 * cells + 2) / (288 * (df * d * rho) ** 2)
    statistic, freedom = -df * rho * np.log(w), d * (d + 1) / 2 - 1
    first = chi2_above(statistic, freedom)
    return float(first + second * (chi2_above(statistic, freedom + 4) - first))
