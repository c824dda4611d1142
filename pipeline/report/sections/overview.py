"""The first page: the question, the answer in two sentences and a figure, and what to be careful about."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import (
    Block,
    CrossReference,
    Figure,
    KeyFigure,
    KeyFigures,
    Link,
    Notice,
    Paragraph,
    Section,
    Strong,
    Table,
    Text,
    columns,
)
from pipeline.report.figures.rainclouds import interval_words, one_condition_each
from pipeline.report.prose.answer import (
    HEADER,
    answer,
    averages_unequal_groups,
    lines_for_first_page,
    notes,
    with_difference,
)
from pipeline.report.sections import overview_estimators, preregistration, traces
from pipeline.report.sections.cautions import cautions
from pipeline.report.sections.material import Material
from pipeline.statistics import OK
from pipeline.study.measures import headlines, measure
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.change import amount_of_change, difference_phrase, direction
from pipeline.words.comparison import EFFECTS_OF_CONDITION, decisive_p, test_label
from pipeline.words.effect_sizes import ratio_to_first
from pipeline.words.evidence import statistic
from pipeline.words.names import adjustment_label, measure_as_subject, measure_label, short_label, unit_of, was
from pipeline.words.numbers import estimate, number, p_phrase
from pipeline.words.phrases import counted, listing, participants_counted
from pipeline.words.sentences import brief_sentence, verdict

_SENTENCES = 2
_FURTHER_MAX = 8  # on the first page, below the table of pairs


def section(material: Material) -> Section:
    """Summary."""
    blocks: list[Block] = [Paragraph(_question(material))]
    sentences = _answer(material)
    if sentences:
        blocks.append(Paragraph(sentences))
    keys = _key_figures(material)
    if keys:
        blocks.append(KeyFigures(tuple(keys)))
    blocks += _pairs(material)
    blocks += _figure(material)
    blocks += [Paragraph(text) for text in (_data(material),) if text]
    blocks += preregistration.notice(material)
    careful = cautions(material)
    if careful:
        blocks.append(Notice("To be careful about", tuple(careful)))
    further = _further_results(material)
    blocks += [Paragraph(text) for text in further[:_FURTHER_MAX]]
    if len(further) > _FURTHER_MAX:
        text = f"{counted(len(further) - _FURTHER_MAX, 'more result')}: see the "
        blocks.append(Paragraph((text, CrossReference("table of all comparisons", "comparisons"), ".")))
    if material.sessions:
        text = "Look at every session closely, as the tracker recorded it and as each estimator reconstructed it: "
        blocks.append(Paragraph((text, Link(traces.PAGE, traces.PAGE), ".")))
    return Section("summary", "Summary", tuple(blocks))


def _pairs(material: Material) -> list[Block]:
    """The table of pairs, or as many of its lines as there is room for, with the other measures named."""
    lines = answer(material.results)
    on_page = lines_for_first_page(lines)
    if not on_page:
        return []
    left_out = list(dict.fromkeys(line.measure for line in lines[len(on_page) :]))
    more = f" Not shown here: {listing(left_out)}; see the results." if left_out else ""
    table = Table(
        "table-answer",
        "The answer: by how much each pair differs, in the unit of the measure.",
        columns(HEADER, 5),
        tuple(line.cells for line in on_page),
        f"{notes(material.results)}{more}",
        cards=True,
    )
    return [table]


def _answer(material: Material) -> Text:
    """Two sentences: on the two measures people look for first, or else on the ratings, or else on the estimators."""
    rows = _headline_rows(material)[:_SENTENCES] or _only_score(material)
    if rows:
        lead, *others = [_sentence(material, row) for row in rows]
        return (Strong(lead), *(f" {other}" for other in others))
    ratings = _ratings(material)[:_SENTENCES]
    if ratings:
        return tuple(part for text in ratings for part in (*text, " "))
    return overview_estimators.answer(material)


def _only_score(material: Material) -> list[Row]:
    """The comparison of a study that has one score of one questionnaire, such as that of SUS, and nothing else."""
    rows = [row for row in _of_conditions(material) if TESTS[row["test"]].tests_difference]
    return [with_difference(row, None) for row in rows] if len(rows) == 1 else []


def _sentence(material: Material, row: Row) -> str:
    """The result of a comparison of the conditions, with the means and their intervals."""
    name = row["measure"]
    label = measure_as_subject(name) if measure(name).questionnaire else short_label(name)
    if row["status"] != "ok":
        return f"{label}: {brief_sentence(row)}."
    study, p = material.study, decisive_p(row)
    significant = p is not None and p < study.alpha
    evidence = f"{p_phrase(p)}, n = {row['n']}"
    described = {one["condition"]: one for one in material.rows("descriptives") if one["measure"] == row["measure"]}
    if row["mean_difference"] is not None and set(study.conditions) <= set(described):
        first, second = study.conditions
        change = f"{amount_of_change(row)} {direction(row)}" if row["mean_difference"] else "the same"
        one, other = (_mean_in_words(described[name]) for name in (second, first))
        means = f": on average{_as_root(row)} {one} with {second} against {other} with {first}"
        if averages_unequal_groups(row) or not _of_those_tested(row, (described[first], described[second])):
            said = difference_phrase(row) == amount_of_change(row)
            means = "" if said else f": a mean difference of {difference_phrase(row)}"
        sure = "" if significant else ", a difference that is not statistically significant"
        than = "than" if row["mean_difference"] else "as"
        return f"{label} {was(label)} {change} with {second} {than} with {first}{sure}{means} ({evidence})."
    if ratio_to_first(row):
        first, second = study.conditions
        sure = "" if significant else ", a difference that is not statistically significant"
        side = "lower" if row["details"]["ratio_to_first"] < 1 else "higher"
        ratio = f"{ratio_to_first(row)} ({evidence})"
        return f"{label} {was(label)} {side} with {second} than with {first}{sure}: its {ratio}."
    ranked = sorted((one for one in described.values() if one["mean"] is not None), key=lambda one: one["mean"])
    verb = "differ" if significant else "do not differ statistically significantly"
    if len(ranked) < 2 or not _of_those_tested(row, ranked):
        return f"{label}: the conditions {verb} ({evidence})."
    low, high = (f"{_mean_in_words(one)} with {one['condition']}" for one in (ranked[0], ranked[-1]))
    return f"{label}: the conditions {verb}; means run{_as_root(row)} from {low} to {high} ({evidence})."


def _of_those_tested(row: Row, described: Sequence[Row]) -> bool:
    """Are these means of the people of the test? Others could contradict its difference."""
    counts = [one["n"] for one in described]
    return row["n"] == sum(counts) or set(counts) == {row["n"]}


def _mean(row: Row) -> str:
    """`12.3 s [10.1, 14.5]`: a mean and its 95 % interval."""
    return estimate(row["mean"], row["ci_low"], row["ci_high"], unit_of(row["measure"]))


def _as_root(row: Row) -> str:
    return ", as roots," if unit_of(row["measure"]).endswith("²") else ""


def _mean_in_words(row: Row) -> str:
    """As `_mean`; of squared errors the root, in the unit that people feel, and the roots of its interval's bounds."""
    unit = unit_of(row["measure"])
    if not unit.endswith("²"):
        return _mean(row)
    bounds = (row["ci_low"], row["ci_high"])
    low, high = (math.sqrt(bound) for bound in bounds) if None not in bounds and min(bounds) >= 0 else (None, None)
    return estimate(math.sqrt(row["mean"]), low, high, unit[:-1])


