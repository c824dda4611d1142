"""The law that matters most: figures rounded from real data are never called a contradiction."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import CONTRADICTION
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.friedman import friedman
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.paired import t_paired
from pipeline.statistics.wilcoxon import wilcoxon
from pipeline.study.printed import Publication

Row = dict[str, Any]


class Printer:
    """Prints figures with digits of its own choice, half up or half to even, p also as < or >."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def figure(self, value: float, least_digits: int = 0) -> str:
        digits = int(self.random.integers(least_digits, 5))
        way = ROUND_HALF_UP if self.random.random() < 0.5 else ROUND_HALF_EVEN
        text = f"{Decimal(value).quantize(Decimal(1).scaleb(-digits), way)}"
        return text.replace("0.", ".", 1) if self.random.random() < 0.2 and abs(value) < 1 and digits else text

    def large(self, value: float) -> str:
        return f"{value:.{self.random.integers(1, 5)}e}".replace("e+0", "e") if value >= 1000 else self.figure(value)

    def p(self, value: float) -> str:
        bounds = [bound for bound in (0.001, 0.01, 0.05, 0.1) if value < bound]
        if bounds and self.random.random() < 0.3:
            return f"< {bounds[0]}"
        return self.figure(min(value, 1.0), least_digits=2)

    def test(self, p: float, **rest: object) -> Row:
        row: Row = {**rest, "p": self.p(p)}
        if abs(p - 0.05) > 1e-12:
            row["significant"] = p < 0.05
        return row


def audited(content: Mapping[str, Any]) -> list[str]:
    found = audit(Publication.model_validate({"source": "drawn at random", **content}))
    return [str(finding) for finding in found if finding.verdict == CONTRADICTION]


def cells(printer: Printer, values: Mapping[str, np.ndarray], with_n: bool = False) -> Row:
    found = {}
    for name, column in values.items():
        found[name] = {
            "mean": printer.figure(float(column.mean())),
            "sd": printer.figure(float(column.std(ddof=1))),
            "median": printer.figure(float(np.median(column))),
            **({"n": len(column)} if with_n else {}),
        }
    return found


SCALES = st.sampled_from([(1, 7, 1, 1), (0, 20, 1, 1), (0, 100, 5, 1), (1, 5, 1, 4), (-3, 3, 1, 3)])
SEEDS = st.integers(0, 2**32)


