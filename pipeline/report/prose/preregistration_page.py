"""A preregistration as a page to paste: the questions of AsPredicted and of OSF in their order, with answers.

The answers are study.yaml's; what it does not say stays "not stated", for a preregistration must not promise what
nobody decided. The questions are those of AsPredicted's form (aspredicted.org) and of the template "OSF
Preregistration" (osf.io), shortened.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.analysis.preregistration.hypotheses import hypothesis
from pipeline.report.prose.methods import test_in_words
from pipeline.study.comparison import Comparison
from pipeline.study.settings import Study
from pipeline.study.statistical_tests import TESTS
from pipeline.words.names import adjustment_label, measure_label
from pipeline.words.phrases import listing

NOT_STATED = "not stated"


@dataclass(frozen=True)
class Circumstances:
    """What the page says in addition to study.yaml.

    The digest of the frozen file, Steadyhand's version, the data files that existed already, and the power of n.
    """

    digest: str
    version: str
    existing_data: tuple[str, ...]
    power: tuple[str, ...]


def page(study: Study, now: Circumstances) -> str:
    """The page in Markdown."""
    lines = [
        f"# Preregistration: {study.title}",
        "",
        f"Written by Steadyhand {now.version} from study.yaml. The settings are frozen in `preregistered.yaml`, whose"
        f" SHA-256 is `{now.digest}`. “{NOT_STATED.capitalize()}” means that study.yaml does not say it.",
    ]
    for title, questions in (("As AsPredicted asks", _aspredicted(study, now)), ("As OSF asks", _osf(study, now))):
        lines += ["", f"## {title}"]
        for heading, answers in questions:
            lines += ["", f"### {heading}", "", *_paragraphs(answers)]
    return "\n".join(lines) + "\n"


def unanswered(study: Study) -> list[str]:
    """What study.yaml leaves open: keys of `preregistration:`, and comparisons without a hypothesis."""
    answers = study.preregistration
    missing = [f"preregistration.{name}" for name in type(answers).model_fields if getattr(answers, name) is None]
    without_hypothesis = [entry.title for entry in study.comparisons if hypothesis(entry, study.conditions) is None]
    return [*missing, *(f"hypothesis or direction of {title}" for title in without_hypothesis)]


_Questions = Iterator[tuple[str, Sequence[str]]]


def _paragraphs(answers: Sequence[str]) -> list[str]:
    """One answer as a paragraph, several as a list; an answer of several lines stays in one."""
    texts = [" ".join(answer.split()) for answer in answers]
    return [f"- {text}" for text in texts] if len(texts) > 1 else texts or [NOT_STATED]


def _aspredicted(study: Study, now: Circumstances) -> _Questions:
    answers = study.preregistration
    yield "1. Have any data been collected for this study already?", _data(study, now)
    yield "2. What's the main question being asked or hypothesis being tested in this study?", _hypotheses(study)
    yield "3. Describe the key dependent variables, specifying how they will be measured", _measures(study)
    yield "4. How many and which conditions will participants be assigned to?", _conditions(study)
    yield "5. Specify exactly which analyses you will conduct", [*_tests(study), *_inference(study)]
    yield (
        "6. Describe exactly how outliers will be defined and handled, and your precise rules for excluding"
        " observations",
        [*_outliers(study), *_exclusions(study), *_missing(study)],
    )
    yield (
        "7. How many observations will be collected, or what will determine sample size?",
        [*_sample_size(study, now), _stated("Stopping rule", answers.stopping_rule)],
    )
    yield (
        "8. Anything else you would like to pre-register?",
        [_stated("Exploratory", answers.exploratory), _stated("Randomization", _randomization(study)), *_other(study)],
    )


def _osf(study: Study, now: Circumstances) -> _Questions:
    answers = study.preregistration
    yield "Study Information: Title", [study.title]
    yield "Study Information: Description", [study.notes or NOT_STATED]
    yield "Study Information: Hypotheses", _hypotheses(study)
    yield "Design Plan: Study type", [NOT_STATED]
    yield "Design Plan: Blinding", [answers.blinding or NOT_STATED]
    yield "Design Plan: Study design", _conditions(study)
    yield "Design Plan: Randomization", [_randomization(study) or NOT_STATED]
    yield "Sampling Plan: Existing data", _data(study, now)
    yield "Sampling Plan: Data collection procedures", [answers.procedure or NOT_STATED]
    yield "Sampling Plan: Sample size", _sample_size(study, now)[:1]
    yield "Sampling Plan: Sample size rationale", _sample_size(study, now)[1:]
    yield "Sampling Plan: Stopping rule", [answers.stopping_rule or NOT_STATED]
    yield "Variables: Manipulated variables", _conditions(study)
    yield "Variables: Measured variables", _measures(study)
    yield "Variables: Indices", _indices(study)
    yield "Analysis Plan: Statistical models", list(_tests(study))
    yield "Analysis Plan: Transformations", _transformations(study)
    yield "Analysis Plan: Inference criteria", list(_inference(study))
    yield "Analysis Plan: Data exclusion", [*_outliers(study), *_exclusions(study)]
    yield "Analysis Plan: Missing data", list(_missing(study))
    yield "Analysis Plan: Exploratory analysis", [answers.exploratory or NOT_STATED]
    yield "Other: Other", _other(study)


def _stated(what: str, answer: str | None) -> str:
    return f"{what}: {answer or NOT_STATED}"


def _data(study: Study, now: Circumstances) -> list[str]:
    there = listing([f"`{name}`" for name in now.existing_data]) if now.existing_data else "none"
    fact = f"Of the data that study.yaml names, there was when this page was written: {there}."
    return [study.preregistration.data_collected or NOT_STATED, fact]


def _hypotheses(study: Study) -> list[str]:
    """The question, and of each comparison what is expected, with its direction."""
    lines = [_stated("Question", study.preregistration.question)]
    if study.question:
        lines.append(f"Pairs that are asked about: {listing([' versus '.join(pair) for pair in study.question])}.")
    for entry in study.comparisons:
        expected = hypothesis(entry, study.conditions)
        lines.append(f"{_entry_measures(entry)}: {expected or f'hypothesis and direction {NOT_STATED}'}")
    return lines


def _entry_measures(entry: Comparison) -> str:
    """An entry's measures for people, with the name that the data have."""
    return listing([f"`{name}`" if "*" in name else f"{measure_label(name)} (`{name}`)" for name in entry.measures])


