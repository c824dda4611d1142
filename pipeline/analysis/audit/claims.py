"""What a text calls significant, against its level and over a family of tests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.p_values import Bounds, meets
from pipeline.analysis.audit.phrases import label, written, written_p
from pipeline.analysis.audit.recomputed import p_left_open
from pipeline.statistics.multiplicity import adjusted
from pipeline.study.printed import Family, Measure, PrintedTest, Publication
from pipeline.study.rounded import Rounded
from pipeline.words.phrases import counted

Labelled = tuple[Measure, PrintedTest]
_ROUND_OFF = 1e-9  # relative: of an adjustment's own arithmetic
_NAMES = {"holm": "Holm", "bonferroni": "Bonferroni", "benjamini_hochberg": "Benjamini and Hochberg"}


def claim_findings(publication: Publication) -> Iterator[Finding]:
    """Each claim against the level; claims in a family with adjusted p are checked with the family."""
    judged = {
        id(test)
        for family in publication.families
        if family.adjust != "none"
        for _, test in _tests_of(publication, family)
    }
    for measure, test in publication.tests():
        if test.significant is not None and (id(test) not in judged or test.p_adjusted is not None):
            yield _claim(publication, measure, test, test.significant)


def below(p: Rounded | None, bounds: Bounds | None, alpha: Fraction) -> bool | None:
    """Is p below the level? None where rounding leaves it open. `bounds`, from the statistic, narrow p."""
    low: Fraction | float = 0 if p is None else p.interval.low
    high: Fraction | float = 1 if p is None else p.interval.high
    if p is not None and p.relation == "<" and p.value <= alpha:
        return True
    if p is not None and p.relation == ">" and p.value >= alpha:
        return False
    if bounds is not None and (p is None or meets(bounds, p.interval)):
        low, high = max(low, bounds[0]), min(high, bounds[1])
    if high < alpha:
        return True
    return False if low > alpha else None


def _level(publication: Publication, test: PrintedTest) -> Fraction:
    return (test.alpha or publication.alpha).value


def _claim(publication: Publication, measure: Measure, test: PrintedTest, significant: bool) -> Finding:
    p, n = test.p_adjusted or test.p, publication.n_of(measure, test)
    bounds = p_left_open(test, n) if test.p_adjusted is None else None
    said = "significant" if significant else "not significant"
    alpha = _level(publication, test)
    if p is None and (bounds is None or test.statistic is None):
        bare = Statement("claim", label(measure, test), f"called {said}")
        return bare.unchecked("neither p nor a statistic from which it follows is printed")
    figure = written_p(p) if p is not None else written(*test.statistic, test) if test.statistic else ""
    statement = Statement("claim", label(measure, test), f"{figure}, called {said}")
    is_below = below(p, bounds, alpha)
    if is_below is None:
        return statement.unchecked(f"{figure} may lie on either side of {float(alpha):g}")
    follows = "significant" if is_below else "not significant"
    explanation = f"{figure} is {'below' if is_below else 'not below'} the level of {float(alpha):g}"
    return statement.judge(is_below == significant, follows, explanation)


def family_findings(publication: Publication, family: Family) -> Iterator[Finding]:
    """A family's tests with p adjusted over them: against what the text says, or as a remark where it adjusted none."""
    all_tests = _tests_of(publication, family)
    tests = [(measure, test) for measure, test in all_tests if test.p is not None]
    how = f"by {_NAMES[family.adjust]}" if family.adjust != "none" else "not said to be adjusted"
    statement = Statement("multiplicity", family.label, f"p of {counted(len(all_tests), 'test')}, {how}")
    if family.adjust == "none" and any(test.p_adjusted is not None for _, test in all_tests):
        yield statement.unchecked("adjusted p values are printed; `adjust` should say by which method")
    elif len(tests) < 2 or (len(tests) < len(all_tests) and family.adjust != "none"):
        yield statement.unchecked("needs the p values of all its tests, and at least two tests")
    elif family.adjust == "none":
        yield _by_holm(publication, statement, tests)
    else:
        for (measure, test), bounds in zip(tests, _adjusted(tests, family.adjust), strict=True):
            yield from _adjusted_findings(publication, family, measure, test, bounds)


def _tests_of(publication: Publication, family: Family) -> list[Labelled]:
    return [(measure, test) for measure in publication.named(family.measures) for test in measure.tests]


def _adjusted(tests: Sequence[Labelled], method: str) -> list[Bounds]:
    """Adjusted p values grow with each p, so bounds give bounds."""
    intervals = [test.p.interval for _, test in tests if test.p is not None]
    lows = adjusted([max(0.0, float(interval.low)) for interval in intervals], method)
    highs = adjusted([min(1.0, float(interval.high)) for interval in intervals], method)
    return [
        ((low or 0.0) * (1 - _ROUND_OFF), (high or 0.0) * (1 + _ROUND_OFF))
        for low, high in zip(lows, highs, strict=True)
    ]


def _by_holm(publication: Publication, statement: Statement, tests: Sequence[Labelled]) -> Finding:
    """Which of those called significant (or below the level) stay so after Holm."""
    called, lost = [], []
    for (measure, test), bounds in zip(tests, _adjusted(tests, "holm"), strict=True):
        alpha, name = _level(publication, test), measure.name if len(measure.tests) == 1 else label(measure, test)
        if test.significant or (test.significant is None and below(test.p, None, alpha)):
            called.append(name)
            if bounds[0] > alpha:
                lost.append(name)
    if not called:
        return statement.judge(True, "none significant", "no test is called significant")
    if not lost:
        return statement.judge(True, f"{len(called)} after Holm", f"all {len(called)} called significant stay so")
    explanation = f"not below the level after Holm over {counted(len(tests), 'test')}: {', '.join(lost)}"
    return statement.remark(f"{len(called) - len(lost)} of {len(called)} after Holm", explanation)


def _adjusted_findings(
    publication: Publication, family: Family, measure: Measure, test: PrintedTest, bounds: Bounds
) -> Iterator[Finding]:
    """The publication's own adjustment: its printed adjusted p, and its claim."""
    if test.p is None:
        return
    name = f"{family.label}, {_NAMES[family.adjust]}"
    if test.p_adjusted is not None:
        printed = f"{written_p(test.p)}, adjusted {written_p(test.p_adjusted)}"
        statement = Statement("multiplicity", label(measure, test), printed)
        follows = test.p_adjusted.span(*bounds)
        yield statement.judge(meets(bounds, test.p_adjusted.interval), follows, name)
    elif test.significant is not None:
        said = "significant" if test.significant else "not significant"
        statement = Statement("claim", label(measure, test), f"{written_p(test.p)}, called {said}")
        is_below = below(None, bounds, _level(publication, test))
        if is_below is None:
            yield statement.unchecked(f"{name}: the adjusted p may lie on either side of the level")
        else:
            follows = "significant" if is_below else "not significant"
            yield statement.judge(is_below == test.significant, follows, f"{name}: adjusted p {test.p.span(*bounds)}")
