"""The same law for effect sizes, intervals, ranks of groups, changes, mixed designs and questionnaire scores.

Figures are rounded from real data as papers print them, by every convention that is in use; none is a contradiction.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics.anova import rm_anova
from pipeline.statistics.effect_size import hedges_correction
from pipeline.statistics.errors import mcnemar
from pipeline.statistics.kruskal import kruskal_wallis
from pipeline.statistics.mann_whitney import mann_whitney
from pipeline.statistics.mixed_anova import mixed_anova
from pipeline.statistics.paired import t_paired
from tests.pipeline.analysis.audit.test_no_false_accusation import SEEDS, Printer, audited, cells

Row = dict[str, Any]


def with_intervals(printer: Printer, described: Row, columns: dict[str, np.ndarray]) -> Row:
    """Means with Student's intervals, or in some other way."""
    for name, values in columns.items():
        n, level = len(values), float(printer.random.choice([90, 95, 99]))
        law = stats.t(n - 1) if printer.random.random() < 0.6 else stats.norm()
        margin = law.ppf((1 + level / 100) / 2) * values.std(ddof=1) / np.sqrt(n) * printer.random.choice([1, 1, 0.8])
        bounds = [printer.figure(float(values.mean() + sign * margin)) for sign in (-1, 1)]
        described[name] |= {"ci": bounds, "ci_level": f"{level:g}"}
    return described


@settings(max_examples=60, deadline=None)
@given(st.integers(3, 30), SEEDS)
def test_effect_sizes_of_pairs(n: int, seed: int) -> None:
    printer = Printer(seed)
    values = printer.random.normal(10, 3, (n, 1)) + printer.random.normal([0, printer.random.uniform(0, 2)], 1, (n, 2))
    t, f = t_paired(values[:, 0], values[:, 1]), rm_anova(values, ["condition"])[0]
    assert t.statistic is not None
    assert t.effect_size is not None
    assert t.p is not None
    assert f.statistic is not None
    d_av, correction = abs(t.details["d_av"]), hedges_correction(n - 1) or 1.0
    partial = float(f.details["partial_eta_squared"])
    first = printer.test(
        t.p,
        test="t_paired",
        t=printer.figure(abs(t.statistic)),
        d_z=printer.figure(abs(t.effect_size) * printer.random.choice([1, correction])),
        d=printer.figure(float(printer.random.choice([abs(t.effect_size), d_av]))),
        partial_eta_squared=printer.figure(partial),
        **({"df": str(n - 1)} if printer.random.random() < 0.5 else {}),
    )
    second = printer.test(
        t.p,
        test="rm_anova",
        F=printer.figure(f.statistic),
        df=["1", str(n - 1)],
        d_z=printer.figure(abs(t.effect_size)),
        partial_eta_squared=printer.figure(partial),
    )
    columns = {"a": values[:, 0], "b": values[:, 1]}
    described = with_intervals(printer, cells(printer, columns), columns)
    measures = [{"name": "m", "cells": described, "tests": [first, second]}]
    assert not audited({"n": n, "measures": measures})


