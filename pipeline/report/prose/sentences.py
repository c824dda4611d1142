"""A comparison as a sentence to paste, written from its row: direction, amount, evidence. No figure is computed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from pipeline.statistics import RATIO
from pipeline.statistics.pairs import names_in
from pipeline.study.statistical_tests import TESTS, Values
from pipeline.tables.table import Row
from pipeline.words import (
    EFFECTS_OF_CONDITION,
    contrast,
    decisive_p,
    difference_phrase,
    effect_size,
    evidence,
    finds_no_variance_between_people,
    interval,
    listing,
    number,
    of_logarithms,
    percent,
    ratio_to_first,
    reduction_of,
    statistic_value,
    subject,
    unit_of,
)

_BEFORE_INTERVAL = ", 95 % CI "
_ROUND_OFF = 1e-12  # of the mean: what is left where two means are the same
_DIGITS = 3  # of p, as APA prints it


@dataclass(frozen=True)
class StudyFacts:
    """What sentences need beside their row: conditions in order, level, descriptives by measure and condition."""

    conditions: tuple[str, ...]
    alpha: float
    descriptives: Mapping[tuple[str, str], Row]


@dataclass(frozen=True)
class _Pair:
    """Two things compared: `with` conditions, `in` periods, `at` levels; and under what else."""

    first: str
    second: str
    among: str
    where: str = ""


def study_facts(conditions: Sequence[str], alpha: float, descriptives: Sequence[Row]) -> StudyFacts:
    """The facts of a study that sentences need."""
    return StudyFacts(tuple(conditions), alpha, {(row["measure"], row["condition"]): row for row in descriptives})


def sentence(row: Row, facts: StudyFacts) -> str:
    """A row of `comparisons` in APA style, with its direction in words; where it is undefined, the reason."""
    what = subject(row["measure"])
    if row["status"] != "ok":
        of = "" if row["contrast"] is None and row["effect"] in EFFECTS_OF_CONDITION else f" of {contrast(row)}"
        return f"{what}: {with_article(_test(row))}{of} is {row['status']} (n = {row['n']})."
    if TESTS[row["test"]].question == "evidence":
        return _bayes(row, facts, what)
    if TESTS[row["test"]].question == "equivalence":
        return _equivalence(row, facts, what)
    pair, difference = _pair(row, facts.conditions), _difference(row)
    if pair is not None and difference is not None:
        return _directed(row, facts, what, pair, difference)
    return _effect(row, facts, what)


def _test(row: Row) -> str:
    follows_up = row["test"] == "rm_anova" and row["contrast"] is not None
    named = "follow-up t test" if follows_up else TESTS[row["test"]].long_name
    if row["test"] == "cochran_q" and row["contrast"] is not None:
        named = "follow-up, McNemar's test"
    return f"{named} of the logarithms" if of_logarithms(row) else named


def with_article(name: str) -> str:
    """`the paired t test`, `McNemar's test`."""
    return name if "'s " in name else f"the {name}"


def _directed(row: Row, facts: StudyFacts, what: str, pair: _Pair, difference: float) -> str:
    """Which of two is lower, by how much, and whether that is significant."""
    amount = _amount(row, difference)
    side = f"{'lower' if difference > 0 else 'higher'} {pair.among} {pair.second}" if difference else "the same in both"
    if _significant(row, facts.alpha) and difference:
        head = f"{what} was significantly {side} than {pair.among} {pair.first}{pair.where}"
        inside = [amount, *_means(row, facts)]
    else:
        head = f"{what} did not differ significantly between {pair.first} and {pair.second}{pair.where}"
        inside = [amount if ratio_to_first(row) else f"{side} {amount}".strip(), *_means(row, facts)]
    said = "; ".join(part for part in inside if part)
    return f"{head}{f' ({said})' if said else ''}, {_evidence(row, facts)}."


def _amount(row: Row, difference: float) -> str:
    """`by 6.10 s, 26.7 %`: the estimate or the difference of the means, where it goes the way that was tested."""
    if ratio_to_first(row):
        return ratio_to_first(row, _BEFORE_INTERVAL)
    value = row["effect_size"] if row["effect_size_name"] == "estimate" else row["mean_difference"]
    if value is None or difference == 0:
        return ""
    size = difference_phrase({**row, "mean_difference": value})
    if value * difference < 0:
        return f"by ranks, while its mean was {'lower' if value > 0 else 'higher'} by {size}"
    reduction = None if row["effect_size_name"] == "estimate" else reduction_of(row)
    return f"by {size}" + ("" if reduction is None else f", {percent(abs(reduction))}")


def _effect(row: Row, facts: StudyFacts, what: str) -> str:
    """An effect without a direction: of several conditions, of another factor, of an interaction."""
    found = _significant(row, facts.alpha)
    if row["effect"] in EFFECTS_OF_CONDITION and row["contrast"] is None:
        verb = "differed significantly" if found else "did not differ significantly"
        means = "; ".join(_means(row, facts))
        among = f"between {listing(list(facts.conditions))}{f' ({means})' if means else ''}"
        return f"{what} {verb} {among}, {_evidence(row, facts)}."
    kind = "interaction" if ":" in row["effect"] and row["contrast"] is None else "effect"
    verb = "was" if found else "was not"
    return f"{what}: the {kind} of {contrast(row)} {verb} statistically significant, {_evidence(row, facts)}."


def _equivalence(row: Row, facts: StudyFacts, what: str) -> str:
    """Whether the mean difference lies within the bounds."""
    details, pair = row["details"], _pair(row, facts.conditions)
    unit = unit_of(row["measure"])
    between = f"between {pair.first} and {pair.second}" if pair else f"of {contrast({**row, 'details': None})}"
    bounds = f"{interval(*details['bounds'])} {unit}".strip()
    shown = "lies" if _significant(row, facts.alpha) else "was not shown to lie"
    inside = f"90 % CI {interval(*details['ci90_difference'])}" if details.get("ci90_difference") else ""
    mean = f"{number(row['mean_difference'])} {unit}".strip()
    parts = [mean, inside] if inside else [mean]
    evident = f"two one-sided t tests, {evidence(row, _digits(row, facts.alpha), _BEFORE_INTERVAL)}, n = {row['n']}"
    return f"{what}: the mean difference {between} ({', '.join(parts)}) {shown} within {bounds}, {evident}."


def _bayes(row: Row, facts: StudyFacts, what: str) -> str:
    """How many times as likely the data are under a difference as under none, or the reverse."""
    pair, factor = _pair(row, facts.conditions), row["statistic"]
    between = f"between {pair.first} and {pair.second}" if pair else f"of {contrast(row)}"
    likelier, alternative = ("no difference", "one") if factor is not None and factor < 1 else ("a difference", "none")
    if factor is None:  # larger than any number a computer holds
        times, bayes = "more than 10³⁰⁸", f"ln BF₁₀ = {number(row['details']['log_bf10'])}"
    else:
        times, bayes = number(factor if factor >= 1 else 1 / factor), f"BF₁₀ = {statistic_value(row)}"
    prior = f"Cauchy prior of scale {row['details']['prior_scale']:g}"
    return (
        f"{what}: the data are {times} times as likely under {likelier} {between} as under {alternative}, {bayes}"
        f" ({prior}), {effect_size(row, _BEFORE_INTERVAL)}, n = {row['n']}."
    )


def _evidence(row: Row, facts: StudyFacts) -> str:
    """The test's name where its statistic does not tell it, its figures, and n."""
    named = ""
    if row["test"] == "wilcoxon":
        named = f"{row['method'].split(', ')[0].split(' ')[0]} Wilcoxon signed-rank test, "
    elif row["test"] == "rm_anova" and row["contrast"] is not None:
        named = "follow-up of the logarithms, " if of_logarithms(row) else "follow-up, "
    elif not TESTS[row["test"]].symbol_tells or of_logarithms(row):
        named = f"{_test(row)}, "
    # A ratio to the first condition is said as the amount already.
    said = row["effect_size_name"] == RATIO and _pair(row, facts.conditions) is not None and ratio_to_first(row)
    shown = {**row, "effect_size": None, "ci_low": None} if said else row
    figures = evidence(shown, _digits(row, facts.alpha), _BEFORE_INTERVAL)
    singular = ", singular fit" if finds_no_variance_between_people(row) else ""
    return f"{named}{figures}, n = {row['n']}{singular}"


