"""Numbers, units, names and sentences as people read them. No figure is computed here."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from pipeline.statistics import OF_LOGARITHMS, RATIO
from pipeline.study.measures import MEASURES, measure
from pipeline.study.statistical_tests import ADJUSTMENTS, TESTS

Row = Mapping[str, Any]

MINUS = "\u2212"
THIN = "\u2009"
NOTHING = "–"
SMOOTHED = "smoothed readings"
"""What estimates are held against where no reference was recorded; `accuracy.reference` has it too."""

_EFFECT_SIZES = {
    "generalized eta squared": "η²G",
    "partial eta squared": "η²p",
    "Cohen's d_z": "d_z",
    "Cohen's d_av": "d_av",
    "matched-pairs rank-biserial": "r_rb",
    "rank-biserial": "r_rb",
    "rank epsilon squared": "ε²",
    "odds ratio": "OR",
    "eta squared Q": "η²Q",
    "Kendall's W": "W",
}
_NEVER_OVER_1 = ("η²G", "η²p", "r_rb", "W", "ε²", "η²Q")  # printed without a leading zero, as APA has it
EFFECTS_OF_CONDITION = ("condition", "treatment")
"""What a test calls the effect of the conditions."""
_SEVERAL = "the differences between conditions are"
_STATISTICS = {"chi2": "χ²", "BF10": "BF₁₀", "W+": "W₊"}


def measure_label(name: str) -> str:
    """A measure's name for people, with its unit."""
    return measure(name).full_label


def short_label(name: str) -> str:
    """A measure's name without its unit or its questionnaire."""
    label = measure(name).label
    return label.partition(": ")[2].capitalize() if measure(name).questionnaire else label


def subject(name: str) -> str:
    """A measure as the subject of a sentence: without its unit, a scale behind its questionnaire."""
    label = measure(name).label
    if measure(name).questionnaire:
        return label.replace(": ", " ", 1)
    head, comma, kind = label.partition(", ")
    return f"{head} ({kind})" if comma and name in MEASURES else label


def unit_of(name: str) -> str:
    """A measure's unit, or nothing."""
    return measure(name).unit


def number(value: float | None, digits: int = 2) -> str:
    """With `digits` decimals up to 1000, grouped whole above, more digits for the small, powers for the huge."""
    if value is None or not math.isfinite(value):
        return NOTHING
    size = abs(value)
    if size >= 1e15:
        text = f"{value:.{digits}e}"  # beyond what a float holds to the unit
    elif size >= 1000:
        text = f"{value:,.0f}".replace(",", THIN)
    elif size == 0 or size >= 0.1:
        text = f"{value:.{digits}f}"
    else:
        text = f"{value:.{digits + 1}g}" if size >= 1e-4 else f"{value:.1e}"
    return text.replace("-", MINUS)


def percent(value: float | None, digits: int = 1) -> str:
    """A share as percent."""
    return NOTHING if value is None or not math.isfinite(value) else f"{100 * value:.{digits}f} %".replace("-", MINUS)


def seconds(value: float | None) -> str:
    """A lag in milliseconds, with its sign."""
    if value is None or not math.isfinite(value):
        return NOTHING
    text = f"{1000 * value:+.0f}"
    return "0" if text in ("+0", "-0") else text.replace("-", MINUS)


def share(value: float | None, digits: int = 3) -> str:
    """A figure that cannot exceed 1, without its leading zero."""
    if value is None or not math.isfinite(value):
        return NOTHING
    text = f"{value:.{digits}f}"
    text = text.replace("0.", ".", 1) if text.lstrip("-").startswith("0.") else text
    return text.removeprefix("-") if not float(text) else text.replace("-", MINUS)


def p_value(p: float | None, digits: int = 4) -> str:
    """A p value with so many digits; what would read as none or as one is said to be below or above."""
    if p is None:
        return NOTHING
    least = 10.0**-digits
    if p < least:
        return f"< {share(least, digits)}"
    return f"> {share(1 - least, digits)}" if p > 1 - least / 2 else share(p, digits)


def p_phrase(p: float | None, symbol: str = "p", digits: int = 4) -> str:
    """`p = .0071`, `p < .0001`."""
    text = p_value(p, digits)
    return f"{symbol} {text}" if text.startswith(("<", ">")) else f"{symbol} = {text}"