@settings(max_examples=60, deadline=None)
@given(st.integers(4, 16), st.integers(3, 5), SEEDS)
def test_partial_eta_squared_of_several_conditions(n: int, k: int, seed: int) -> None:
    printer = Printer(seed)
    values = printer.random.normal(0, 1, (n, 1)) + printer.random.normal(0, 1, (n, k)) * printer.random.uniform(
        0.3, 2, k
    )
    found = rm_anova(values, ["condition"])[0]
    assert found.statistic is not None
    epsilon = found.details["epsilon_gg"] if printer.random.random() < 0.6 else 1.0
    digits = 2 if printer.random.random() < 0.5 and epsilon < 1 else 0
    df = [f"{part * epsilon:.{digits}f}" for part in (k - 1, (k - 1) * (n - 1))]
    test: Row = {"F": printer.figure(found.statistic), "df": df, "test": "rm_anova"}
    test["partial_eta_squared"] = printer.figure(found.details["partial_eta_squared"])
    assert not audited({"n": n, "measures": [{"name": "m", "tests": [test]}]})


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(1, 8), min_size=2, max_size=3), st.integers(2, 4), SEEDS)
def test_mixed_designs(sizes: list[int], k: int, seed: int) -> None:
    printer = Printer(seed)
    n = sum(sizes)
    codes = np.repeat(np.arange(len(sizes)), sizes)
    values = printer.random.normal(0, 1, (n, 1)) + printer.random.normal(0, 1, (n, k)) + codes[:, None] / 2
    tests = []
    for found in mixed_anova(values, codes, "group", ["condition"]):
        if found.statistic is None or found.p is None or found.df1 is None or found.df2 is None:
            continue
        epsilon = found.details["epsilon_gg"] or 1.0
        corrected = printer.random.random() < 0.5
        p = found.details["p_gg"] if corrected and found.details["p_gg"] is not None else found.p
        shown = epsilon if corrected and printer.random.random() < 0.5 else 1.0
        df = [f"{part * shown:.2f}" if shown < 1 else f"{part:.0f}" for part in (found.df1, found.df2)]
        tests.append(
            printer.test(
                p,
                test="mixed_anova",
                effect=found.effect,
                F=printer.figure(found.statistic),
                df=df,
                partial_eta_squared=printer.figure(found.details["partial_eta_squared"]),
            )
        )
    assert not audited({"n": n, "measures": [{"name": "m", "tests": tests}]})


@settings(max_examples=80, deadline=None)
@given(st.lists(st.integers(2, 14), min_size=2, max_size=4), st.booleans(), SEEDS)
def test_ranks_of_groups(ns: list[int], rated: bool, seed: int) -> None:
    printer = Printer(seed)
    groups = [printer.random.normal(printer.random.uniform(0, 2), 1, n) for n in ns]
    if rated:
        groups = [np.clip(np.rint(group + 3), 1, 5) for group in groups]
    names = [f"g{index}" for index in range(len(ns))]
    described = cells(printer, dict(zip(names, groups, strict=True)), with_n=True)
    tests: list[Row] = []
    whole = kruskal_wallis(groups)
    if whole.statistic is not None and whole.p is not None:
        tests.append(printer.test(whole.p, test="kruskal", H=printer.figure(whole.statistic), df=str(len(ns) - 1)))
    first, second = groups[:2]
    exact = mann_whitney(first, second)
    if exact.p is not None and exact.statistic is not None:
        n, m = ns[:2]
        u = min(exact.statistic, n * m - exact.statistic)
        ways: list[float] = [exact.p]
        for continuity in (True, False):
            ways.append(float(stats.mannwhitneyu(first, second, use_continuity=continuity, method="asymptotic").pvalue))
        ranks = stats.rankdata(np.concatenate([first, second]))
        sd = np.sqrt(n * m / (n + m - 1) * np.var(ranks))
        z = max(abs(u - n * m / 2) - printer.random.choice([0, 0.5]), 0) / sd
        extras: Row = {"U": printer.figure(float(printer.random.choice([u, n * m - u])), least_digits=1)}
        if printer.random.random() < 0.5:
            extras |= {"z": printer.figure(-z), "effect_r": printer.figure(z / np.sqrt(n + m))}
        p = float(printer.random.choice(ways))
        tests.append(printer.test(p, test="mann_whitney", conditions=names[:2], **extras))
    assert not audited({"measures": [{"name": "m", "cells": described, "tests": tests}]})


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 25), st.integers(2, 25), SEEDS)
def test_d_of_groups(n: int, m: int, seed: int) -> None:
    printer = Printer(seed)
    first, second = printer.random.normal(0, 1, n), printer.random.normal(1, printer.random.uniform(0.5, 2), m)
    columns = {"a": first, "b": second}
    described = with_intervals(printer, cells(printer, columns, with_n=True), columns)
    difference = abs(first.mean() - second.mean())
    sds = [first.std(ddof=1), second.std(ddof=1)]
    pooled = np.sqrt(((n - 1) * sds[0] ** 2 + (m - 1) * sds[1] ** 2) / (n + m - 2))
    measures = []
    for welch in (False, True):
        t = stats.ttest_ind(first, second, equal_var=not welch)
        correction = hedges_correction(n + m - 2) or 1.0
        ways = [difference / pooled, correction * difference / pooled, *(difference / sd for sd in sds)]
        ways.append(difference / np.sqrt((sds[0] ** 2 + sds[1] ** 2) / 2))
        if not welch:
            ways.append(2 * abs(t.statistic) / np.sqrt(n + m - 2))
        row = printer.test(
            t.pvalue,
            test="welch" if welch else "t_independent",
            t=printer.figure(t.statistic),
            d=printer.figure(float(printer.random.choice(ways))),
            df=f"{t.df:.2f}" if welch else str(n + m - 2),
        )
        measures.append({"name": f"welch {welch}", "cells": described, "tests": [row]})
    assert not audited({"measures": measures})


