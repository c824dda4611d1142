"""From a problem to a figure as another program has it: the arithmetic of `conventions`, and changes of our own row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy import stats

from pipeline.analysis.against import conventions
from pipeline.analysis.against.problems import Problem
from pipeline.analysis.against.theirs import Figure
from pipeline.analysis.ratios import RATIO_OF_RATIOS
from pipeline.statistics import RATIO
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.bayes import log_bayes_factor
from pipeline.statistics.mixed import mixed_model
from pipeline.tables.table import Row

Figures = Mapping[str, Figure]

_LIKELIHOOD_NOISE = 1e-8  # what the order of additions may do to a logarithm of a likelihood

Way = Callable[[Problem, Figures, str], float | None]
"""From a problem, all figures of the other program and the name of one to that one; None where it does not apply."""


def ours(row: Row, quantity: str) -> float | None:
    """A figure of a row: a column, or one of its details."""
    details = row["details"] or {}
    if quantity in ("ci_difference_low", "ci_difference_high"):
        interval = details.get("ci_difference", details.get("log_ratio_ci"))
        return None if interval is None else float(interval[quantity.endswith("high")])
    value = row[quantity] if quantity in row else details.get(quantity)
    if quantity == "effect_size" and "log_ratio" in details and row["effect_size_name"] in (RATIO, RATIO_OF_RATIOS):
        # Other programs take the logarithms for plain values: what they have is not the ratio.
        of_logarithms = (details[name] for name in ("cohen_dz", "cohen_dav", "log_ratio") if name in details)
        value = next(of_logarithms)
    return None if value is None else float(value)


def instead(other: str) -> Way:
    """Another figure of the same row of ours."""
    return lambda problem, _theirs, _quantity: ours(problem.row, other)


def times(other: str) -> Way:
    """Our figure times another one of the row."""

    def product(problem: Problem, _theirs: Figures, quantity: str) -> float | None:
        one, factor = ours(problem.row, quantity), ours(problem.row, other)
        return None if one is None or factor is None else one * factor

    return product


def of_other_sign(problem: Problem, _theirs: Figures, quantity: str) -> float | None:
    """Second minus first."""
    value = ours(problem.row, quantity)
    return None if value is None else -value


def of_data(figures: Callable[[Any], Mapping[str, float | None]]) -> Way:
    """A figure that follows from the problem's data alone, among others."""
    return lambda problem, _theirs, quantity: figures(problem.data)[quantity]


def of_differences(
    figure: Callable[[FloatArray, bool], float | None], as_floats: bool, pratt: bool | None = None
) -> Way:
    """A figure of the differences, and of whether zeros take part in the ranking: as the entry says, or as given."""

    def compute(problem: Problem, _theirs: Figures, _quantity: str) -> float | None:
        data: Any = problem.data
        by_pratt = problem.entry.zeros == "pratt" if pratt is None else pratt
        return figure(conventions.differences(data.first, data.second, as_floats), by_pratt)

    return compute


def medium_prior(problem: Problem, _theirs: Figures, _quantity: str) -> float:
    """The Bayes factor with the prior scale √2/2."""
    data: Any = problem.data
    t = conventions.t_of_floats(data)["statistic"]
    return float(np.exp(log_bayes_factor(t, len(data.first), float(np.sqrt(0.5)))))


def integrated_over_g(problem: Problem, _theirs: Figures, _quantity: str) -> float:
    """The Bayes factor by the same integral, over g instead of its logarithm (Rouder et al. 2009, eq. 1)."""
    from scipy.integrate import quad

    data: Any = problem.data
    t, n, scale = conventions.t_of_floats(data)["statistic"], len(data.first), problem.entry.prior_scale

    def weight(g: float) -> float:
        spread = 1 + n * g * scale**2
        prior = (2 * np.pi) ** -0.5 * g**-1.5 * np.exp(-1 / (2 * g))
        return float(spread**-0.5 * (1 + t**2 / (spread * (n - 1))) ** (-n / 2) * prior)

    return float(quad(weight, 0, np.inf)[0] * (1 + t**2 / (n - 1)) ** (n / 2))


def no_mauchly(problem: Problem, _theirs: Figures, quantity: str) -> float | None:
    """0 where we have no figure."""
    return 0.0 if ours(problem.row, quantity) is None else None


def weighted_by_group(problem: Problem, _theirs: Figures, quantity: str) -> float | None:
    """Of an effect within participants of a mixed design, not of an interaction with the group."""
    data: Any = problem.data
    if not data.effect or data.with_group:
        return None
    return conventions.weighted_within(data.values, data.codes, data.effect)[quantity]


def hedges_g(problem: Problem, _theirs: Figures, _quantity: str) -> float | None:
    """d_s with the approximate factor for small samples."""
    data: Any = problem.data
    d, number = ours(problem.row, "cohen_ds"), sum(len(data.groups[place]) for place in data.pair)
    return None if d is None else d * (1 - 3 / (4 * number - 9))


def size_of(other: str) -> Way:
    """Another figure of the same row of ours, without its sign."""

    def way(problem: Problem, _theirs: Figures, _quantity: str) -> float | None:
        value = ours(problem.row, other)
        return None if value is None else abs(value)

    return way


def f_of_t(problem: Problem, _theirs: Figures, quantity: str) -> float | None:
    """The F of one degree of freedom that t² is."""
    t = ours(problem.row, "statistic")
    if problem.row["statistic_name"] != "t" or t is None:
        return None
    return {"statistic": t**2, "df1": 1.0}[quantity]


def normal_p(_problem: Problem, theirs: Figures, _quantity: str) -> float:
    """Of the other program's own statistic."""
    return float(2 * stats.norm.sf(abs(theirs["statistic"].value)))


def chi2_p(_problem: Problem, theirs: Figures, _quantity: str) -> float | None:
    """Of the other program's own statistic."""
    return float(stats.chi2.sf(theirs["statistic"].value, theirs["df1"].value)) if "df1" in theirs else None


def participants_alone(problem: Problem, theirs: Figures, quantity: str) -> float | None:
    """A figure of the model with intercepts of participants alone; as an F or a coefficient, as the other program's."""
    data: Any = problem.data
    if not data.random:
        return None
    results = mixed_model(data.values, data.participants, data.columns, data.terms)
    (result,) = (one for one in results if (one.effect, one.contrast) == (data.term, problem.row["contrast"]))
    value = result.details.get(quantity) if quantity in result.details else getattr(result, quantity)
    if value is None or quantity not in ("statistic", "effect_size"):
        return None if value is None else float(value)
    if "df1" in theirs:
        return float(value) ** 2 if result.statistic_name == "t" else float(value)
    return -float(value) if result.contrast is not None else float(value)


def chi2_of_participants_alone(problem: Problem, theirs: Figures, quantity: str) -> float | None:
    """The same as Wald's χ², which is F times its degrees of freedom."""
    statistic = participants_alone(problem, theirs, quantity)
    return None if statistic is None or "df1" not in theirs else statistic * theirs["df1"].value


def at_lower_likelihood(problem: Problem, theirs: Figures, quantity: str) -> float | None:
    """The other program's own figure, if its likelihood is lower than that of our estimates of the same model."""
    own, other = participants_alone(problem, theirs, "log_likelihood"), theirs.get("log_likelihood")
    if own is None:
        own = ours(problem.row, "log_likelihood")
    if own is None or other is None or other.value > own - _LIKELIHOOD_NOISE:
        return None
    return theirs[quantity].value
