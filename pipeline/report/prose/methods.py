"""The methods of a study as a paragraph to paste, from its settings and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pipeline.report.prose.references import has_publication
from pipeline.sessions.estimators import build_estimator, fusing
from pipeline.statistics import NONE_OF_ALIKE, T_BEYOND, T_OF_SHARES, WILSON
from pipeline.statistics.estimation import PERMUTATIONS, RESAMPLES
from pipeline.study.comparison import Comparison, matching_measures
from pipeline.study.settings import Study
from pipeline.study.statistical_tests import TESTS, TUKEY
from pipeline.study.streams import Sensing
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import SMOOTHED
from pipeline.words.comparison import over_all_pairs
from pipeline.words.estimators import estimator_in_words, setting_in_words, settings_in_words
from pipeline.words.evidence import resampled
from pipeline.words.names import adjustment_label, measure_as_subject, unit_of, was
from pipeline.words.numbers import number
from pipeline.words.phrases import counted, group_sizes, listing, there_were

_ORIGINS = {
    "simulated": "The data were simulated by a model, not measured with people.",
    "reconstructed": "The data were reconstructed to fit printed figures; they are not anybody's measurements.",
}
_NAMED_MAX = 8
"""More measures than these under one pattern are counted, not named."""


def methods(study: Study, results: Mapping[str, Any], versions: Mapping[str, str]) -> str:
    """The whole paragraph: design, measures, estimators with their settings, tests, exclusions, software.

    `results` is the content of results.json, `versions` those of the packages that made the report.
    """
    sentences = [
        *_design(study, results),
        *_measures(study, results),
        *_estimators(study),
        *_without_reference(results),
        *_tests(study, results["comparisons"]),
        *_intervals(results["descriptives"]),
        *_exclusions(study, results["exclusions"]),
        computed_with(versions),
    ]
    return " ".join(sentences)


def _design(study: Study, results: Mapping[str, Any]) -> Iterator[str]:
    if study.data_origin in _ORIGINS:
        yield _ORIGINS[study.data_origin]
    facts, conditions = results["study"]["participants"], list(study.conditions)
    there_are = there_were(facts, _sex_and_age(facts))
    if len(conditions) == 1:
        yield f"{there_are} and one condition, {conditions[0]}."
        return
    designs = {TESTS[row["test"]].design for row in results["comparisons"]}
    if "condition" in study.factors or (
        designs == {"between"} and {row["effect"] for row in results["comparisons"]} == {"condition"}
    ):
        how = "each participant met one"
    elif designs == {"either"}:
        how = "compared with participants as clusters"
    elif designs:
        how = (
            "compared within participants" if "within" in designs or "mixed" in designs else "met by every participant"
        )
    else:
        how = "not compared"
    comparison = f"{counted(len(conditions), 'condition')}, {how}: {listing(conditions)}"
    yield f"{there_are} and {comparison}{f'; {conditions[0]} was the baseline' if designs else ''}."
    groups = [factor for factor in study.between_factors if factor != "condition"]
    if groups and designs - {"within"}:
        yield f"Participants were compared between the levels of {listing(groups)}."
        if results["descriptives_by_group"]:
            yield f"Participants of each {group_sizes(results['descriptives_by_group'])}."


def _sex_and_age(facts: Mapping[str, Any]) -> str:
    """Sex and age as far as they are known."""
    known = [f"{count} {name}" for name, count in (facts.get("sex") or {}).items()]
    age = facts.get("age")
    if age:
        known.append(f"aged {number(age['min'], 0)} to {number(age['max'], 0)} years, M = {number(age['mean'], 1)}")
    return f" ({', '.join(known)})" if known else ""


def _measures(study: Study, results: Mapping[str, Any]) -> Iterator[str]:
    """The measures, with the scales of a questionnaire together."""
    scales: dict[str, list[str]] = {}
    others: list[str] = []
    for measure in dict.fromkeys(row["measure"] for row in results["descriptives"]):
        questionnaire, slash, scale = measure.partition("/")
        if slash:
            scales.setdefault(questionnaire, []).append(scale.replace("_", " "))
        else:
            unit = unit_of(measure)
            name = measure_as_subject(measure)
            others.append(f"{_within_a_sentence(name) if others else name}{f' in {unit}' if unit else ''}")
    named = [f"{measure_as_subject(f'{name}/ratings')} ({', '.join(parts)})" for name, parts in scales.items()]
    if others or named:
        yield f"Measures: {'; '.join([*others, *named])}. Each participant's mean in a condition counted as one value."


def _estimators(study: Study) -> Iterator[str]:
    """Each estimator and the settings that were chosen for it; the provenance has them all."""
    if not study.estimators or study.sessions is None:
        return
    sensors = [f"{name} ({', '.join(_stated(stream))})" for name, stream in study.sensor_streams.items()]
    yield f"Sensors, as stated to the estimators: {'; '.join(sensors)}."
    estimators, with_accelerations = [], fusing(study)
    for name, settings in study.estimators.items():
        words = settings_in_words(build_estimator(study, name))
        alone = [] if name in with_accelerations else ["from the tracker alone"]
        chosen = ", ".join([*alone, *(words[key] for key in settings.parameters)])
        estimators.append(f"{name}: {estimator_in_words(settings.type)}{f' ({chosen})' if chosen else ''}")
    yield f"Positions were estimated causally from the raw sensor streams: {'; '.join(estimators)}."
    for condition, name in study.shown.items():
        yield f"Condition {condition} displayed {name}."


def _without_reference(results: Mapping[str, Any]) -> Iterator[str]:
    if any(row["reference"] == SMOOTHED for row in results["accuracy"]):
        yield (
            "No reference was recorded, so absolute errors and lags are not known; estimates were compared with the"
            " readings of all sensors, smoothed."
        )


def _stated(stream: Sensing) -> Iterator[str]:
    """A sensor's kind, noise and latency."""
    yield stream.kind
    for name, value in stream:
        if name.startswith("noise_sd") or name == "latency_s":
            yield setting_in_words(name, value)


