"""The comparisons in statsmodels (Seabold and Perktold 2010), as its users call it."""

from __future__ import annotations

import numpy as np

from pipeline.analysis.against import long_tables
from pipeline.analysis.against.problems import P_ADJUSTED, Family, Groups, Model, Paired, Within
from pipeline.analysis.against.theirs import Call, Calls, Found, NotOffered, fitted
from pipeline.statistics.mixed import Factor
from pipeline.statistics.multiplicity import METHODS
from pipeline.statistics.with_statsmodels import nothing_to_collect
from pipeline.study.comparison import Comparison


def version() -> str:
    """The program and its version."""
    import statsmodels

    return f"statsmodels {statsmodels.__version__}"


def _ttest_mean(data: Paired, _entry: Comparison) -> Found:
    from statsmodels.stats.weightstats import DescrStatsW

    found = DescrStatsW(data.first - data.second)
    t, p, df = found.ttest_mean()
    low, high = found.tconfint_mean()
    return {"statistic": t, "df2": df, "p": p, "ci_difference_low": low, "ci_difference_high": high}


def _ttost_paired(data: Paired, entry: Comparison) -> Found:
    from statsmodels.stats.weightstats import ttost_paired

    p, *sides = ttost_paired(data.first, data.second, *(entry.bounds or (0.0, 0.0)))
    weaker = max(sides, key=lambda side: side[1])
    return {"statistic": weaker[0], "df2": weaker[2], "p": p}


def _anova_rm(data: Within, _entry: Comparison) -> Found:
    from statsmodels.stats.anova import AnovaRM

    table = long_tables.of_within(data)
    found = AnovaRM(table, "value", "participant", within=long_tables.factors_of(data)).fit().anova_table
    row = found.loc[":".join(long_tables.effect_of(data))]
    return {"statistic": row["F Value"], "df1": row["Num DF"], "df2": row["Den DF"], "p": row["Pr > F"]}


def _ttest_ind(data: Groups, _entry: Comparison) -> Found:
    from statsmodels.stats.weightstats import ttest_ind

    t, p, df = ttest_ind(*data.groups, usevar="unequal")
    return {"statistic": t, "df2": df, "p": p}


def _anova_oneway(data: Groups, _entry: Comparison) -> Found:
    from statsmodels.stats.oneway import anova_oneway

    found = anova_oneway(list(data.groups), use_var="unequal")
    return {"statistic": found.statistic, "df1": found.df_num, "df2": found.df_denom, "p": found.pvalue}


def _mixedlm(data: Model, _entry: Comparison) -> Found:
    """The coefficient of a slope or of a level beside the first; of a whole factor of more levels its Wald test."""
    from statsmodels.formula.api import mixedlm

    if any(":" in term for term in data.terms):
        raise NotOffered("beside an interaction a coefficient is the effect at the first level of the other factor")
    first, second = data.levels or (0, 1)
    if first > 0:
        raise NotOffered("its summary compares each level with the first one only")
    written = {
        name: f"C({short})" if isinstance(data.columns[name], Factor) else short
        for name, short in long_tables.names_of(data).items()
    }
    formula = f"value ~ {' + '.join(written[term] for term in data.terms)}"
    fit = mixedlm(formula, long_tables.of_model(data), groups="participant").fit()
    if not fit.converged:
        raise ValueError("it did not converge")
    column, name = data.columns[data.term], written[data.term]
    if data.levels is None and isinstance(column, Factor):
        row = fit.wald_test_terms().table.loc[name]
        chi2, df1 = float(np.squeeze(row["statistic"])), float(row["df_constraint"])
        return {
            "statistic": fitted(chi2),
            "df1": df1,
            "p": fitted(float(row["pvalue"])),
            "log_likelihood": fitted(fit.llf),
        }
    coefficient = f"{name}[T.{second}]" if isinstance(column, Factor) else name
    return {
        "statistic": fitted(fit.tvalues[coefficient]),
        "p": fitted(fit.pvalues[coefficient]),
        "effect_size": fitted(fit.params[coefficient]),
        "se": fitted(fit.bse[coefficient]),
        "log_likelihood": fitted(fit.llf),
    }


def _multipletests(data: Family, _entry: Comparison) -> Found:
    from statsmodels.stats.multitest import multipletests

    with nothing_to_collect():
        return {"p_adjusted": multipletests(list(data.p_values), method=METHODS[data.method])[1][data.place]}


CALLS: Calls = {
    "t_paired": (Call("DescrStatsW(x - y).ttest_mean()", _ttest_mean),),
    "tost": (Call("statsmodels ttost_paired(x, y, low, upp)", _ttost_paired),),
    "rm_anova": (Call("AnovaRM(data, depvar, subject, within).fit()", _anova_rm),),
    "t_welch": (Call("statsmodels ttest_ind(x, y, usevar='unequal')", _ttest_ind),),
    "anova_welch": (Call("anova_oneway([x, y, …], use_var='unequal')", _anova_oneway),),
    "mixed_model": (Call("mixedlm('value ~ …', data, groups).fit()", _mixedlm),),
    P_ADJUSTED: (Call("multipletests(p, method)", _multipletests),),
}
"""statsmodels' functions for each procedure."""