def _digits(row: Row, alpha: float) -> int:
    """One digit more where three would put a p on the other side of the level."""
    details = row["details"] or {}
    known = [p for p in (row["p"], row["p_adjusted"], details.get("p_gg")) if p is not None]
    crosses = any((round(p, _DIGITS) < alpha) != (p < alpha) for p in known)
    return _DIGITS + 1 if crosses else _DIGITS


def _significant(row: Row, alpha: float) -> bool:
    p = decisive_p(row)
    return p is not None and p < alpha


def _difference(row: Row) -> float | None:
    """First minus second, as far as the test says it: by ranks, estimated, or of the means."""
    if row["test"] == "wilcoxon" or row["effect_size_name"] == "estimate":
        return None if row["effect_size"] is None else float(row["effect_size"])
    if ratio_to_first(row):
        return float(row["details"]["log_ratio"])
    if row["mean_difference"] is None:
        return None
    same = row["reduction"] is not None and abs(row["reduction"]) < _ROUND_OFF  # of the mean: the means are the same
    return 0.0 if same else float(row["mean_difference"])


def _pair(row: Row, conditions: Sequence[str]) -> _Pair | None:
    """What two things a row compares; None where it is not two, or names that hold " - " can be read in two ways."""
    of_condition = row["effect"] in EFFECTS_OF_CONDITION or row["effect"].startswith("condition:")
    if row["contrast"] is None:
        both = len(conditions) == 2 and row["effect"] in EFFECTS_OF_CONDITION
        return _Pair(conditions[0], conditions[1], "with") if both else None
    compared, where = row["contrast"], ""
    if ":" in row["effect"] and " | " in compared:
        compared, where = compared.rsplit(" | ", 1)
        where = f" at {where}"
    if of_condition or ":" in row["effect"]:
        found = [pair for pair in combinations(conditions, 2) if " - ".join(pair) == compared]
        return _Pair(*found[0], "with", where) if len(found) == 1 else None
    names = names_in(compared)
    if names is None or row["effect"] == "carry-over":
        return None
    return _Pair(*names, "in period" if row["effect"] == "period" else "at", where)


