"""Files of printed figures: their faults, their reference, and a study beside them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import CONTRADICTION, REMARK, VERDICTS
from pipeline.errors import PipelineError
from pipeline.study import printed as publication
from pipeline.study.fields import Frozen
from pipeline.study.printed import load_publication
from tests.pipeline.analysis.audit.printed import EXAMPLE, REFERENCE, file
from tests.pipeline.helpers import Steadyhand

MINIMAL = "source: a paper\nmeasures: [{name: m, cells: {a: {mean: 5}}}]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("measures: [{name: m}]\n", '"source" is missing'),
        ("source: s\n", '"measures" is missing'),
        (MINIMAL + "totls: []\n", 'unknown key "totls"; did you mean "totals"?'),
        (
            "source: s\nmeasures: [{name: m, cells: {a: {maen: 5}}}]\n",
            '"measures.0.cells.a.maen"; did you mean "mean"?',
        ),
        ("source: s\nmeasures: [{name: m, tests: [{f: 5}]}]\n", 'unknown key "measures.0.tests.0.f"'),
        (
            "source: s\nmeasures: [{name: m, cells: {a: {mean: '5,19'}}}]\n",
            "should be a number with its digits as printed",
        ),
        ("source: s\nmeasures: [{name: m, cells: {a: {mean: about 5}}}]\n", "(found 'about 5')"),
        ("source: s\nmeasures: [{name: m, cells: {a: {mean: < 5}}}]\n", "only p may have < or >"),
        ("source: s\nmeasures: [{name: m, cells: {a: {mean: }}}]\n", "should be a number with its digits as printed"),
        (
            "source: s\nmeasures: [{name: m, cells: {a: {mean: [5]}}}]\n",
            "should be a number with its digits as printed",
        ),
        ("source: s\nmeasures: []\n", "measures: needs one or more"),
        ("source: s\nn: twelve\nmeasures: [{name: m}]\n", '"n": input should be a valid integer'),
        ("source: s\nmeasures: [{name: m}, {name: m}]\n", 'measures: name: "m" is listed twice'),
        (
            "source: s\nmeasures: [{name: m, cells: {kinect: {}}, reductions: [{from: kinct, to: a, percent: 5}]}]\n",
            'from: "kinct" is not known; did you mean "kinect"?',
        ),
        ("source: s\nmeasures: [{name: m, tests: [{t: 2, F: 4}]}]\n", "has t and F; give each statistic a test"),
        (
            "source: s\nmeasures: [{name: m, tests: [{F: 4, df: 11}]}]\n",
            "the statistic F has 2 degrees of freedom, and df lists 1",
        ),
        ("source: s\nmeasures: [{name: m, tests: [{W: 4}]}]\n", "only test: wilcoxon has a W"),
        ("source: s\nmeasures: [{name: m, tests: [{test: wilcoxn}]}]\n", "measures.0.tests.0.test"),
        ("source: s\nmeasures: [{name: m, scale: {min: 5, max: 1}}]\n", "min should be less than max"),
        ("source: s\nmeasures: [{name: m, scale: {step: 2, min: 0, max: 5}}]\n", "should be a whole number of steps"),
        ("source: s\nmeasures: [{name: m, scale: {step: 0}}]\n", "step should be more than 0"),
        (
            MINIMAL + "totals: [{label: t, measures: q*, condition: a, sum: 5}]\n",
            'totals: there is no measure "q*"',
        ),
        (MINIMAL + "totals: [{label: t, measures: m, condition: b, sum: 5}]\n", 'totals: condition of "m": "b" is not'),
        (MINIMAL + "totals: [{label: t, measures: m, condition: a}]\n", "needs one of sum, mean and average"),
        ("source: s\nmeasures: [{name: m, tests: [{p: > .05}]}]\n", "line 2: not valid YAML"),
        ("a list\n", "holds no settings"),
    ],
)
def test_a_fault_in_the_file_is_named_with_its_remedy(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(PipelineError) as error:
        load_publication(file(tmp_path, text))
    assert message in str(error.value)
    assert "printed.yaml" in str(error.value)


def models() -> Iterator[type[BaseModel]]:
    for kind in vars(publication).values():
        if isinstance(kind, type) and issubclass(kind, Frozen) and kind is not Frozen:
            yield kind


def test_every_key_and_check_is_in_the_reference(tmp_path: Path) -> None:
    for model in models():
        for name, field in model.model_fields.items():
            assert f"`{field.alias or name}`" in REFERENCE, (model, name)
    for verdict in VERDICTS:
        assert f"| {verdict} |" in REFERENCE
    sources = Path(inspect.getfile(audit)).parent.glob("*.py")
    checks = {check for path in sources for check in re.findall(r'Statement\(\s*"([^"]+)"', path.read_text("utf-8"))}
    assert len(checks) > 12
    for check in checks - {"any"}:
        assert f"| {check} |" in REFERENCE, check


def test_the_example_of_the_reference_gives_what_it_says(tmp_path: Path) -> None:
    findings = audit(load_publication(file(tmp_path, EXAMPLE)))
    assert [(found.check, found.what) for found in findings if found.verdict == CONTRADICTION] == [
        ("recomputed p", "Time on task (s): paired t"),
        ("claim", "Temporal demand: Wilcoxon"),
    ]
    assert [found.follows for found in findings if found.verdict == REMARK] == ["1 of 2 after Holm"]


SETTINGS = """
    conditions: [a, b]
    measures: measures.csv
    printed: printed.yaml
    comparisons: [{measure: m, test: wilcoxon}, {measure: m, test: t_paired}]
