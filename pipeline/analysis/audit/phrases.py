"""Printed tests as text."""

from __future__ import annotations

from pipeline.study.printed import Measure, PrintedTest, Symbol
from pipeline.study.rounded import Rounded
from pipeline.study.statistical_tests import TESTS


def label(measure: Measure, test: PrintedTest) -> str:
    """A test's measure, contrast, effect and name: `Time: kinect - fusion, paired t test`."""
    known = TESTS.get(test.test or "")
    name = known.label if known else (test.test or "").replace("_", " ")
    named = ", ".join(part for part in (test.contrast, test.effect, name) if part)
    return f"{measure.name}: {named}" if named else measure.name


def written_p(p: Rounded) -> str:
    """`p = 0.0508`, `p < .001`."""
    return f"p = {p.text}" if p.relation == "=" else f"p {p.text}"


def written(symbol: Symbol, statistic: Rounded, test: PrintedTest) -> str:
    """`F(1, 11) = 10.86`."""
    df = f"({', '.join(part.text for part in test.df)})" if test.df else ""
    return f"{'χ²' if symbol == 'chi2' else symbol}{df} = {statistic.text}"


def written_effect(test: PrintedTest, figure: Rounded, name: str) -> str:
    """`F(1, 11) = 10.86, η²p = .50`."""
    return f"{written(*test.statistic, test)}, {name} = {figure.text}" if test.statistic else f"{name} = {figure.text}"