def share_interval(low: float | None, high: float | None, digits: int = 2) -> str:
    """The same for figures that cannot exceed 1: `[.01, .35]`."""
    return NOTHING if low is None or high is None else f"[{share(low, digits)}, {share(high, digits)}]"


def interval(low: float | None, high: float | None, digits: int = 2) -> str:
    """`[low, high]` with as many decimals in both, or nothing."""
    if low is None or high is None:
        return NOTHING
    if max(abs(low), abs(high)) >= 0.1:
        return f"[{_fixed(low, digits)}, {_fixed(high, digits)}]"
    return f"[{number(low, digits)}, {number(high, digits)}]"


def _fixed(value: float, digits: int) -> str:
    """With `digits` decimals, however small."""
    text = number(value, digits) if abs(value) >= 0.1 else f"{value:.{digits}f}".replace("-", MINUS)
    return text.removeprefix(MINUS) if float(text.replace(MINUS, "-").replace(THIN, "")) == 0 else text


def degrees(value: float | None) -> str:
    """Degrees of freedom: whole where they are."""
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value - round(value)) < 1e-6 * value else f"{value:.2f}"


def statistic(row: Row) -> str:
    """`F(1, 11) = 10.86`, as the test prints it."""
    if row["statistic"] is None:
        return NOTHING
    freedom = degrees_of_freedom(row)
    name = statistic_name(row)
    return f"{name}({freedom}) = {statistic_value(row)}" if freedom else f"{name} = {statistic_value(row)}"


def statistic_name(row: Row) -> str:
    """`F`, `W₊`, `χ²`."""
    return _STATISTICS.get(row["statistic_name"], str(row["statistic_name"]))


def statistic_value(row: Row) -> str:
    """A statistic's value, two decimals; a sum of ranks is whole or a half, and of a Bayes factor the small counts."""
    value = row["statistic"]
    if value is None or row["statistic_name"] == "BF10":
        return number(value)
    if row["statistic_name"] == "b":
        return f"{value:.0f}, c = {row['details']['c']}"
    if row["statistic_name"] == "W+":
        return f"{value:.0f}" if float(value).is_integer() else f"{value:.1f}"
    return _fixed(value, 2)


def degrees_of_freedom(row: Row) -> str:
    """`1, 11`, or nothing."""
    return ", ".join(text for text in (degrees(row["df1"]), degrees(row["df2"])) if text)


def effect_size(row: Row, before_interval: str = " ") -> str:
    """`d_z = 0.65 [0.01, 1.27]`, `η²G = .10 [.00, .29]`; a ratio as `ratio_to_first` has it."""
    if row["effect_size"] is None:
        return str((row["details"] or {}).get("no_effect_size", NOTHING))
    if row["effect_size_name"] == RATIO and ratio_to_first(row):
        return ratio_to_first(row, before_interval)
    bounds = effect_interval(row)
    value = f"{effect_name(row)} = {effect_value(row)}"
    return value if bounds == NOTHING else f"{value}{before_interval}{bounds}"


def effect_name(row: Row) -> str:
    """`η²G`, `d_z`."""
    return _EFFECT_SIZES.get(row["effect_size_name"], str(row["effect_size_name"]))


def effect_value(row: Row) -> str:
    """An effect size without its interval."""
    if row["effect_size"] is None:
        return NOTHING
    name = effect_name(row)
    if name in _NEVER_OVER_1:
        return share(row["effect_size"], 2)
    return number(row["effect_size"]) if name == "estimate" else _fixed(row["effect_size"], 2)


def effect_interval(row: Row) -> str:
    """An effect size's 95 % interval, or nothing."""
    bounded = effect_name(row) in _NEVER_OVER_1
    return (share_interval if bounded else interval)(row["ci_low"], row["ci_high"])


def ratio_to_first(row: Row, before_interval: str = " ") -> str:
    """`geometric mean 0.81 times that of kinect [0.71, 0.91]` of a test of logarithms, or nothing."""
    details = row["details"] or {}
    if details.get("ratio_to_first") is None:
        return ""
    of = "the first" if details["first"] is None else details["first"]
    bounds = interval(*details["ratio_to_first_ci"])
    value = f"geometric mean {number(details['ratio_to_first'])} times that of {of}"
    return value if bounds == NOTHING else f"{value}{before_interval}{bounds}"


