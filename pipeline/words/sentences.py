"""The sentence of a result, made from its row of `comparisons`, in three lengths.

`verdict` says only whether there is a difference; `brief_sentence` is a test's line in a list, without the measure's
name; `full_sentence` is for a paper, with direction, amount, means and evidence. No figure is computed here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from pipeline.statistics import RATIO
from pipeline.statistics.pairs import names_in
from pipeline.study.statistical_tests import TESTS
from pipeline.words.change import change_phrase, difference_phrase, meaningful_reduction
from pipeline.words.comparison import (
    EFFECTS_OF_CONDITION,
    Row,
    contrast,
    decisive_p,
    no_variance_between_participants,
    shift,
    test_label,
    tested_difference,
    uses_logarithms,
)
from pipeline.words.condition_means import StudyFacts, means_of_conditions
from pipeline.words.effect_sizes import effect_size, ratio_to_first
from pipeline.words.evidence import adjusted_p, evidence, statistic_value
from pipeline.words.names import measure_as_subject, unit_of, was
from pipeline.words.numbers import digits_beside, interval, number, p_phrase, percent
from pipeline.words.phrases import listing

_BEFORE_INTERVAL = ", 95 % CI "
_SAME_MEANS = 1e-12
"""Two means that differ relatively by less are the same: it is only rounding that tells them apart."""
_P_DIGITS = 3
"""Decimals of a p value in a sentence, as APA prints it."""


def brief_sentence(row: Row, with_change: bool = True) -> str:
    """`paired t: t(11) = 2.40, p = .0353, d_z = 0.69 [0.05, 1.31], n = 12, reduced by 26.7 %`.

    The measure is not named. `with_change` false leaves out by how much the means differ.
    """
    head = "" if row["contrast"] is None and row["effect"] in EFFECTS_OF_CONDITION else f"{contrast(row)}, "
    if row["status"] != "ok":
        return f"{head}{test_label(row)}: {row['status']} (n = {row['n']})"
    test = "" if TESTS[row["test"]].symbol_names_test and not uses_logarithms(row) else f"{test_label(row)}: "
    if TESTS[row["test"]].question == "evidence":
        test = f"{test_label(row)} (JZS, prior scale {row['details']['prior_scale']:g}): "
    parts = [f"{test}{head}{evidence(row)}", f"n = {row['n']}"]
    if no_variance_between_participants(row):
        parts.append("singular fit: no variance between participants is found")
    if row["mean_difference"] is not None and with_change:
        parts.append(change_phrase(row))
    elif row["effect_size_name"] != RATIO and ratio_to_first(row):
        parts.append(ratio_to_first(row))
    return ", ".join(parts)


def verdict(row: Row, alpha: float) -> str:
    """`the difference is statistically significant at the 5 % level`, or what the test asks instead of that."""
    level = f"at the {100 * alpha:g} % level"
    p = decisive_p(row)
    if TESTS[row["test"]].question == "evidence" and row["status"] == "ok":
        return _times_as_likely(row["statistic"])
    if p is None:
        return "no test is defined"
    if TESTS[row["test"]].question == "equivalence":
        return f"the conditions are {'' if p < alpha else 'not shown to be '}equivalent within the bounds {level}"
    of_pair = row["contrast"] is not None or row["mean_difference"] is not None
    difference = "the difference is" if of_pair else "the differences between conditions are"
    return f"{difference} {'' if p < alpha else 'not '}statistically significant {level}"


def full_sentence(row: Row, facts: StudyFacts) -> str:
    """A row of `comparisons` in APA style, with its direction in words; where the test is undefined, the reason.

    `Completion time was significantly lower with fusion than with kinect (by 6.10 s, 26.7 %; kinect: M = 22.85, …), …`
    """
    what = measure_as_subject(row["measure"])
    if row["status"] != "ok":
        of = "" if row["contrast"] is None and row["effect"] in EFFECTS_OF_CONDITION else f" of {contrast(row)}"
        return f"{what}: {with_article(_test_name(row))}{of} is {row['status']} (n = {row['n']})."
    if TESTS[row["test"]].question == "evidence":
        return _bayes_sentence(row, facts, what)
    if TESTS[row["test"]].question == "equivalence":
        return _equivalence_sentence(row, facts, what)
    pair, difference = _pair(row, facts.conditions), _difference(row)
    if pair is not None and difference is not None:
        return _pair_sentence(row, facts, what, pair, difference)
    return _effect_sentence(row, facts, what)


def finds_nothing_of_a_pair(row: Row, facts: StudyFacts) -> bool:
    """Is this one of several pairs, whose difference is not significant? Such may share a sentence."""
    return (
        row["status"] == "ok"
        and row["contrast"] is not None
        and TESTS[row["test"]].tests_difference
        and not ratio_to_first(row)
        and _pair(row, facts.conditions) is not None
        and not _significant(row, facts.alpha)
    )


def no_difference_sentence(rows: Sequence[Row], facts: StudyFacts) -> tuple[list[str], str]:
    """`Effort did not differ significantly between a and b`, `, or between a and c`: a part for each row, then its end.

    Where these are all pairs of the conditions there is one part, `… between any two conditions`. The end is the
    evidence they share, ` (Holm-adjusted p ≥ .057, n = 16)`: their table has the statistics of each. `rows` are pairs
    of one measure and test for which `finds_nothing_of_a_pair`.
    """
    pairs = [pair for row in rows if (pair := _pair(row, facts.conditions)) is not None]
    head = f"{measure_as_subject(rows[0]['measure'])} did not differ significantly between"
    first, *others = [f"{pair.first} and {pair.second}{pair.where}" for pair in pairs]
    parts = [f"{head} {first}", *(f", or between {names}" for names in others)]
    every_pair = set(combinations(facts.conditions, 2))
    if len(pairs) == len(every_pair) and {(pair.first, pair.second) for pair in pairs} == every_pair:
        parts = [f"{head} any two conditions"]
    least = min(rows, key=lambda row: decisive_p(row) or 0.0)
    digits = _p_digits({**least, "p": decisive_p(least), "details": None}, facts.alpha)
    p = p_phrase(least["p"], digits=digits) if least["p_adjusted"] is None else adjusted_p(least, digits)
    counts = sorted({row["n"] for row in rows})
    n = f"n = {counts[0]}" + (f" to {counts[-1]}" if len(counts) > 1 else "")
    return parts, f" ({p.replace(' = ', ' ≥ ')}, {n})"


@dataclass(frozen=True)
class _Pair:
    """The two things that a row compares.

    `preposition` goes before either: with a condition, in a period, for a group, at a level. `where` is the level of
    another factor at which they are compared, as ` at near`, or empty.
    """

    first: str
    second: str
    preposition: str
    where: str = ""


def _test_name(row: Row) -> str:
    name = TESTS[row["test"]].long_name
    if row["contrast"] is not None:
        name = {"rm_anova": "follow-up t test", "cochran_q": "follow-up, McNemar's test"}.get(row["test"], name)
        if row["test"] in ("mixed_anova", "anova_welch"):
            name = f"follow-up, {row['method'].partition(',')[0]}"
    return f"{name} of the logarithms" if uses_logarithms(row) else name


def with_article(name: str) -> str:
    """`the paired t test`, `McNemar's test`."""
    return name if "'s " in name else f"the {name}"


def _pair_sentence(row: Row, facts: StudyFacts, what: str, pair: _Pair, difference: float) -> str:
    """Which of two is lower, by how much, and whether that is significant."""
    amount = _amount(row, difference)
    side = "the same in both"
    if difference:
        side = f"{'lower' if difference > 0 else 'higher'} {pair.preposition} {pair.second}"
    if _significant(row, facts.alpha) and difference:
        head = f"{what} {was(what)} significantly {side} than {pair.preposition} {pair.first}{pair.where}"
        figures = [amount, *means_of_conditions(row, facts)]
    else:
        head = f"{what} did not differ significantly between {pair.first} and {pair.second}{pair.where}"
        figures = [amount if ratio_to_first(row) else f"{side} {amount}".strip(), *means_of_conditions(row, facts)]
    in_brackets = "; ".join(figure for figure in figures if figure)
    return f"{head}{f' ({in_brackets})' if in_brackets else ''}, {_evidence(row, facts)}."


def _amount(row: Row, difference: float) -> str:
    """`by 6.10 s, 26.7 %`: the estimate, or else the difference of the means.

    Ranks can differ in the other direction than means; the sentence then says so instead of contradicting itself.
    """
    if ratio_to_first(row):
        return ratio_to_first(row, _BEFORE_INTERVAL)
    value = row["effect_size"] if row["effect_size_name"] == "estimate" else row["mean_difference"]
    if value is None or difference == 0:
        return ""
    size = difference_phrase({**row, "mean_difference": value})
    if value * difference < 0:
        return f"by ranks, while its mean was {'lower' if value > 0 else 'higher'} by {size}"
    size = _with_interval(row, size, difference)
    reduction = None if row["effect_size_name"] == "estimate" else meaningful_reduction(row)
    return f"by {size}" + ("" if reduction is None else f", {percent(abs(reduction))}")


def _with_interval(row: Row, size: str, difference: float) -> str:
    """`11.80 s, 95 % CI [4.32, 19.28]`: the size of a difference, with its interval where the test gives one.

    Of a rank test it is the shift, unless that goes another way than the `difference` of ranks.
    """
    shifted = shift(row)
    if shifted is not None and shifted[0] * difference <= 0:
        return size
    value, low, high = tested_difference(row) if shifted is None else shifted
    if value is None or low is None or high is None or TESTS[row["test"]].values != "measurements":
        return size
    bounds = (low, high) if value > 0 else (-high, -low)
    digits = digits_beside(2, value, *bounds)
    amount = f"{number(abs(value), digits)} {unit_of(row['measure'])}".strip()
    of = "" if shifted is None else ", Hodges-Lehmann shift"
    return f"{amount}{_BEFORE_INTERVAL}{interval(*bounds, digits)}{of}"


def _effect_sentence(row: Row, facts: StudyFacts, what: str) -> str:
    """An effect without a direction: of several conditions, of another factor, of an interaction."""
    significant = _significant(row, facts.alpha)
    if row["effect"] in EFFECTS_OF_CONDITION and row["contrast"] is None:
        verb = "differed significantly" if significant else "did not differ significantly"
        means = "; ".join(means_of_conditions(row, facts))
        among = f"between {listing(list(facts.conditions))}{f' ({means})' if means else ''}"
        return f"{what} {verb} {among}, {_evidence(row, facts)}."
    kind = "interaction" if ":" in row["effect"] and row["contrast"] is None else "effect"
    verb = "was" if significant else "was not"
    return f"{what}: the {kind} of {contrast(row)} {verb} statistically significant, {_evidence(row, facts)}."


def _equivalence_sentence(row: Row, facts: StudyFacts, what: str) -> str:
    """Whether the mean difference lies within the bounds."""
    details, pair = row["details"], _pair(row, facts.conditions)
    unit = unit_of(row["measure"])
    between = f"between {pair.first} and {pair.second}" if pair else f"of {contrast({**row, 'details': None})}"
    bounds = f"{interval(*details['bounds'])} {unit}".strip()
    shown = "lies" if _significant(row, facts.alpha) else "was not shown to lie"
    inside = f"90 % CI {interval(*details['ci90_difference'])}" if details.get("ci90_difference") else ""
    mean = f"{number(row['mean_difference'])} {unit}".strip()
    parts = [mean, inside] if inside else [mean]
    evident = f"two one-sided t tests, {evidence(row, _p_digits(row, facts.alpha), _BEFORE_INTERVAL)}, n = {row['n']}"
    return f"{what}: the mean difference {between} ({', '.join(parts)}) {shown} within {bounds}, {evident}."


def _bayes_sentence(row: Row, facts: StudyFacts, what: str) -> str:
    """The Bayes factor in words, with its prior and the effect size."""
    pair, factor = _pair(row, facts.conditions), row["statistic"]
    between = f"between {pair.first} and {pair.second}" if pair else f"of {contrast(row)}"
    # The factor is missing where it is larger than any number a computer holds.
    beyond_floats = factor is None
    figure = f"ln BF₁₀ = {number(row['details']['log_bf10'])}" if beyond_floats else f"BF₁₀ = {statistic_value(row)}"
    prior = f"Cauchy prior of scale {row['details']['prior_scale']:g}"
    likely = _times_as_likely(factor, f" {between}")
    return f"{what}: {likely}, {figure} ({prior}), {effect_size(row, _BEFORE_INTERVAL)}, n = {row['n']}."


def _times_as_likely(factor: float | None, between: str = "") -> str:
    """`the data are 23.75 times as likely under no difference as under one`: a Bayes factor below 1 is turned round."""
    likelier, other = ("no difference", "one") if factor is not None and factor < 1 else ("a difference", "none")
    times = "more than 10³⁰⁸" if factor is None else number(factor if factor >= 1 else 1 / factor)
    return f"the data are {times} times as likely under {likelier}{between} as under {other}"


def _evidence(row: Row, facts: StudyFacts) -> str:
    """The test's name where the letter of its statistic does not say it, the figures, and n."""
    test = ""
    if row["test"] == "wilcoxon":
        exact_or_normal = row["method"].split(", ")[0].split(" ")[0]
        test = f"{exact_or_normal} Wilcoxon signed-rank test, "
    elif row["test"] == "rm_anova" and row["contrast"] is not None:
        test = "follow-up of the logarithms, " if uses_logarithms(row) else "follow-up, "
    elif not TESTS[row["test"]].symbol_names_test or uses_logarithms(row):
        test = f"{_test_name(row)}, "
    # Where the amount in the sentence is a ratio to the first condition already, it is not repeated as effect size.
    stated = row["effect_size_name"] == RATIO and _pair(row, facts.conditions) is not None and ratio_to_first(row)
    with_effect_size = {**row, "effect_size": None, "ci_low": None} if stated else row
    figures = evidence(with_effect_size, _p_digits(row, facts.alpha), _BEFORE_INTERVAL)
    singular = ", singular fit" if no_variance_between_participants(row) else ""
    return f"{test}{figures}, n = {row['n']}{singular}"


