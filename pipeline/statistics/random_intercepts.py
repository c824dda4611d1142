"""Which random intercepts a mixed model has, which of them the data carry, and its fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.statistics import NO_RESIDUAL, NOT_CONVERGED, random_intercept, variance_components
from pipeline.statistics.random_intercept import PARTICIPANT, Rows
from pipeline.statistics.result import IntArray, negligible
from pipeline.statistics.satterthwaite import Fit
from pipeline.statistics.variance_components import Problem, distinct

_ESTIMATION = "REML, Satterthwaite degrees of freedom"


@dataclass(frozen=True)
class Fitted:
    """A fit, and the random intercepts that it does without, since the data cannot tell their variance."""

    fit: Fit
    left_out: tuple[str, ...] = ()


def fitted(rows: Rows, groupings: Mapping[str, IntArray]) -> Fitted | str:
    """The fit with a random intercept for each grouping (N,), participants' first; the status where there is none."""
    if list(groupings) == [PARTICIPANT]:
        return Fitted(random_intercept.fit(rows))
    problem, left_out = distinct(Problem(rows.values, rows.design, groupings))
    if _without_residual(problem):
        return NO_RESIDUAL
    alone = list(problem.groupings) == [PARTICIPANT]
    fit = random_intercept.fit(rows) if alone else variance_components.fit(problem)
    return NOT_CONVERGED if fit is None else Fitted(fit, tuple(left_out))


def _without_residual(problem: Problem) -> bool:
    """Whether fixed effects and random intercepts explain the values completely."""
    blocks = [codes[:, None] == np.unique(codes) for codes in problem.groupings.values()]
    explained = np.hstack([problem.design, *blocks])
    left = problem.values - explained @ np.linalg.lstsq(explained, problem.values, rcond=None)[0]
    return negligible(float(np.sum(left**2)), problem.values)


def method_text(groupings: Iterable[str], fitted_model: Fitted | None = None) -> str:
    """The method in words; `fitted_model` adds the random intercepts that the fit left out."""
    names = list(groupings)
    zero = fitted_model.fit.zero if fitted_model else []
    if names == [PARTICIPANT]:
        singular = "; singular fit: no variance between participants is found" if zero else ""
        return f"linear mixed model, random intercept, {_ESTIMATION}{singular}"
    text = f"linear mixed model, {_written(names)}, {_ESTIMATION}"
    if fitted_model and fitted_model.left_out:
        text += f"; left out, as these data cannot tell its variance: {_written(fitted_model.left_out)}"
    if zero:
        text += f"; singular fit, estimated as zero and left out: {_written(zero)}"
    return text


def _written(names: Iterable[str]) -> str:
    return " + ".join(f"(1 | {name})" for name in names)