def of_logarithms(row: Row) -> bool:
    """Are the logarithms of the values tested?"""
    return OF_LOGARITHMS in row["method"]


def contrast(row: Row) -> str:
    """What a row compares: its pair, at which level of another factor, within which bounds, or its effect."""
    effect = str(row["effect"]).replace(":", " × ").replace("carry_over", "carry-over")
    if row["contrast"] is None:
        return "conditions" if row["effect"] in EFFECTS_OF_CONDITION else effect
    compared = str(row["contrast"]).replace(" - ", f" {MINUS} ")
    if ":" in row["effect"] and " | " in compared:
        return " at ".join(compared.rsplit(" | ", 1))
    bounds = (row["details"] or {}).get("bounds")
    if bounds:
        return f"{compared} within {interval(*bounds)}"
    return compared if row["effect"] in EFFECTS_OF_CONDITION else f"{effect}: {compared}"


def corrected(row: Row, digits: int = 4) -> str | None:
    """The sphericity-corrected p of an ANOVA of more than two conditions."""
    details = row["details"] or {}
    if details.get("p_gg") is None:
        return None
    return f"Greenhouse-Geisser ε = {share(details['epsilon_gg'])}, {p_phrase(details['p_gg'], digits=digits)}"


def unadjusted_p(row: Row) -> float | None:
    """The p value before any adjustment over a family: corrected for sphericity where it can be."""
    corrected_p = (row["details"] or {}).get("p_gg")
    return row["p"] if corrected_p is None else float(corrected_p)


def decisive_p(row: Row) -> float | None:
    """The p value to judge by: adjusted over its family if it has one."""
    return unadjusted_p(row) if row["p_adjusted"] is None else float(row["p_adjusted"])


def test_label(row: Row) -> str:
    """A row's test as tables name it: `paired t`, `paired t of logarithms`."""
    return TESTS[row["test"]].label + (" of logarithms" if of_logarithms(row) else "")


def comparison_sentence(row: Row, with_change: bool = True) -> str:
    """One row in APA's manner, without the measure's name."""
    head = "" if row["contrast"] is None and row["effect"] in EFFECTS_OF_CONDITION else f"{contrast(row)}, "
    if row["status"] != "ok":
        return f"{head}{test_label(row)}: {row['status']} (n = {row['n']})"
    named = "" if TESTS[row["test"]].symbol_tells and not of_logarithms(row) else f"{test_label(row)}: "
    if TESTS[row["test"]].question == "evidence":
        named = f"{test_label(row)} (JZS, prior scale {row['details']['prior_scale']:g}): "
    parts = [f"{named}{head}{evidence(row)}", f"n = {row['n']}"]
    if finds_no_variance_between_people(row):
        parts.append("singular fit: no variance between participants is found")
    if row["mean_difference"] is not None and with_change:
        parts.append(change_phrase(row))
    elif row["effect_size_name"] != RATIO and ratio_to_first(row):
        parts.append(ratio_to_first(row))
    return ", ".join(parts)


def evidence(row: Row, digits: int = 4, before_interval: str = " ") -> str:
    """Statistic, p values with so many digits, and effect size of a row that is defined."""
    parts = [statistic(row)]
    if row["p"] is not None:
        parts.append(p_phrase(row["p"], digits=digits))
    if corrected(row):
        parts.append(corrected(row, digits) or "")
    if row["p_adjusted"] is not None:
        parts.append(p_phrase(row["p_adjusted"], f"{adjustment(row['adjust'])}-adjusted p", digits))
    if row["effect_size"] is not None or row["ci_low"] is not None:
        parts.append(effect_size(row, before_interval))
    parts += [text for text in (permutation(row, digits), bootstrap(row)) if text]
    return ", ".join(parts)


def permutation(row: Row, digits: int = 4) -> str:
    """`exact permutation p = .0312`, or nothing."""
    details = row["details"] or {}
    if details.get("permutation_p") is None:
        return ""
    exact = "exact " if details["permutation_exact"] else ""
    return p_phrase(details["permutation_p"], f"{exact}permutation p", digits)


