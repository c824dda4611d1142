"""What the statistical words of a report mean, in one sentence each."""

from __future__ import annotations

import re
from collections.abc import Sequence

_WORDS: Sequence[tuple[str, str, str]] = (
    ("n", r"\bn = \d|^n$", "The number of participants that a figure rests on, or of what is named beside it."),
    ("M", r"\bM = ", "Mean: the sum of the values over their number."),
    ("SD", r"\bSDs?\b", "Standard deviation: how far values typically lie from their mean."),
    ("Median", r"\b[Mm]edian\b", "The value that half of the values lie below."),
    (
        "95 % interval, CI",
        r"95 % (CI|interval)|\[95 %",
        "Confidence interval: computed so that in 95 of 100 such studies it contains the true value.",
    ),
    ("MSE", r"\bMSE\b", "Mean squared error: the mean of the squared distances from the target."),
    ("RMSE", r"\bRMSE\b", "Root mean square error: the root of the mean squared error, in the unit of the distances."),
    ("Baseline", r"\bbaseline\b", "The condition that the others are compared with: the first in study.yaml."),
    (
        "p",
        r"\bp [=<>] |^p$",
        "The probability of a result at least as far from “no difference” as this one if there were no difference.",
    ),
    (
        "Level of significance",
        r"significan",
        "The p below which a difference is called significant; it is chosen before the study.",
    ),
    (
        "p adjusted",
        r"-adjusted|^p adjusted$",
        "p made larger for the number of tests in a family: among many tests, some are significant by chance.",
    ),
    (
        "Holm",
        r"\bHolm\b(?!-Š)",
        "A way of adjusting p: the smallest is multiplied by the number of tests, the next by one less, and so on.",
    ),
    ("Bonferroni", r"\bBonferroni\b", "A way of adjusting p: each is multiplied by the number of tests."),
    (
        "Hochberg",
        r"(?<!-)\bHochberg\b",
        "A way of adjusting p: Holm's factors, from the largest p on; for tests that are independent or rise together.",
    ),
    (
        "Hommel",
        r"\bHommel\b",
        "A way of adjusting p, never to more than Hochberg's; for tests that are independent or rise together.",
    ),
    ("Šidák", r"(?<!-)\bŠidák\b", "A way of adjusting p: exact for independent tests, a little below Bonferroni's."),
    ("Holm-Šidák", r"\bHolm-Šidák\b", "Holm's steps with Šidák's adjustment in each."),
    (
        "Benjamini-Hochberg",
        r"\bBenjamini-Hochberg\b",
        "A way of adjusting p that bounds the share of false findings among the findings.",
    ),
    (
        "Benjamini-Yekutieli",
        r"\bBenjamini-Yekutieli\b",
        "Like Benjamini-Hochberg, but valid however the tests depend on each other; p values are larger.",
    ),
    (
        "Sphericity",
        r"[Ss]phericity|^p corrected$|Greenhouse",
        "The assumption of an ANOVA of three or more conditions that the differences between any two vary equally.",
    ),
    (
        "Greenhouse-Geisser ε, p corrected",
        r"Greenhouse|^p corrected$",
        "ε is 1 where sphericity holds and less where it does not; the corrected p takes it into account.",
    ),
    (
        "Repeated-measures ANOVA (rm ANOVA)",
        r"\brm ANOVA|[Rr]epeated-measures ANOVA",
        "Analysis of variance: asks whether the means of the conditions differ more than is to be expected by chance.",
    ),
    (
        "F",
        r"\bF\(|\bF = ",
        "The statistic of an ANOVA: the variation between conditions divided by the variation by chance. In brackets"
        " its degrees of freedom: how many independent pieces of data it rests on.",
    ),
    ("Follow-up", r"[Ff]ollow-up", "A test of two conditions after a test of all of them."),
    (
        "Paired t test",
        r"[Pp]aired t\b",
        "Asks whether the mean of the participants' differences between two conditions differs from zero.",
    ),
    (
        "t",
        r"\bt\(|\bt = ",
        "A difference or an estimate divided by its standard error. In brackets its degrees of freedom: how many"
        " independent pieces of data it rests on.",
    ),
    (
        "Wilcoxon signed-rank test",
        r"\bWilcoxon\b",
        "Compares two conditions by the ranks of the participants' differences, where ties share their mean rank.",
    ),
    ("W₊", r"W₊", "The sum of the ranks of the differences in which the first condition's value is larger."),
    ("Friedman test", r"\bFriedman\b", "Compares conditions by how each participant's values rank them."),
    (
        "McNemar's test",
        r"McNemar",
        "Of those whose answer differs between two conditions: did as many change one way (b) as the other (c)?",
    ),
    ("Cochran's Q", r"Cochran's Q", "Asks of answers 0 or 1 whether some conditions have more of them than others."),
    (
        "Generalized estimating equations (GEE)",
        r"\bGEE\b|estimating equations",
        "A model of every trial that allows for a person's trials being alike, without saying how.",
    ),
    (
        "Odds ratio, OR",
        r"\bOR = |[Oo]dds ratio",
        "The odds of a 1 (its share over that of 0) under the first condition divided by those under the second.",
    ),
    ("Rate ratio", r"[Rr]ate ratio", "The rate of events under the first condition divided by that under the second."),
    ("χ²", r"χ²", "The statistic of Friedman's test: how far apart the conditions' mean ranks lie."),
    (
        "Aligned rank transform (ART)",
        r"\bART\b|[Aa]ligned rank",
        "An ANOVA of ranks: for each effect the values are ranked after the other effects are taken out.",
    ),
    (
        "Mixed model",
        r"[Mm]ixed model",
        "Uses every value, also those of people who lack others, with a constant for each participant.",
    ),
    (
        "Singular fit",
        r"[Ss]ingular fit",
        "A mixed model that finds no variance between participants, as if each row came from a different person.",
    ),
    (
        "Crossover analysis",
        r"[Cc]rossover",
        "Takes the effect of the period out of the difference between two conditions, and tests for carry-over.",
    ),
    ("Carry-over", r"[Cc]arry-over", "The effect that an earlier condition still has in a later one."),
    (
        "Test of equivalence (TOST)",
        r"\bTOST\b",
        "Asks whether the mean difference lies within stated bounds; p is the larger of two one-sided ones.",
    ),
    (
        "Bayes factor, BF₁₀",
        r"BF₁₀|Bayes factor",
        "How many times as likely the data are if there is a difference (with the stated prior) as if there is none.",
    ),
    (
        "One-sided Bayes factor, BF₊₀ or BF₋₀",
        r"BF[₊₋]₀|One-sided Bayes factor",
        "The same for the expected direction alone: the first condition's values are greater (+) or less (−).",
    ),
    ("Effect size", r"[Ee]ffect size", "How large a difference is, whatever the number of participants."),
    ("η²G", r"η²G", "Generalized eta squared: the share of all variance that the condition explains, from 0 to 1."),
    (
        "η²p",
        r"η²p",
        "Partial eta squared: the effect's share of the variance of effect and error together, from 0 to 1.",
    ),
    ("d_z", r"\bd_z\b", "The mean difference in units of the differences' standard deviation."),
    ("d", r"\bd = ", "The difference of two groups' means over the SD within all groups."),
    ("d_av", r"\bd_av\b", "The difference of two groups' means over the root of the mean of their variances."),
    ("r_rb", r"\br_rb\b", "Rank-biserial correlation: from −1 (second always larger) to 1 (first always larger)."),
    ("W", r"\bW = [.\d]", "Kendall's W: from 0 (participants rank the conditions differently) to 1 (all alike)."),
    ("Estimate", r"\bestimate = ", "A difference or slope estimated by the model, in the unit of the measure."),
    (
        "Geometric mean",
        r"[Gg]eometric mean",
        "The mean of the logarithms, taken back: for values that spread the more the larger they are, as times do.",
    ),
    ("Difference", r"^Difference \[", "The mean under the first condition minus that under the second."),
    ("Reduction", r"^Reduction$", "By how much the mean is lower under the second condition, as a share of the first."),
    (
        "Permutation p",
        r"[Pp]ermutation p\b",
        "The share of all ways to exchange participants' conditions that give a mean difference as far from zero.",
    ),
    (
        "Bootstrap interval",
        r"(?<!moving-block )[Bb]ootstrap",
        "An interval from how the mean difference varies when the participants are drawn anew with replacement.",
    ),
    (
        "Moving-block bootstrap",
        r"moving-block bootstrap",
        "An interval from how an estimate varies when stretches of the recording are drawn anew with replacement.",
    ),
    (
        "Shapiro and Wilk's test",
        r"Shapiro",
        "Asks whether values look normally distributed; a small p speaks against it.",
    ),
    (
        "Q-Q plot",
        r"Q-Q plot",
        "Each value against the one that stands in its place among as many normal ones; normal values follow a line.",
    ),
)
"""A word, where in a text it is used, and what it means, from the simple to the particular."""


def explained(texts: Sequence[str]) -> list[tuple[str, str]]:
    """The words that stand in any of the texts, and what they mean; each text is a paragraph or a cell."""
    lines = "\n".join({text.replace("\n", " ") for text in texts})  # searched once for each word, not once a text
    return [(word, meaning) for word, where, meaning in _WORDS if re.search(where, lines, re.MULTILINE)]
