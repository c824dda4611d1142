"""The evidence that a row of `comparisons` gives: statistic, degrees of freedom, p values and effect size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.words.comparison import Row
from pipeline.words.effect_sizes import effect_size
from pipeline.words.names import adjustment_label
from pipeline.words.numbers import NO_VALUE, fixed_decimals, fraction, interval, number, p_phrase

_LEAST_FACTOR = 0.005  # a smaller Bayes factor is no number with two decimals
_RANK_SUMS = ("W+", "U")
_STATISTICS = {"chi2": "χ²", "BF10": "BF₁₀", "W+": "W₊"}


def evidence(row: Row, digits: int = 4, before_interval: str = " ") -> str:
    """Statistic, p values with `digits` decimals, and effect size, of a row whose status is "ok"."""
    parts = [statistic(row)]
    if row["p"] is not None:
        parts.append(p_phrase(row["p"], digits=digits))
    if greenhouse_geisser(row):
        parts.append(greenhouse_geisser(row, digits) or "")
    if row["p_adjusted"] is not None:
        parts.append(adjusted_p(row, digits))
    if row["effect_size"] is not None or row["ci_low"] is not None:
        parts.append(effect_size(row, before_interval))
    parts += [text for text in (permutation(row, digits), bootstrap(row), one_sided(row)) if text]
    return ", ".join(parts)


def adjusted_p(row: Row, digits: int = 4) -> str:
    """`Holm-adjusted p = .0346`, of a row whose p is adjusted."""
    return p_phrase(row["p_adjusted"], f"{adjustment_label(row['adjust'])}-adjusted p", digits)


def statistic(row: Row) -> str:
    """`F(1, 11) = 10.86`, or `NO_VALUE` where the test has no statistic."""
    if row["statistic"] is None:
        return NO_VALUE
    freedom = degrees_of_freedom(row)
    name = statistic_name(row)
    return f"{name}({freedom}) = {statistic_value(row)}" if freedom else f"{name} = {statistic_value(row)}"


def statistic_name(row: Row) -> str:
    """`F`, `W₊`, `χ²`."""
    return _STATISTICS.get(row["statistic_name"], str(row["statistic_name"]))


def statistic_value(row: Row) -> str:
    """A statistic's value with two decimals.

    A sum of ranks is shown exactly, being whole or a half. A Bayes factor may be far below 1 and keeps its digits.
    """
    value = row["statistic"]
    if value is None or row["statistic_name"] == "BF10":
        return number(value)
    if row["statistic_name"] == "b":
        return f"{value:.0f}, c = {row['details']['c']}"
    if row["statistic_name"] in _RANK_SUMS:
        return f"{value:.0f}" if float(value).is_integer() else f"{value:.1f}"
    return fixed_decimals(value, 2)


def degrees_of_freedom(row: Row) -> str:
    """`1, 11`; empty for a test without any."""
    return ", ".join(text for text in (_whole_or_decimal(row["df1"]), _whole_or_decimal(row["df2"])) if text)


def _whole_or_decimal(value: float | None) -> str:
    """`11`, or `14.50` where a test has fractional degrees of freedom."""
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value - round(value)) < 1e-6 * value else f"{value:.2f}"


def greenhouse_geisser(row: Row, digits: int = 4) -> str | None:
    """`Greenhouse-Geisser ε = .812, p = .0123`, of an ANOVA of more than two conditions; None of any other test."""
    details = row["details"] or {}
    if details.get("p_gg") is None:
        return None
    return f"Greenhouse-Geisser ε = {fraction(details['epsilon_gg'])}, {p_phrase(details['p_gg'], digits=digits)}"


def permutation(row: Row, digits: int = 4) -> str:
    """`exact permutation p = .0312`; empty where none was asked for."""
    details = row["details"] or {}
    if details.get("permutation_p") is None:
        return ""
    exact = "exact " if details["permutation_exact"] else ""
    return p_phrase(details["permutation_p"], f"{exact}permutation p", digits)


def resampled(details: Mapping[str, Any]) -> Sequence[float]:
    """A bootstrap's interval, of a ratio or a difference; empty where none was asked for or could be computed."""
    bounds: Sequence[float] = details.get("bootstrap_ci_ratio_to_first") or details.get("bootstrap_ci_difference") or ()
    return bounds


def bootstrap(row: Row) -> str:
    """`mean difference = 6.10, bootstrap 95 % CI [3.20, 9.12]`; empty where none was asked for.

    Where it was asked for and cannot be computed, the reason stands in its place.
    """
    details = row["details"] or {}
    if "bootstrap_seed" not in details:
        return ""
    of_ratio, of_difference = (details.get(f"bootstrap_ci_{what}") for what in ("ratio_to_first", "difference"))
    if of_ratio:
        return f"bootstrap 95 % CI of the ratio {interval(*of_ratio)}"
    mean = f"mean difference = {number(row['mean_difference'])}, bootstrap 95 % CI "
    return mean + interval(*of_difference) if of_difference else str(details["no_bootstrap"])


def one_sided(row: Row) -> str:
    """`one-sided BF₋₀ = 12.30 (p is two-sided)` where a direction was expected; empty where no factor was computed."""
    factor = one_sided_factor(row)
    if not factor:
        return ""
    name = "BF₋₀" if (row["details"] or {})["expected"] == "less" else "BF₊₀"
    return f"one-sided {name} {factor}" + (" (p is two-sided)" if row["p"] is not None else "")


def one_sided_factor(row: Row) -> str:
    """`= 12.30`, or `> 10³⁰⁸` where it is larger than any number a computer holds; empty where none was computed."""
    details = row["details"] or {}
    if "one_sided_log_bf" not in details:
        return ""
    factor = details["one_sided_bf"]
    return "> 10³⁰⁸" if factor is None else f"= {number(factor)}" if factor >= _LEAST_FACTOR else "< .005"
