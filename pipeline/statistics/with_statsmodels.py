"""What statsmodels computes (Seabold and Perktold 2010), on plain arrays; imported, its warnings caught, only here.

Its answers equal R's in these tests. Data without an estimate are sorted out before; what does not converge is None.
"""

from __future__ import annotations

import gc
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray


def mcnemar_p(b: int, c: int) -> float:
    """Exact and two-sided, of the numbers of those who changed one way and the other."""
    with _quiet():
        from statsmodels.stats.contingency_tables import mcnemar

        return float(mcnemar([[0, b], [c, 0]], exact=True).pvalue)


def cochran_q(values: FloatArray) -> tuple[float, float]:
    """Q of answers 0 or 1 (n, k), and its p by χ²."""
    with _quiet():
        from statsmodels.stats.contingency_tables import cochrans_q

        result = cochrans_q(values)
    return float(result.statistic), float(result.pvalue)


def wilson_interval(yes: int, n: int) -> tuple[float, float]:
    """The 95 % score interval (Wilson 1927) of a share of `yes` among n answers."""
    with _quiet():
        from statsmodels.stats.proportion import proportion_confint

        low, high = proportion_confint(yes, n, method="wilson")
    # Of answers all alike it ends at them; statsmodels' sum misses it by a rounding, to either side.
    return 0.0 if yes == 0 else float(low), 1.0 if yes == n else float(high)


@dataclass(frozen=True)
class Estimated:
    """Log odds or log rates (k,), their covariances (k, k), corrected for few clusters and not, means, dispersion."""

    estimates: FloatArray
    covariance: FloatArray
    uncorrected: FloatArray
    means: FloatArray
    dispersion: float


def gee(
    outcome: FloatArray,
    clusters: IntArray,
    conditions: IntArray,
    levels: int,
    family: str,
    exposure: FloatArray | None = None,
) -> Estimated | None:
    """A mean for each of k conditions, independence being the working correlation; None where it did not converge.

    `family` is "logit" for answers 0 or 1 (N,), or "poisson" for counts; rows in the order of their clusters or not.
    """
    design = np.eye(levels)[conditions]
    with _quiet():
        import statsmodels.api as sm

        law = sm.families.Binomial() if family == "logit" else sm.families.Poisson()
        over = exposure if family == "poisson" else None
        model = sm.GEE(outcome, design, groups=clusters, family=law, exposure=over)
        try:
            fit = model.fit(cov_type="bias_reduced", maxiter=200)
        except (np.linalg.LinAlgError, ValueError):
            return None
    if not fit.converged:
        return None
    residuals = np.asarray(fit.resid_pearson)
    return Estimated(
        np.asarray(fit.params),
        np.asarray(fit.cov_robust_bc),
        np.asarray(fit.cov_robust),
        np.exp(fit.params) if family == "poisson" else 1 / (1 + np.exp(-np.asarray(fit.params))),
        float(np.sum(residuals**2) / (len(outcome) - levels)),
    )


def adjusted_p(p_values: Sequence[float], method: str) -> list[float]:
    """p values adjusted over all of them, by one of statsmodels' own names of methods."""
    with _quiet(), nothing_to_collect():
        from statsmodels.stats.multitest import multipletests

        return [float(p) for p in multipletests(p_values, method=method)[1]]


@contextmanager
def nothing_to_collect() -> Iterator[None]:
    """For calls that collect garbage: `multipletests` does so each time, and goes through 50 ms of other objects."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


@contextmanager
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