def ratings(printer: Printer, n: int, k: int, scale: tuple[int, int, int, int]) -> np.ndarray:
    """Scores (n, k) of participants who differ, each the mean of items, in steps."""
    low, high, step, items = scale
    centre = printer.random.uniform(low, high, (n, 1, 1)) + printer.random.normal(0, step, (1, k, 1))
    drawn = centre + printer.random.normal(0, (high - low) / 6, (n, k, items))
    whole = np.clip(np.rint((drawn - low) / step), 0, (high - low) // step) * step + low
    scores: np.ndarray = whole.mean(axis=2)
    return scores


def written_scale(scale: tuple[int, int, int, int]) -> Row:
    low, high, step, items = scale
    return {"min": str(low), "max": str(high), "step": str(step), "items": items}


@settings(max_examples=80, deadline=None)
@given(st.integers(2, 14), SCALES, SEEDS)
def test_ratings_of_two_conditions(n: int, scale: tuple[int, int, int, int], seed: int) -> None:
    printer = Printer(seed)
    measures, sums, raw = [], [0.0, 0.0], []
    for index in range(3):
        scores = ratings(printer, n, 2, scale)
        result, paired = wilcoxon(scores[:, 0], scores[:, 1]), t_paired(scores[:, 0], scores[:, 1])
        tests = []
        if result.p is not None:
            w = (result.details["w_plus"], result.details["w_minus"])
            printed = {"W": printer.figure(float(printer.random.choice(w)), least_digits=1)}
            tests.append(printer.test(result.p, test="wilcoxon", **(printed if printer.random.random() < 0.5 else {})))
            raw.append(result.p)
        if paired.p is not None and paired.statistic is not None and printer.random.random() < 0.5:
            statistic = printer.figure(abs(paired.statistic))
            tests.append(printer.test(paired.p, test="t_paired", t=statistic, df=str(n - 1)))
        sums = [total + float(column.sum()) for total, column in zip(sums, scores.T, strict=True)]
        first, second = scores.mean(axis=0)
        reductions = [{"from": "a", "to": "b", "percent": printer.figure(100 * (1 - second / first))}] if first else []
        measures.append(
            {
                "name": f"scale {index}",
                "scale": written_scale(scale),
                "cells": cells(printer, {"a": scores[:, 0], "b": scores[:, 1]}),
                "reductions": reductions,
                "tests": tests,
            }
        )
    over = {"measures": "scale *", "condition": "a"}
    totals = [
        {"label": "sum", **over, "sum": printer.figure(sums[0])},
        {"label": "mean", **over, "mean": printer.figure(sums[0] / n)},
        {"label": "average", **over, "average": printer.figure(sums[0] / n / 3)},
    ]
    families = [{"label": "scales", "measures": "scale *"}]
    assert not audited({"n": n, "measures": measures, "totals": totals, "families": families})


@settings(max_examples=60, deadline=None)
@given(st.integers(3, 14), st.integers(2, 5), SEEDS)
def test_continuous_measures_of_several_conditions(n: int, k: int, seed: int) -> None:
    printer = Printer(seed)
    values = np.exp(
        printer.random.normal(printer.random.uniform(0, 10), 0.5, (n, 1)) + printer.random.normal(0, 0.4, (n, k))
    )
    names = [f"c{index}" for index in range(k)]
    result = rm_anova(values, ["condition"])[0]
    assert result.p is not None
    assert result.statistic is not None
    corrected = k > 2 and printer.random.random() < 0.6
    epsilon = result.details["epsilon_gg"] if corrected else 1.0
    df = [(k - 1) * epsilon, (k - 1) * (n - 1) * epsilon]
    shown = df if corrected and printer.random.random() < 0.5 else [k - 1, (k - 1) * (n - 1)]
    test = printer.test(
        float(result.details["p_gg"]) if corrected else result.p,
        test=printer.random.choice(["rm_anova", ""]) or None,
        F=printer.figure(result.statistic),
        df=[f"{part:.2f}" if shown is df else str(part) for part in shown],
    )
    ranked = friedman(values)
    assert ranked.p is not None
    other = printer.test(ranked.p, test="friedman", chi2=printer.figure(ranked.statistic or 0), df=str(k - 1))
    described = {
        name: {
            "mean": printer.large(float(column.mean())),
            "sd": printer.large(float(column.std(ddof=1))),
            "rmse": printer.figure(float(np.sqrt(column.mean()))),
        }
        for name, column in zip(names, values.T, strict=True)
    }
    before, after = values[:, 0].mean(), values[:, 1].mean()
    reductions = [
        {"from": "c0", "to": "c1", "percent": printer.figure(100 * (1 - after / before))},
        {"from": "c0", "to": "c1", "percent": printer.figure(100 * (1 - np.sqrt(after / before))), "of": "rmse"},
    ]
    measure = {"name": "m", "scale": {"min": "0"}, "cells": described, "reductions": reductions, "tests": [test, other]}
    assert not audited({"n": n, "measures": [measure]})


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(2, 30), min_size=2, max_size=4), SEEDS)
def test_groups_and_correlations(ns: list[int], seed: int) -> None:
    printer = Printer(seed)
    groups = [printer.random.normal(printer.random.uniform(0, 2), printer.random.uniform(0.5, 3), n) for n in ns]
    names = [f"g{index}" for index in range(len(ns))]
    described = cells(printer, dict(zip(names, groups, strict=True)), with_n=True)
    f = stats.f_oneway(*groups)
    df = [str(len(ns) - 1), str(sum(ns) - len(ns))]
    measures: list[Row] = [
        {
            "name": "anova",
            "cells": described,
            "tests": [printer.test(f.pvalue, test="anova", F=printer.figure(f.statistic), df=df)],
        }
    ]
    for welch in (False, True):
        t = stats.ttest_ind(groups[0], groups[1], equal_var=not welch)
        tests = [
            printer.test(
                t.pvalue,
                test="welch" if welch else "t_independent",
                conditions=names[:2],
                t=printer.figure(t.statistic),
                df=f"{t.df:.{printer.random.integers(0, 3)}f}" if welch else str(ns[0] + ns[1] - 2),
            )
        ]
        measures.append({"name": f"welch {welch}", "cells": described, "tests": tests})
    x, y = printer.random.normal(0, 1, (2, max(ns) + 2))
    r = stats.pearsonr(x, y)
    test = printer.test(r.pvalue, test="correlation", r=printer.figure(r.statistic), df=str(len(x) - 2))
    measures.append({"name": "r", "n": len(x), "tests": [test | {"n": len(x)}]})
    assert not audited({"measures": measures})


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(1e-6, 0.4), min_size=2, max_size=6), st.integers(1, 60), SEEDS)
def test_adjusted_families_and_percentages(raw: list[float], of: int, seed: int) -> None:
    printer = Printer(seed)
    method = str(printer.random.choice(["holm", "bonferroni", "benjamini_hochberg"]))
    measures = []
    for index, (p, after) in enumerate(zip(raw, adjusted(raw, method), strict=True)):
        assert after is not None
        z = printer.figure(float(stats.norm.isf(p / 2)), least_digits=1)
        row: Row = {"z": z, "p": printer.figure(p, least_digits=2), "significant": after < 0.05}
        if printer.random.random() < 0.5:
            row["p_adjusted"] = printer.p(after)
        measures.append({"name": f"m{index}", "tests": [row]})
    families = [{"label": "all", "measures": "m*", "adjust": method}]
    count = int(printer.random.integers(0, of + 1))
    percent = printer.figure(100 * count / of)
    shares = [
        {"label": "a", "of": of, "percent": percent},
        {"label": "b", "of": of, "percent": percent, "count": count},
    ]
    counts = [{"label": "c", "parts": [count, of - count], "total": of}]
    assert not audited({"measures": measures, "families": families, "shares": shares, "counts": counts})