"""
MEASURES = "participant,condition,measure,value\n" + "".join(
    f"P{p},{condition},m,{p + (condition == 'b') * (p % 3)}\n" for p in range(1, 7) for condition in "ab"
)


def compared(folder: Callable[..., Path], steadyhand: Steadyhand, measure: str) -> tuple[int, str]:
    text = f"source: s\nn: 6\nmeasures: [{{name: m, measure: m, {measure}}}]\n"
    ran = steadyhand("compare", folder(SETTINGS, **{"measures.csv": MEASURES, "printed.yaml": text}))
    return ran.code, ran.err


def test_a_study_sets_printed_figures_beside_its_own(folder: Callable[..., Path], steadyhand: Steadyhand) -> None:
    cells = "cells: {a: {mean: 3.50, sd: 1.87, median: 3.5}, b: {mean: 4.51, rmse: 2.12}}"
    rest = "reductions: [{from: a, to: b, percent: -28.6}], tests: [{test: t_paired, t: -2.74, df: 5, p: .041}]"
    code, err = compared(folder, steadyhand, f"{cells}, {rest}")
    assert code == 0, err
    rows = steadyhand.results()["printed"]
    beside = {row["what"]: (row["printed"], row["computed"], row["verdict"]) for row in rows if row["check"] is None}
    assert beside == {
        "m, a: mean": ("3.50", "3.50", "agrees"),
        "m, a: sd": ("1.87", "1.87", "agrees"),
        "m, a: median": ("3.5", "3.5", "agrees"),
        "m, b: mean": ("4.51", "4.50", "differs"),
        "m, b: rmse": ("2.12", "2.12", "agrees"),
        "m: reduction of the mean, a to b, %": ("-28.6", "-28.6", "agrees"),
        "m: paired t, t": ("-2.74", "-2.74", "agrees"),
        "m: paired t, p": (".041", "0.041", "agrees"),
    }
    assert {row["check"] for row in rows} > {None, "recomputed p", "degrees of freedom", "reduction"}


@pytest.mark.parametrize(
    ("measure", "message"),
    [
        ("cells: {c: {mean: 5}}", 'printed.yaml: the study\'s results have no condition "c"'),
        (
            "tests: [{test: friedman, p: .05}]",
            'the study\'s results have no test "friedman"; known: wilcoxon, t_paired',
        ),
        ("tests: [{p: .05}]", 'a printed test of "m" matches 2 of the study\'s comparisons; it must match exactly one'),
        ("tests: [{test: t_paired, F: 5, df: [1, 5]}]", 'no statistic_name "F"'),
    ],
)
def test_a_printed_figure_that_the_study_lacks_is_named(
    folder: Callable[..., Path], steadyhand: Steadyhand, measure: str, message: str
) -> None:
    code, err = compared(folder, steadyhand, measure)
    assert code == 2
    assert message in err
