"""The records of statistical tests: names, options, what each assumes, and which publications to cite.

One record per test. The names that study.yaml takes, labels, the methods text, cautions and references follow from
it. Which function computes it stands in pipeline/analysis/comparisons.py, so that a change of that arithmetic does not
count as a change of every stage that reads study.yaml; a test holds the two lists against each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Design = Literal["within", "between", "mixed", "either"]
Values = Literal["measurements", "answers", "counts"]
Question = Literal["difference", "equivalence", "evidence"]


@dataclass(frozen=True)
class StatisticalTest:
    """A test of study.yaml.

    `label` is used in tables, `long_name` in sentences, `methods_text` in the methods paragraph. `options` are the keys
    of an entry that only some tests take. `symbol_names_test` is true where the statistic's symbol is name enough: W₊.
    The p of a test whose `question` is not "difference" says nothing about a difference. `values` are what it takes:
    measurements, answers that are 0 or 1, or counts. `followed_up_by` names the tests of the pairs after it.
    `libraries` are those that compute part of it, beside NumPy and SciPy.
    """

    name: str
    label: str
    long_name: str
    methods_text: str
    options: tuple[str, ...] = ()
    assumes_normality: bool = False
    assumes_sphericity: bool = False
    ranks_aligned: bool = False
    complete_cases: bool = True
    symbol_names_test: bool = False
    question: Question = "difference"
    design: Design = "within"
    values: Values = "measurements"
    followed_up_by: str = "t tests"
    cite: tuple[str, ...] = ()
    cited_for: str = ""
    libraries: tuple[str, ...] = ()

    @property
    def tests_difference(self) -> bool:
        """Whether a small p is evidence for a difference."""
        return self.question == "difference"


TESTS: Mapping[str, StatisticalTest] = {
    test.name: test
    for test in (
        StatisticalTest(
            "rm_anova",
            "rm ANOVA",
            "repeated-measures ANOVA",
            "repeated-measures ANOVA (generalized η²)",
            options=("within", "follow_up", "transform"),
            assumes_normality=True,
            assumes_sphericity=True,
            symbol_names_test=True,
        ),
        StatisticalTest(
            "t_paired",
            "paired t",
            "paired t test",
            "paired t tests (two-sided; d_z with its noncentral-t interval)",
            options=("transform", "bootstrap", "permutation", "seed"),
            assumes_normality=True,
        ),
        StatisticalTest(
            "wilcoxon",
            "Wilcoxon",
            "Wilcoxon signed-rank test",
            "Wilcoxon signed-rank tests (two-sided; rank-biserial correlation)",
            options=("zeros", "bootstrap", "permutation", "seed"),
            symbol_names_test=True,
            cite=("wilcoxon1945",),
            cited_for="signed-rank test",
        ),
        StatisticalTest(
            "friedman",
            "Friedman",
            "Friedman test",
            "Friedman's test (Kendall's W)",
            symbol_names_test=True,
            cite=("friedman1937",),
        ),
        StatisticalTest(
            "art_anova",
            "ART ANOVA",
            "aligned rank transform",
            "ANOVA on aligned ranks (ART; partial η²)",
            options=("within", "follow_up"),
            ranks_aligned=True,
            cite=("wobbrock2011",),
            libraries=("pingouin",),
        ),
        StatisticalTest(
            "mixed_model",
            "mixed model",
            "mixed model",
            "linear mixed models with a random intercept for each participant"
            " (REML, Satterthwaite's degrees of freedom)",
            options=("follow_up", "fixed", "random", "transform"),
            complete_cases=False,
            cite=("laird1982", "satterthwaite1946"),
        ),
        StatisticalTest(
            "mcnemar",
            "McNemar",
            "McNemar's test",
            "McNemar's tests of one answer of each participant in each condition (exact, two-sided; odds ratio)",
            values="answers",
            cite=("mcnemar1947",),
            libraries=("statsmodels",),
        ),
        StatisticalTest(
            "cochran_q",
            "Cochran's Q",
            "Cochran's Q test",
            "Cochran's Q test of one answer of each participant in each condition (η²Q)",
            options=("follow_up",),
            values="answers",
            followed_up_by="McNemar's tests",
            cite=("cochran1950",),
            libraries=("statsmodels",),
        ),
        StatisticalTest(
            "gee_logit",
            "logistic GEE",
            "logistic model",
            "logistic models of every trial by generalized estimating equations, participants being the clusters"
            " (Mancl and DeRouen's standard errors; odds ratio)",
            options=("follow_up",),
            complete_cases=False,
            design="either",
            values="answers",
            cite=("liang1986", "mancl2001"),
            libraries=("statsmodels",),
        ),
        StatisticalTest(
            "gee_poisson",
            "Poisson GEE",
            "Poisson model",
            "log-linear models of the rate of events by generalized estimating equations, participants being the"
            " clusters (Mancl and DeRouen's standard errors; rate ratio)",
            options=("follow_up", "exposure"),
            complete_cases=False,
            design="either",
            values="counts",
            cite=("liang1986", "mancl2001"),
            libraries=("statsmodels",),
        ),
        StatisticalTest(
            "crossover",
            "crossover",
            "crossover analysis",
            "the analysis of a 2 × 2 crossover (treatment, period, carry-over)",
            assumes_normality=True,
            cite=("jones2014",),
        ),
        StatisticalTest(
            "tost",
            "equivalence (TOST)",
            "test of equivalence",
            "two one-sided paired t tests of equivalence (TOST)",
            options=("bounds",),
            assumes_normality=True,
            question="equivalence",
            cite=("schuirmann1987",),
        ),
        StatisticalTest(
            "bayes_t",
            "Bayes factor",
            "Bayes factor",
            "JZS Bayes factors of the paired difference",
            options=("prior_scale",),
            assumes_normality=True,
            question="evidence",
            cite=("rouder2009",),
        ),
        StatisticalTest(
            "t_welch",
            "Welch's t",
            "Welch's t test",
            "Welch's t tests between groups (two-sided; d_av, over the root of the mean of the variances, with its"
            " noncentral-t interval)",
            options=("between", "transform", "bootstrap", "permutation", "seed"),
            assumes_normality=True,
            design="between",
            cite=("welch1947",),
            libraries=("pingouin",),
        ),
        StatisticalTest(
            "mann_whitney",
            "Mann-Whitney",
            "Mann-Whitney test",
            "Mann-Whitney tests between groups (two-sided; rank-biserial correlation, Hodges-Lehmann shift)",
            options=("between", "bootstrap", "permutation", "seed"),
            symbol_names_test=True,
            design="between",
            cite=("mann1947",),
        ),
        StatisticalTest(
            "anova_welch",
            "Welch's ANOVA",
            "Welch's analysis of variance",
            "Welch's analysis of variance between groups (partial η²)",
            options=("between", "follow_up"),
            assumes_normality=True,
            design="between",
            cite=("welch1951",),
            libraries=("pingouin",),
        ),
        StatisticalTest(
            "kruskal",
            "Kruskal-Wallis",
            "Kruskal-Wallis test",
            "the Kruskal-Wallis test between groups (rank ε²)",
            options=("between", "follow_up"),
            symbol_names_test=True,
            design="between",
            followed_up_by="Mann-Whitney tests",
            cite=("kruskal1952",),
            libraries=("pingouin",),
        ),
        StatisticalTest(
            "mixed_anova",
            "mixed ANOVA",
            "mixed analysis of variance",
            "mixed analysis of variance, groups between and conditions within participants (type III; generalized η²)",
            options=("within", "between", "follow_up", "transform"),
            assumes_normality=True,
            assumes_sphericity=True,
            design="mixed",
            libraries=("pingouin",),
        ),
    )
}
"""Every test by its name in study.yaml, in the order in which they are listed to people."""


@dataclass(frozen=True)
class Adjustment:
    """A way of adjusting the p values of a family of tests: its name in study.yaml, and its label."""

    name: str
    label: str
    cite: str


ADJUSTMENTS: Mapping[str, Adjustment] = {
    adjustment.name: adjustment
    for adjustment in (
        Adjustment("holm", "Holm", "holm1979"),
        Adjustment("bonferroni", "Bonferroni", "dunn1961"),
        Adjustment("hochberg", "Hochberg", "hochberg1988"),
        Adjustment("hommel", "Hommel", "hommel1988"),
        Adjustment("sidak", "Šidák", "sidak1967"),
        Adjustment("holm_sidak", "Holm-Šidák", "holland1987"),
        Adjustment("benjamini_hochberg", "Benjamini-Hochberg", "benjamini1995"),
        Adjustment("benjamini_yekutieli", "Benjamini-Yekutieli", "benjamini2001"),
    )
}
"""Every adjustment by its name in study.yaml."""


TUKEY = "tukey"
"""A way to follow up, not to adjust: a test of all pairs of groups together, which has p values of its own."""


def tests_that_take(option: str) -> list[str]:
    """The tests that take a key of an entry."""
    return [test.name for test in TESTS.values() if option in test.options]