def _tests(study: Study, rows: Sequence[Row]) -> Iterator[str]:
    """Each entry's test and its measures, and how families of p values were adjusted."""
    if not rows:
        return
    measures_by_test: dict[str, list[str]] = {}
    for entry in study.comparisons:
        tested = [row for row in rows if row["test"] == entry.test]
        measures_text = listing([_measures_named(pattern, tested) for pattern in entry.measures])
        measures_by_test.setdefault(test_in_words(entry, tested) + _follow_up(entry, tested), []).append(measures_text)
    for test, names in measures_by_test.items():
        measures = list(dict.fromkeys(names))
        first, others = measures[0], [_within_a_sentence(name) for name in measures[1:]]
        were = was(first) if not others and " and " not in first else "were"
        yield f"{listing([first, *others])} {were} analysed by {test}."
    if any((row["details"] or {}).get("p_gg") is not None for row in rows):
        yield "With more than two conditions, p was corrected for sphericity (Greenhouse-Geisser)."
    yield f"The level of significance was {_level(study.alpha)}; intervals are 95 % intervals."


def _intervals(rows: Sequence[Row]) -> Iterator[str]:
    """How the intervals of means were computed, where it is not by t alone."""

    def of(*methods: str) -> str:
        names = list(dict.fromkeys(measure_as_subject(row["measure"]) for row in rows if row["interval"] in methods))
        return listing(names) if names else ""

    if of(WILSON):
        yield f"Intervals of the shares of answers 0 or 1 ({of(WILSON)}) are Wilson's."
    if of(T_OF_SHARES, NONE_OF_ALIKE):
        yield (
            f"Intervals of means of participants' shares ({of(T_OF_SHARES, NONE_OF_ALIKE)}) are t intervals, cut at 0"
            " and 1, where their mean cannot be; where all shares are alike there is none."
        )
    if of(T_BEYOND):
        yield f"The t interval of {of(T_BEYOND)} reaches beyond 0 to 1, where all values are."


def _measures_named(pattern: str, rows: Sequence[Row]) -> str:
    """`Completion time`; of `nasa_tlx/*` the scales together, `NASA-TLX scales`; of another pattern each measure."""
    if "*" not in pattern:
        return measure_as_subject(pattern)
    if pattern.partition("/")[2] == "*" and "*" not in pattern.partition("/")[0]:
        return measure_as_subject(pattern).replace(" *", " scales")
    tested = matching_measures(pattern, dict.fromkeys(row["measure"] for row in rows))
    if len(tested) > _NAMED_MAX:
        return f"{len(tested)} measures"
    first, *others = [measure_as_subject(name) for name in tested] or [pattern]
    return listing([first, *map(_within_a_sentence, others)])


def _within_a_sentence(measure: str) -> str:
    """`completion time`, after other words; names such as NASA-TLX keep their capitals."""
    return measure[:1].lower() + measure[1:] if measure[1:2].islower() else measure


def _level(alpha: float) -> str:
    return f"{alpha:g}".removeprefix("0")