def bootstrap(row: Row) -> str:
    """`mean difference = 6.10, bootstrap 95 % CI [3.20, 9.12]`, why there is no interval, or nothing."""
    details = row["details"] or {}
    if "bootstrap_seed" not in details:
        return ""
    of_ratio, of_difference = (details.get(f"bootstrap_ci_{of}") for of in ("ratio_to_first", "difference"))
    if of_ratio:
        return f"bootstrap 95 % CI of the ratio {interval(*of_ratio)}"
    mean = f"mean difference = {number(row['mean_difference'])}, bootstrap 95 % CI "
    return mean + interval(*of_difference) if of_difference else str(details["no_bootstrap"])


def adjustment(method: str) -> str:
    """A way of adjusting p values by its authors' names."""
    return ADJUSTMENTS[method].label


def verdict(row: Row, alpha: float) -> str:
    """What a row says at a level of significance."""
    level = f"at the {100 * alpha:g} % level"
    p = decisive_p(row)
    if TESTS[row["test"]].question == "evidence" and row["statistic"] is not None:
        times = row["statistic"] if row["statistic"] >= 1 else 1 / row["statistic"]
        likelier, other = ("a difference", "none") if row["statistic"] >= 1 else ("no difference", "one")
        return f"the data are {number(times)} times as likely under {likelier} as under {other}"
    if p is None:
        return "no test is defined"
    if TESTS[row["test"]].question == "equivalence":
        return f"the conditions are {'' if p < alpha else 'not shown to be '}equivalent within the bounds {level}"
    named = "the difference is" if row["contrast"] is not None or row["mean_difference"] is not None else _SEVERAL
    return f"{named} {'' if p < alpha else 'not '}statistically significant {level}"


def reduction_of(row: Row) -> float | None:
    """A row's reduction, where a percentage means something: only on a scale known to have a zero that means none."""
    none_is_zero = measure(row["measure"]).scale == "ratio" or TESTS[row["test"]].values == "counts"
    return row["reduction"] if none_is_zero and TESTS[row["test"]].values != "answers" else None


def amount_of_change(row: Row) -> str:
    """How much a measure changes, without its direction: `38.3 %`, or the difference in its unit: `0.42 mm`."""
    reduction = reduction_of(row)
    if reduction is not None:
        return percent(abs(reduction))
    return difference_phrase(row)


def difference_phrase(row: Row) -> str:
    """`0.42 mm`: the size of the difference of the means in its unit; of answers in percentage points."""
    size = abs(row["mean_difference"])
    if TESTS[row["test"]].values == "answers":
        return f"{number(100 * size, 1)} percentage points"
    return f"{number(size)} {unit_of(row['measure'])}".strip()


def direction(row: Row) -> str:
    """Whether the second mean is lower or higher, and better or worse where that is known of the measure."""
    if row["mean_difference"] == 0:
        return "the same"
    side = "lower" if row["mean_difference"] > 0 else "higher"
    better = measure(row["measure"]).better
    return side if better == "unknown" else f"{side} ({'better' if side == better else 'worse'})"


def finds_no_variance_between_people(row: Row) -> bool:
    """Is a mixed model's variance of participants estimated as zero? A smaller intercept may be without being told."""
    details = row["details"] or {}
    return bool(details.get("singular")) and not details.get("variance_participant")


def change_phrase(row: Row) -> str:
    """`reduced by 38.3 %`, or where a percentage means nothing `higher by 0.42`."""
    reduction = reduction_of(row)
    if reduction is not None:
        return reduction_phrase(reduction)
    if row["mean_difference"] == 0:
        return "the same mean"
    return f"{'lower' if row['mean_difference'] > 0 else 'higher'} by {amount_of_change(row)}"


def reduction_phrase(reduction: float) -> str:
    """`reduced by 38.3 %`, `increased by 4.0 %`."""
    return f"{'reduced' if reduction >= 0 else 'increased'} by {percent(abs(reduction))}"


def capitalized(sentence: str) -> str:
    """With a capital letter first, the rest as it is: names in it keep theirs."""
    return sentence[:1].upper() + sentence[1:]


def held_against(references: Iterable[str]) -> str:
    """What errors are distances from, for a sentence; `references` are those of rows of `accuracy`."""
    names = set(references)
    if SMOOTHED not in names:
        return "the reference"
    return f"the {SMOOTHED}" if names == {SMOOTHED} else f"the reference or {SMOOTHED}"


def listing(words: list[str]) -> str:
    """`a, b and c`."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """`1 session`, `3 sessions`."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"
