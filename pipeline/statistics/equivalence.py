"""Two one-sided tests of equivalence."""

from __future__ import annotations

from dataclasses import replace

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.effect_size import dz_interval
from pipeline.statistics.paired import differences_of
from pipeline.statistics.result import Result
from pipeline.statistics.tails import t_above, t_quantile


def tost(first: FloatArray, second: FloatArray, bounds: tuple[float, float], effect: str = "condition") -> Result:
    """Whether the mean of first − second lies between the bounds (Schuirmann 1987).

    The statistic is the t of the side with the larger p, which is the p of the whole; effect size d_z.
    """
    blank = Result(effect, "t", "two one-sided paired t tests (TOST)", "Cohen's d_z", len(first))
    summary = differences_of(first, second)
    if isinstance(summary, str):
        return replace(blank, status=summary)
    df, mean, error = summary.n - 1, summary.mean, summary.error
    t_lower, t_upper = (mean - bounds[0]) / error, (mean - bounds[1]) / error
    p_lower, p_upper = t_above(t_lower, df), t_above(-t_upper, df)
    low, high = dz_interval(summary.dz, summary.n)
    margin = t_quantile(0.95, df) * error
    return replace(
        blank,
        statistic=float(t_lower if p_lower >= p_upper else t_upper),
        df2=float(df),
        p=max(p_lower, p_upper),
        effect_size=summary.dz,
        ci_low=low,
        ci_high=high,
        details={
            "p_lower": p_lower,
            "p_upper": p_upper,
            "t_lower": float(t_lower),
            "t_upper": float(t_upper),
            "bounds": list(bounds),
            "ci90_difference": [mean - margin, mean + margin],
        },
    )