def test_in_words(entry: Comparison, rows: Sequence[Row]) -> str:
    """`Wilcoxon signed-rank tests (…), exact, midranks, zeros dropped, p Holm-adjusted`; rows are of its test."""
    options = TESTS[entry.test].options
    parts = [TESTS[entry.test].methods_text]
    if len(entry.within) > 1:
        parts.append(f"of the factors {listing(list(entry.within))}")
    if entry.transform == "log":
        parts.append("of the natural logarithms of the participants' means, read as ratios of geometric means")
    if entry.exposure is not None:
        parts.append(f"rates per {unit_of(entry.exposure) or 'unit'} of {measure_as_subject(entry.exposure).lower()}")
    if "fixed" in options:
        parts.append(f"fixed terms {listing(list(entry.fixed))}")
    if entry.random is not None:
        parts.append(f"a crossed random intercept for each {entry.random}")
    if entry.bounds is not None:
        parts.append(f"bounds {number(entry.bounds[0])} and {number(entry.bounds[1])}")
    if "prior_scale" in options:
        parts.append(f"Cauchy prior of scale {entry.prior_scale:g} on d_z")
    if "zeros" in options:
        zeros = "Pratt" if entry.zeros == "pratt" else "dropped"
        parts += dict.fromkeys(row["method"] for row in rows if zeros in row["method"])
    parts += _estimates(entry, rows)
    if entry.direction is not None and TESTS[entry.test].question == "difference":
        parts.append("p two-sided although a direction was expected")
    if any("one_sided_log_bf" in (row["details"] or {}) for row in rows) and entry.direction is not None:
        side = "below" if entry.direction == "less" else "above"
        prior = f"Cauchy prior of scale {entry.prior_scale:g} on d_z, {side} zero only"
        parts.append(f"one-sided JZS Bayes factors of the expected direction ({prior})")
    if entry.adjust != "none":
        parts.append(f"p {adjustment_label(entry.adjust)}-adjusted")
    return ", ".join(parts)


def _estimates(entry: Comparison, rows: Sequence[Row]) -> Iterator[str]:
    """What is computed in addition to a test: bootstrap intervals and permutation p values, with their seed."""
    seed = f", seed {entry.seed}"
    of = "ratio of geometric means" if entry.transform == "log" else "mean difference"
    if entry.bootstrap and any(resampled(row["details"] or {}) for row in rows):
        by_group = "" if entry.is_within else " within their groups"
        yield f"BCa bootstrap intervals of the {of} ({RESAMPLES:,} resamples of participants{by_group}{seed})"
    if entry.permutation:
        drawn = any((row["details"] or {}).get("permutation_exact") is False for row in rows)
        how = f"{PERMUTATIONS:,} exchanges drawn at random{seed}" if drawn else "all exchanges counted"
        if entry.is_within:
            yield f"permutation p values of the {of} (conditions exchanged within participants, {how})"
        else:
            logarithms = " of the logarithms" if entry.transform == "log" else ""
            yield f"permutation p values of Welch's t{logarithms} (participants exchanged between groups, {how})"


def _follow_up(entry: Comparison, rows: Sequence[Row]) -> str:
    """How the pairs after an entry's test were tested and adjusted, if there are any; rows are of its test."""
    pairs = [row for row in rows if row["contrast"] is not None]
    if any(over_all_pairs(row) for row in pairs) and entry.follow_up != "none":
        test = "Tukey and Kramer's" if entry.follow_up == TUKEY else "Games and Howell's"
        return f", followed up pair by pair with {test} test, whose p values hold for all pairs of a measure together"
    has_follow_up = "follow_up" in TESTS[entry.test].options and any(row["adjust"] == entry.follow_up for row in pairs)
    if not has_follow_up or entry.follow_up == "none":
        return ""
    adjusted = f"{adjustment_label(entry.follow_up)}-adjusted"
    return f", followed up pair by pair with {adjusted} {TESTS[entry.test].followed_up_by}"


def _exclusions(study: Study, rows: Sequence[Row]) -> Iterator[str]:
    """Who was excluded and why, and how much else is missing."""
    for exclusion in study.exclusions:
        yield f"Excluded: {exclusion.named} ({exclusion.reason.strip().rstrip('.')})."
    aside = sum(row["what"] == "session set aside" for row in rows)
    if aside:
        yield f"{counted(aside, 'session')} could not be used and {'was' if aside == 1 else 'were'} set aside."
    incomplete = {row["participant"] for row in rows if row["what"] == "left out of comparisons"}
    if incomplete:
        were = "was" if len(incomplete) == 1 else "were"
        yield f"{counted(len(incomplete), 'participant')} lacked a value and {were} left out of those comparisons."


def computed_with(versions: Mapping[str, str]) -> str:
    """`Everything was computed with Steadyhand 0.1.0 on Python 3.11.7 (numpy 2.4.6, …)`: the packages to be cited.

    Those that read logs or lay out pages are in provenance.json, as all are.
    """
    listed = [f"{name} {version}" for name, version in versions.items() if has_publication(name)]
    ours = f"Steadyhand {versions['steadyhand']}" if "steadyhand" in versions else "Steadyhand"
    return f"Everything was computed with {ours} on Python {versions['Python']} ({', '.join(listed)})."