def _figure(material: Material) -> list[Figure]:
    """The one figure that shows the answer."""
    measure = drawn_measure(material)
    if measure is not None:
        return [_of_people(material, measure, material.participant_means(measure))]
    errors = None if material.rows("comparisons") else overview_estimators.figure(material)
    return [] if errors is None else [errors]


def drawn_measure(material: Material) -> str | None:
    """The measure whose figure stands on the first page; it is not repeated further on."""
    described = {row["measure"] for row in material.rows("descriptives") if row["n"]}
    headlines_tested = (row["measure"] for row in _headline_rows(material) if row["status"] == "ok")
    return next((str(name) for name in headlines_tested if name in described), None)


def _of_people(material: Material, measure: str, wide: pd.DataFrame) -> Figure:
    label, compared = measure_label(measure), len(material.study.conditions) == 2 and len(wide.dropna()) > 1
    differences = (
        " Right: each participant's difference, and the mean difference with its interval; zero is no difference."
    )
    mark = "each small mark is a participant" if one_condition_each(wide) else "each line is a participant"
    shares = material.of_shares(measure)
    large = f"large marks are means with 95 % intervals{interval_words(wide, measure, shares)}"
    means = [
        f"{row['condition']} {_mean(row)}"
        for row in material.rows("descriptives")
        if row["measure"] == measure and row["mean"] is not None
    ]
    return material.figure(
        "answer",
        figures.paired,
        f"{label}: {mark}, {large}.{differences if compared else ''}",
        f"{label} of each participant by condition. Means with 95 % intervals: {'; '.join(means)}.",
        wide,
        measure,
        shares,
    )


def _data(material: Material) -> Text:
    """How many logs there are, and the source; what kind of data it is stands above the title."""
    source = material.study.citation.strip()
    parts: list[str | Strong] = []
    if material.sessions:
        parts += [Strong("Data: "), f"{counted(len(material.sessions), 'session')} of raw sensor logs. "]
    if source:
        parts += [Strong("Source: "), source]
    return tuple(parts)


def _question(material: Material) -> Text:
    conditions = material.study.conditions
    compared = (
        "" if len(conditions) == 1 else f" under {counted(len(conditions), 'condition')}, {listing(list(conditions))}"
    )
    people = participants_counted(material.results["study"]["participants"])
    if material.rows("comparisons"):
        return (
            Strong("Do the conditions differ for the people who use them? "),
            f"{people}{compared}.",
        )
    if not material.study.estimators:
        return (Strong("What was measured? "), f"{people}{compared}; nothing was compared.")
    return (Strong("How accurately does each estimator follow the hand? "), f"{people}{compared}.")