def _means(row: Row, facts: StudyFacts) -> Iterator[str]:
    """M and SD of each condition, where all of them are compared and they are of the same people as the test."""
    if (row["details"] or {}).get("means") is not None:
        yield from _observed(row, facts)
        return
    if row["effect"] not in EFFECTS_OF_CONDITION or (row["contrast"] is not None and len(facts.conditions) > 2):
        return
    found = [facts.descriptives.get((row["measure"], condition)) for condition in facts.conditions]
    if all(one is not None and one["n"] == row["n"] for one in found):
        yield from (_mean(one, TESTS[row["test"]].values) for one in found if one is not None)


def _observed(row: Row, facts: StudyFacts) -> Iterator[str]:
    """The share or rate of each condition over all trials, which the test rests on."""
    means = (row["details"] or {}).get("means")
    if means is None or row["effect"] not in EFFECTS_OF_CONDITION:
        return
    if row["contrast"] is not None and len(facts.conditions) > 2:
        return
    for condition, mean in zip(facts.conditions, means, strict=True):
        answers = TESTS[row["test"]].values == "answers"
        yield f"{condition}: {percent(mean) if answers else f'{number(mean)} per {_unit_of_exposure(row)}'}"


def _unit_of_exposure(row: Row) -> str:
    """What a rate is of: a trial, or a unit of the exposure."""
    exposure = (row["details"] or {}).get("exposure")
    if exposure is None:
        return "trial"
    return unit_of(exposure) or f"unit of {subject(exposure).lower()}"


def _mean(described: Row, values: Values = "measurements") -> str:
    if values == "answers":
        return f"{described['condition']}: {percent(described['mean'])}"
    spread = "" if described["sd"] is None else f", SD = {number(described['sd'])}"
    return f"{described['condition']}: M = {number(described['mean'])}{spread}"


def means_sentence(measure: str, facts: StudyFacts) -> str:
    """M, SD and n of every condition, for a measure whose sentences do not state them."""
    found = [one for condition in facts.conditions if (one := facts.descriptives.get((measure, condition)))]
    parts = [f"{_mean(one)}, n = {one['n']}" for one in found]
    return f"{subject(measure)}: {'; '.join(parts)}." if parts else ""


def states_means(row: Row, facts: StudyFacts) -> bool:
    """Does the row's sentence state the means of all conditions?"""
    return row["status"] == "ok" and TESTS[row["test"]].tests_difference and any(_means(row, facts))
