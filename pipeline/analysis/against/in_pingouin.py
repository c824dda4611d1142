"""The comparisons in pingouin (Vallat 2018), as its users call it."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.analysis.against import long_tables
from pipeline.analysis.against.long_tables import GROUP
from pipeline.analysis.against.problems import P_ADJUSTED, Family, Groups, Paired, Within
from pipeline.analysis.against.theirs import Call, Calls, Found, NotOffered, rounded
from pipeline.study.comparison import Comparison
from pipeline.study.statistical_tests import ADJUSTMENTS

_ADJUSTMENTS = {
    "holm": "holm",
    "bonferroni": "bonf",
    "sidak": "sidak",
    "benjamini_hochberg": "fdr_bh",
    "benjamini_yekutieli": "fdr_by",
}


def version() -> str:
    """The program and its version."""
    import pingouin

    return f"pingouin {pingouin.__version__}"


def _ttest(data: Paired, _entry: Comparison) -> Found:
    import pingouin

    return _t(pingouin.ttest(data.first, data.second, paired=True))


def _ttest_of_groups(data: Groups, _entry: Comparison) -> Found:
    import pingouin

    return _t(pingouin.ttest(*data.groups))


def _t(table: Any) -> Found:
    found = table.iloc[0]
    low, high = found["CI95"]
    return {
        "statistic": found["T"],
        "df2": found["dof"],
        "p": found["p_val"],
        "effect_size": found["cohen_d"],
        "ci_difference_low": rounded(low, 2),
        "ci_difference_high": rounded(high, 2),
    }


def _wilcoxon(data: Paired, _entry: Comparison) -> Found:
    import pingouin

    found = pingouin.wilcoxon(data.first, data.second).iloc[0]
    return {"statistic": found["W_val"], "p": found["p_val"], "effect_size": found["RBC"]}


def _tost(data: Paired, entry: Comparison) -> Found:
    import pingouin

    low, high = entry.bounds or (0.0, 0.0)
    if low != -high:
        raise NotOffered(f"its bounds are symmetrical, and these are not: {low:g}, {high:g}")
    found = pingouin.tost(data.first, data.second, bound=high, paired=True).iloc[0]
    return {"df2": found["dof"], "p": found["pval"]}


def _bayes_t(data: Paired, entry: Comparison) -> Found:
    import pingouin

    t = float(pingouin.ttest(data.first, data.second, paired=True)["T"].iloc[0])
    factor = pingouin.bayesfactor_ttest(t, len(data.first), paired=True, r=entry.prior_scale)
    return {"statistic": float(factor)}


def _friedman(data: Within, _entry: Comparison) -> Found:
    import pingouin

    table = long_tables.of_within(data)
    found = pingouin.friedman(data=table, dv="value", within="f1", subject="participant").iloc[0]
    return {"statistic": found["Q"], "df1": found["ddof1"], "p": found["p_unc"], "effect_size": found["W"]}


def _rm_anova(data: Within, _entry: Comparison) -> Found:
    import pingouin

    factors = long_tables.factors_of(data)
    if len(factors) > 2:
        raise NotOffered("it takes two factors at most")
    within = factors if len(factors) > 1 else factors[0]
    table = pingouin.rm_anova(
        data=long_tables.of_within(data),
        dv="value",
        within=within,
        subject="participant",
        correction=True,
        detailed=True,
    )
    rows = table.set_index("Source")
    found = rows.loc[" * ".join(long_tables.effect_of(data))]
    df2 = found["ddof2"] if "ddof2" in found else rows.loc["Error", "DF"]
    df1 = found["ddof1"] if "ddof1" in found else found["DF"]
    return {"df2": df2, "effect_size": found["ng2"], **_f(found, df1)}


def _mixed_anova(data: Within, _entry: Comparison) -> Found:
    import pingouin

    if data.values.ndim > 2:
        raise NotOffered("it takes one factor within participants")
    table = pingouin.mixed_anova(
        data=long_tables.of_within(data), dv="value", within="f1", subject="participant", between=GROUP, correction=True
    )
    source = "Interaction" if data.effect and data.with_group else long_tables.effect_of(data)[0]
    found = table.set_index("Source").loc[source]
    return {"df2": found["DF2"], "effect_size": found["np2"], **_f(found, found["DF1"] if data.effect else 1)}


def _f(found: Any, df1: float) -> Found:
    """F, p, and what corrects them where there is more than one degree of freedom to correct."""
    figures = {"statistic": found["F"], "df1": found.get("DF1", df1), "p": found["p_unc"]}
    if df1 < 2:
        return figures
    return figures | {
        "p_gg": found["p_GG_corr"],
        "epsilon_gg": found["eps"],
        "mauchly_w": found["W_spher"],
        "mauchly_p": found["p_spher"],
    }


def _mwu(data: Groups, _entry: Comparison) -> Found:
    import pingouin

    found = pingouin.mwu(*data.groups).iloc[0]
    return {"statistic": found["U_val"], "p": found["p_val"], "effect_size": found["RBC"]}


def _welch_anova(data: Groups, _entry: Comparison) -> Found:
    import pingouin

    found = pingouin.welch_anova(data=long_tables.of_groups(data), dv="value", between=GROUP).iloc[0]
    return {
        "statistic": found["F"],
        "df1": found["ddof1"],
        "df2": found["ddof2"],
        "p": found["p_unc"],
        "effect_size": found["np2"],
    }


def _games_howell(data: Groups, _entry: Comparison) -> Found:
    import pingouin

    table = pingouin.pairwise_gameshowell(data=long_tables.of_groups(data), dv="value", between=GROUP)
    found = table[(table["A"] == data.pair[0]) & (table["B"] == data.pair[1])].iloc[0]
    return {"statistic": found["T"], "df2": found["df"], "p": found["pval"], "effect_size": found["hedges"]}


def _tukey_kramer(data: Groups, _entry: Comparison) -> Found:
    import pingouin

    table = pingouin.pairwise_tukey(data=long_tables.of_groups(data), dv="value", between=GROUP)
    found = table[(table["A"] == data.pair[0]) & (table["B"] == data.pair[1])].iloc[0]
    return {"statistic": found["T"], "p": found["p_tukey"]}


def _kruskal(data: Groups, _entry: Comparison) -> Found:
    import pingouin

    found = pingouin.kruskal(data=long_tables.of_groups(data), dv="value", between=GROUP).iloc[0]
    return {"statistic": found["H"], "df1": found["ddof1"], "p": found["p_unc"]}


def _multicomp(data: Family, _entry: Comparison) -> Found:
    import pingouin

    if data.method not in _ADJUSTMENTS:
        raise NotOffered(f"it has no {ADJUSTMENTS[data.method].label}")
    adjusted = pingouin.multicomp(np.array(data.p_values), method=_ADJUSTMENTS[data.method])[1]
    return {"p_adjusted": adjusted[data.place]}


CALLS: Calls = {
    "t_paired": (Call("pingouin.ttest(x, y, paired=True)", _ttest),),
    "wilcoxon": (Call("pingouin.wilcoxon(x, y)", _wilcoxon),),
    "tost": (Call("pingouin.tost(x, y, bound, paired=True)", _tost),),
    "bayes_t": (Call("pingouin.bayesfactor_ttest(t, n, paired=True, r)", _bayes_t),),
    "friedman": (Call("pingouin.friedman(data, dv, within, subject)", _friedman),),
    "rm_anova": (Call("pingouin.rm_anova(data, dv, within, subject, correction=True)", _rm_anova),),
    "mixed_anova": (Call("pingouin.mixed_anova(data, dv, within, subject, between)", _mixed_anova),),
    "t_welch": (Call("pingouin.ttest(x, y)", _ttest_of_groups),),
    "mann_whitney": (Call("pingouin.mwu(x, y)", _mwu),),
    "anova_welch": (Call("pingouin.welch_anova(data, dv, between)", _welch_anova),),
    "games_howell": (Call("pingouin.pairwise_gameshowell(data, dv, between)", _games_howell),),
    "tukey_kramer": (Call("pingouin.pairwise_tukey(data, dv, between)", _tukey_kramer),),
    "kruskal": (Call("pingouin.kruskal(data, dv, between)", _kruskal),),
    P_ADJUSTED: (Call("pingouin.multicomp(p, method)", _multicomp),),
}
"""pingouin's functions for each procedure."""