def _of_conditions(material: Material) -> list[Row]:
    """The rows that compare all conditions at once: omnibus ones, or the pair where there are two conditions."""
    return [
        row
        for row in material.rows("comparisons")
        if row["effect"] in EFFECTS_OF_CONDITION and (row["contrast"] is None or len(material.study.conditions) == 2)
    ]


def _headline_rows(material: Material) -> list[Row]:
    """One row of all conditions for each measure that is not a questionnaire's, the well-known measures first."""
    rows = [
        row for row in _of_conditions(material) if "/" not in row["measure"] and TESTS[row["test"]].tests_difference
    ]
    baseline = material.study.conditions[0]
    means = {row["measure"]: row for row in material.rows("descriptives") if row["condition"] == baseline}
    rows = [with_difference(row, means.get(row["measure"])) for row in rows]
    first = {row["measure"]: row for row in reversed(rows)}
    known = headlines(first)
    in_order = dict.fromkeys(row["measure"] for row in rows)
    return [first[name] for name in [*known, *(name for name in in_order if name not in known)]]


def _key_figures(material: Material) -> list[KeyFigure]:
    """Up to three large figures; none of more than two conditions, where no single figure is the answer."""
    if len(material.study.conditions) > 2 and material.rows("comparisons"):
        return []
    keys = [_key_figure(row) for row in _headline_rows(material) if row["status"] == OK]
    return (keys or overview_estimators.key_figures(material))[: overview_estimators.KEY_FIGURES_MAX]


def _key_figure(row: Row) -> KeyFigure:
    label = measure_label(row["measure"])
    p = p_phrase(decisive_p(row))
    evidence = f"{statistic(row)}, {p}, n = {row['n']}"
    if ratio_to_first(row):
        return KeyFigure(f"× {number(row['details']['ratio_to_first'])}", label, evidence)
    if row["mean_difference"] is None:
        return KeyFigure(p, label, f"{statistic(row)}, n = {row['n']}")
    side = direction(row).partition(" ")[0] if row["mean_difference"] else ""
    return KeyFigure(f"{amount_of_change(row)} {side}".strip(), label, evidence)


def _further_results(material: Material) -> list[Text]:
    """Sentences below the table of pairs, for what it has no line for.

    Tests of more than two conditions at once, tests of equivalence and Bayes factors, questionnaires as a whole, and
    the estimators.
    """
    answers: list[Text] = []
    for row in _headline_rows(material)[_SENTENCES:]:  # the first ones are said at the top of the page
        if row["contrast"] is None and row["mean_difference"] is None and not ratio_to_first(row):
            text = brief_sentence(row)
            if row["status"] == "ok":
                text = f"{verdict(row, material.study.alpha)} ({text})"
            answers.append((Strong(f"{measure_label(row['measure'])}: "), f"{text}."))
    for row in _of_conditions(material):
        if not TESTS[row["test"]].tests_difference and row["status"] == "ok":
            text = f"{verdict(row, material.study.alpha)} ({brief_sentence(row, with_change=False)})"
            answers.append((Strong(f"{measure_label(row['measure'])}: "), f"{text}."))
    for row in material.rows("comparisons"):
        if row["contrast"] is None and row["effect"] not in EFFECTS_OF_CONDITION and row["status"] == OK:
            answers.append((Strong(f"{measure_label(row['measure'])}: "), f"{brief_sentence(row)}."))
    if _headline_rows(material):  # else they are said at the top of the page
        answers += _ratings(material)
    of_people = _headline_rows(material) or _only_score(material) or answers
    return [*answers, *overview_estimators.statement(material, stands_alone=not of_people)]


def _ratings(material: Material) -> list[Text]:
    """How many scales of a questionnaire differ, before and after adjustment; a sentence for each test of them."""
    answers: list[Text] = []
    alpha = material.study.alpha
    families: dict[tuple[str, str], list[Row]] = {}
    for row in _of_conditions(material):
        if "/" in row["measure"] and TESTS[row["test"]].tests_difference:
            families.setdefault((row["measure"].partition("/")[0], row["test"]), []).append(row)
    for (questionnaire, _), rows in families.items():
        label = measure_label(f"{questionnaire}/x").partition(":")[0]
        if sum(name == questionnaire for name, _ in families) > 1:
            label += f", {test_label(rows[0])}"
        below = [row for row in rows if row["p"] is not None and row["p"] < alpha]
        differ = "differs" if len(rows) == 1 else "differ"
        text = f"{len(below)} of {counted(len(rows), 'scale')} {differ} at the {100 * alpha:g} % level"
        if any(row["p_adjusted"] is not None for row in rows):
            text += " before adjustment"
            adjusted_below = [row for row in rows if row["p_adjusted"] is not None and row["p_adjusted"] < alpha]
            method = adjustment_label(rows[0]["adjust"])
            text += f", and {len(adjusted_below)} after adjustment for {counted(len(rows), 'test')} ({method})"
        answers.append((Strong(f"{label}: "), f"{text}."))
    return answers