def _p_digits(row: Row, alpha: float) -> int:
    """Decimals of p: one more where three would round it to the other side of the level (.0496 to .050)."""
    details = row["details"] or {}
    known = [p for p in (row["p"], row["p_adjusted"], details.get("p_gg")) if p is not None]
    crosses = any((round(p, _P_DIGITS) < alpha) != (p < alpha) for p in known)
    return _P_DIGITS + 1 if crosses else _P_DIGITS


def _significant(row: Row, alpha: float) -> bool:
    p = decisive_p(row)
    return p is not None and p < alpha


def _difference(row: Row) -> float | None:
    """First minus second, whose sign is the direction: by ranks, as estimated by a model, or of the means."""
    if row["test"] == "wilcoxon" or row["effect_size_name"] == "estimate":
        return None if row["effect_size"] is None else float(row["effect_size"])
    if ratio_to_first(row):
        return float(row["details"]["log_ratio"])
    if row["mean_difference"] is None:
        return None
    same = row["reduction"] is not None and abs(row["reduction"]) < _SAME_MEANS
    return 0.0 if same else float(row["mean_difference"])


def _pair(row: Row, conditions: Sequence[str]) -> _Pair | None:
    """The two things that a row compares, or None.

    A contrast is written "a - b". Where the names of conditions hold " - " themselves, it may be read in two ways.
    """
    of_condition = row["effect"] in EFFECTS_OF_CONDITION or row["effect"].startswith("condition:")
    if row["contrast"] is None:
        both = len(conditions) == 2 and row["effect"] in EFFECTS_OF_CONDITION
        return _Pair(conditions[0], conditions[1], "with") if both else None
    compared, where = row["contrast"], ""
    if ":" in row["effect"] and " | " in compared:
        compared, where = compared.rsplit(" | ", 1)
        where = f" at {where}"
    if of_condition or ":" in row["effect"]:
        matching = [pair for pair in combinations(conditions, 2) if " - ".join(pair) == compared]
        if len(matching) == 1:
            return _Pair(*matching[0], "with", where)
        if matching or not where:
            return None
    names = names_in(compared)
    if names is None or row["effect"] == "carry-over":
        return None
    of_groups = TESTS[row["test"]].design in ("between", "mixed")
    preposition = "in period" if row["effect"] == "period" else "for" if of_groups else "at"
    return _Pair(*names, preposition, where)
