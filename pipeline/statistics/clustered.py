"""Errors and counts of many trials per participant: generalized estimating equations with participants as clusters.

Each condition has a mean on the scale of the link (log odds of an error, log rate of events), and differences between
conditions are ratios. How a person's trials depend on each other is not modelled but allowed for: standard errors come
from how much the participants' own residuals add up (Liang and Zeger 1986), corrected for few participants (Mancl and
DeRouen 2001), and t has as many degrees of freedom as there are participants less conditions. So counts may vary more
than a Poisson distribution allows, as with a negative binomial one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from scipy import stats

from pipeline.statistics import (
    NO_ERROR,
    NO_VARIATION,
    NOT_BINARY,
    NOT_CONVERGED,
    NOT_COUNTS,
    NOT_EXPOSED,
    ONE_LEVEL,
    SEPARATED,
    TOO_FEW_VALUES,
    with_statsmodels,
)
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray, Result, too_few
from pipeline.statistics.tails import f_above, t_above, t_quantile
from pipeline.statistics.with_statsmodels import Estimated

Family = Literal["logit", "poisson"]
_METHODS = {
    "logit": "logistic GEE, participants as clusters, Mancl-DeRouen standard errors, t",
    "poisson": "Poisson GEE (log rate), participants as clusters, Mancl-DeRouen standard errors, t",
}
_RATIOS = {"logit": "odds ratio", "poisson": "rate ratio"}
_NO_SPREAD = 1e-18  # variance of a log ratio below which everybody's trials came out alike
EACH_PAIR = "no effect size of more than two conditions: each pair has its own"


@dataclass(frozen=True)
class Trials:
    """One row per trial (N,): outcome, participant, condition; for counts also the time or number of chances."""

    outcome: FloatArray
    participants: Sequence[str]
    conditions: IntArray
    exposure: FloatArray | None = None


def gee(trials: Trials, levels: Sequence[str], family: Family, effect: str = "condition") -> list[Result]:
    """Test a condition's effect on errors (0 or 1, `logit`) or counts (`poisson`) of all trials that there are.

    Two conditions give one row, t; more give their F, then the t of every two. Effect size: the odds ratio or rate
    ratio, first over second condition, with its interval.
    """
    people = {name: index for index, name in enumerate(dict.fromkeys(trials.participants))}
    clusters = np.array([people[name] for name in trials.participants], dtype=np.int64)
    blank = Result(effect, "t", _METHODS[family], _RATIOS[family], len(people))
    pairs = [f"{first} - {second}" for first, second in combinations(levels, 2)]
    estimated = _undefined(trials, len(levels), len(people), family) or _estimated(
        trials, clusters, len(levels), family
    )
    if isinstance(estimated, str):
        rows = [replace(blank, contrast=pair, status=estimated) for pair in pairs]
        return rows if len(levels) == 2 else [replace(blank, statistic_name="F", status=estimated), *rows]
    df = float(len(people) - len(levels))
    details = {"n_observations": len(clusters), "dispersion": estimated.dispersion, "means": estimated.means.tolist()}
    omnibus = [] if len(levels) == 2 else [_f_row(replace(blank, details=details), estimated, df)]
    return [*omnibus, *_pair_rows(replace(blank, details=details), estimated, df, pairs)]


def _undefined(trials: Trials, k: int, people: int, family: Family) -> str | None:
    """Why nothing can be estimated, or None."""
    if status := too_few(people):
        return status
    seen = np.bincount(trials.conditions, minlength=k)
    if k < 2 or not seen.all():
        return ONE_LEVEL
    if status := _unfit(trials, family):
        return status
    means = np.bincount(trials.conditions, trials.outcome, k) / seen
    at_end = (means == 0) | ((means == 1) & (family == "logit"))
    if at_end.any():
        return NO_VARIATION if np.ptp(means) == 0 else SEPARATED
    return TOO_FEW_VALUES if people <= k else None


def _unfit(trials: Trials, family: Family) -> str | None:
    """Why the outcomes do not fit the family, 0 or 1 or counts with exposures above 0; None where they do."""
    if family == "logit":
        return None if np.isin(trials.outcome, (0.0, 1.0)).all() else NOT_BINARY
    if not ((trials.outcome >= 0) & (trials.outcome % 1 == 0)).all():
        return NOT_COUNTS
    return None if trials.exposure is None or (trials.exposure > 0).all() else NOT_EXPOSED


def _estimated(trials: Trials, clusters: IntArray, k: int, family: Family) -> Estimated | str:
    """The conditions' log odds or log rates and their covariances, or why there are none."""
    estimated = with_statsmodels.gee(trials.outcome, clusters, trials.conditions, k, family, trials.exposure)
    if estimated is None or not (np.isfinite(estimated.covariance).all() and np.isfinite(estimated.estimates).all()):
        return NOT_CONVERGED
    return estimated


def _f_row(blank: Result, estimated: Estimated, df: float) -> Result:
    """All conditions together: Wald's W of q contrasts, scaled as Hotelling's T²: F = W · (df − q + 1)/(q · df)."""
    blank = replace(blank, statistic_name="F", effect_size_name="")
    q = len(estimated.estimates) - 1
    contrasts = np.hstack([np.ones((q, 1)), -np.eye(q)])
    covariance = contrasts @ estimated.covariance @ contrasts.T
    df2 = df - q + 1
    if df2 < 1:
        return replace(blank, status=TOO_FEW_VALUES)
    if np.linalg.matrix_rank(covariance) < q or float(np.trace(covariance)) < _NO_SPREAD:
        return replace(blank, status=NO_ERROR)
    difference = contrasts @ estimated.estimates
    statistic = float(difference @ np.linalg.solve(covariance, difference)) * df2 / (q * df)
    details = {**blank.details, "no_effect_size": EACH_PAIR}
    p = f_above(statistic, q, df2)
    return replace(blank, statistic=statistic, df1=float(q), df2=df2, p=p, details=details)


def _pair_rows(blank: Result, estimated: Estimated, df: float, pairs: Sequence[str]) -> Iterator[Result]:
    k = len(estimated.estimates)
    for (i, j), pair in zip(combinations(range(k), 2), pairs, strict=True):
        weights = np.eye(k)[i] - np.eye(k)[j]
        log_ratio, variance = float(weights @ estimated.estimates), float(weights @ estimated.covariance @ weights)
        if variance < _NO_SPREAD:
            yield replace(blank, contrast=pair, status=NO_ERROR)
            continue
        error = float(np.sqrt(variance))
        margin = t_quantile(0.975, df) * error
        yield replace(
            blank,
            contrast=pair,
            statistic=log_ratio / error,
            df2=df,
            p=2 * t_above(abs(log_ratio) / error, df),
            effect_size=float(np.exp(log_ratio)),
            ci_low=float(np.exp(log_ratio - margin)),
            ci_high=float(np.exp(log_ratio + margin)),
            details={
                **blank.details,
                "log_ratio": log_ratio,
                "se": error,
                **_uncorrected(log_ratio, float(weights @ estimated.uncorrected @ weights)),
            },
        )


def _uncorrected(log_ratio: float, variance: float) -> dict[str, float]:
    """What most programs print: the standard error without correction for few participants, and p by z."""
    if variance < _NO_SPREAD:  # the few participants of a pair all came out alike
        return {}
    error = float(np.sqrt(variance))
    return {"se_uncorrected": error, "z_p": float(2 * stats.norm.sf(abs(log_ratio) / error))}