@settings(max_examples=80, deadline=None)
@given(st.integers(1, 40), SEEDS)
def test_changes(n: int, seed: int) -> None:
    printer = Printer(seed)
    answers = (printer.random.random((n, 2)) < printer.random.random(2)).astype(float)
    found = mcnemar(answers[:, 0], answers[:, 1])
    if found.p is None or found.statistic is None:
        return
    b, c = int(found.statistic), int(found.details["c"])
    square = max(abs(b - c) - float(printer.random.choice([0, 0.5, 1])), 0) ** 2 / (b + c)
    p = float(printer.random.choice([found.p, found.details["mid_p"], stats.chi2.sf(square, 1)]))
    test = printer.test(p, test="mcnemar", discordant=[b, c])
    if printer.random.random() < 0.5:
        test |= {"chi2": printer.figure(square), "df": "1"}
    if printer.random.random() < 0.3:
        del test["discordant"]
    assert not audited({"n": n, "measures": [{"name": "m", "tests": [test]}]})


@settings(max_examples=60, deadline=None)
@given(st.integers(4, 25), SEEDS)
def test_r_of_the_signed_rank_test(n: int, seed: int) -> None:
    printer = Printer(seed)
    differences = np.rint(printer.random.normal(1, 2, n))
    ranked = differences[differences != 0]
    if len(ranked) < 2:
        return
    ranks = stats.rankdata(np.abs(ranked))
    z = (ranks[ranked > 0].sum() - ranks.sum() / 2) / np.sqrt(np.sum(ranks**2) / 4)
    number = int(printer.random.choice([n, 2 * n, len(ranked)]))
    test = printer.test(
        float(2 * stats.norm.sf(abs(z))),
        test="wilcoxon",
        z=printer.figure(z),
        effect_r=printer.figure(abs(z) / np.sqrt(number)),
    )
    assert not audited({"n": n, "measures": [{"name": "m", "tests": [test]}]})


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 40), SEEDS)
def test_scores_of_questionnaires(n: int, seed: int) -> None:
    printer = Printer(seed)
    sus = 2.5 * np.clip(np.rint(printer.random.normal(28, 6, (n, 2))), 0, 40)
    tlx = (5 * np.clip(np.rint(printer.random.normal(9, 5, (n, 2, 6))), 0, 20)).mean(axis=2)
    measures = [
        {"name": name, "scale": name, "cells": cells(printer, {"a": scores[:, 0], "b": scores[:, 1]})}
        for name, scores in (("sus", sus), ("raw_tlx", tlx))
    ]
    assert not audited({"n": n, "measures": measures})