def _measures(study: Study) -> list[str]:
    names = dict.fromkeys(name for entry in study.comparisons for name in entry.measures)
    listed = [f"`{name}` (all scales)" if "*" in name else f"{measure_label(name)} (`{name}`)" for name in names]
    return [*listed, *(line for line in _indices(study) if line != NOT_STATED)]


def _indices(study: Study) -> list[str]:
    """How questionnaires are scored, as far as study.yaml says it."""
    return [
        f"`{name}` is scored by the rule {entry.rule}"
        + (f", answers from {entry.range[0]:g} to {entry.range[1]:g}" if entry.range else "")
        + (f", reversed: {', '.join(entry.reversed)}" if entry.reversed else "")
        for name, entry in study.scoring.items()
    ] or [NOT_STATED]


def _conditions(study: Study) -> list[str]:
    """The conditions, who meets which, and further factors."""
    conditions = f"{len(study.conditions)}: {listing(list(study.conditions))}; {study.conditions[0]} is the baseline."
    groups = [name for name in study.between_factors if name != "condition"]
    each = "Each participant meets one condition." if "condition" in study.factors else ""
    if not each and any(TESTS[entry.test].design != "between" for entry in study.comparisons):
        each = "Each participant meets every condition."
    lines = [" ".join(part for part in (conditions, each) if part)]
    if groups:
        lines.append(f"Participants are in groups by {listing(groups)}.")
    within = dict.fromkeys(name for entry in study.comparisons for name in entry.within if name != "condition")
    if within:
        lines.append(f"Further factors within participants: {listing(list(within))}.")
    return lines + [f"Condition {condition} displays {estimator}." for condition, estimator in study.shown.items()]


def _tests(study: Study) -> Iterator[str]:
    """Each entry's test with all its settings, and its family."""
    for entry in study.comparisons:
        text = f"{_entry_measures(entry)}: {test_in_words(entry, [])}"
        if "follow_up" in entry.options and entry.follow_up != "none":
            text += f"; pairs follow, {adjustment_label(entry.follow_up)}-adjusted, where there are more than two"
        if "zeros" in entry.options:
            text += f"; zeros: {entry.zeros}"
        if entry.between is not None:
            text += f"; between the groups of {entry.between}"
        if entry.family is not None:
            text += f"; family “{entry.family}”"
        yield text


def _inference(study: Study) -> Iterator[str]:
    yield f"Level of significance {study.alpha:g}, tests two-sided whatever direction is expected."
    families: dict[str, list[str]] = {}
    for place, entry in enumerate(study.comparisons):
        if entry.adjust != "none":
            key = entry.family or f" {place}"
            families.setdefault(f"{key}\n{adjustment_label(entry.adjust)}", []).extend(
                f"`{name}`" for name in entry.measures
            )
    for key, measures in families.items():
        name, _, method = key.partition("\n")
        named = "" if name.startswith(" ") else f" “{name}”"
        yield f"Family{named} of {listing(measures)}: p adjusted by {method}."
    if len(families) == 0:
        yield "p values are not adjusted for the number of comparisons."


def _outliers(study: Study) -> Iterator[str]:
    yield _stated("Outliers", study.preregistration.outlier_rules)
    yield "Steadyhand names participants whose difference lies far from the others' and leaves nobody out for that."


def _exclusions(study: Study) -> Iterator[str]:
    yield _stated("Exclusions", study.preregistration.exclusion_rules)
    for exclusion in study.exclusions:
        yield f"Excluded already: {exclusion.named} ({exclusion.reason})"


def _missing(study: Study) -> Iterator[str]:
    """How missing values are treated, entry by entry where it differs."""
    available = [_entry_measures(entry) for entry in study.comparisons if entry.missing == "available"]
    yield "Missing data: participants who lack a value of a test's conditions are left out of it (listwise)."
    if available:
        yield f"Of {listing(available)}: averages over what is there."
    models = [_entry_measures(entry) for entry in study.comparisons if not TESTS[entry.test].complete_cases]
    if models:
        yield f"Of {listing(models)}: the model takes incomplete participants too."


def _transformations(study: Study) -> list[str]:
    stated = [(entry, entry.model_dump(exclude_defaults=True).get("transform")) for entry in study.comparisons]
    return [f"{_entry_measures(entry)}: {transform}" for entry, transform in stated if transform] or ["None is stated."]


def _sample_size(study: Study, now: Circumstances) -> list[str]:
    """How many participants, why so many, and the power that they give."""
    answers = study.preregistration
    return [
        _stated("Participants", str(answers.participants) if answers.participants else None),
        _stated("Rationale", answers.sample_size_rationale),
        *now.power,
    ]


def _randomization(study: Study) -> str | None:
    seed = study.preregistration.seed
    return None if seed is None else f"by `steadyhand plan` with the seed {seed}"


def _other(study: Study) -> list[str]:
    return [_stated("Other", study.preregistration.other)]
