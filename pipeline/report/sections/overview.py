"""The first page: the question, the answer in two sentences and a figure, and what to be careful about."""

from __future__ import annotations

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import (
    Block,
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
from pipeline.report.figures.rainclouds import interval_words, met_one_each
from pipeline.report.prose.accuracy_claims import without_reference
from pipeline.report.prose.answer import HEADER, answer, notes, shown
from pipeline.report.sections import preregistration, traces
from pipeline.report.sections.cautions import NOT_KNOWN, cautions, contradicted
from pipeline.report.sections.material import ORIGINS, Material
from pipeline.study.measures import headlines
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row
from pipeline.words.change import amount_of_change, direction
from pipeline.words.comparison import EFFECTS_OF_CONDITION, decisive_p
from pipeline.words.effect_sizes import ratio_to_first
from pipeline.words.evidence import statistic
from pipeline.words.names import adjustment_label, measure_label, short_label, unit_of
from pipeline.words.numbers import MINUS, NO_VALUE, interval, number, p_phrase
from pipeline.words.phrases import counted, listing, participants_counted
from pipeline.words.sentences import brief_sentence, verdict

_KEY_FIGURES_MAX = 3
_SENTENCES = 2


def section(material: Material) -> Section:
    """Summary."""
    blocks: list[Block] = [Paragraph(_question(material))]
    answer = _answer(material)
    if answer:
        blocks.append(Paragraph(answer))
    keys = _key_figures(material)
    if keys:
        blocks.append(KeyFigures(tuple(keys)))
    blocks += _pairs(material)
    blocks += _figure(material)
    blocks.append(Paragraph(_data(material)))
    blocks += preregistration.notice(material)
    found = cautions(material)
    if found:
        blocks.append(Notice("To be careful about", tuple(found)))
    blocks += [Paragraph(text) for text in _evidence(material)]
    if material.sessions:
        told = "Look at every session closely, as the tracker recorded it and as each estimator reconstructed it: "
        blocks.append(Paragraph((told, Link(traces.PAGE, traces.PAGE), ".")))
    return Section("summary", "Summary", tuple(blocks))


def _pairs(material: Material) -> list[Block]:
    """The table of pairs, or as many of its lines as there is room for, with the rest named."""
    lines = answer(material.results)
    kept = shown(lines)
    if not kept:
        return []
    left_out = list(dict.fromkeys(line.measure for line in lines[len(kept) :]))
    more = f" Not shown here: {listing(left_out)}; see the results." if left_out else ""
    table = Table(
        "table-answer",
        "The answer: by how much each pair differs, in the unit of the measure.",
        columns(HEADER, 5),
        tuple(line.cells for line in kept),
        f"{notes(material.results)}{more}",
    )
    return [table]


def _answer(material: Material) -> Text:
    """Two sentences: of the two measures people look for first, else of the ratings, else of the estimators."""
    rows = _headline_rows(material)[:_SENTENCES]
    if rows:
        lead, *others = [_sentence(material, row) for row in rows]
        return (Strong(lead), *(f" {other}" for other in others))
    ratings = _ratings(material)[:_SENTENCES]
    if ratings:
        return tuple(part for text in ratings for part in (*text, " "))
    return _closest(material)


def _sentence(material: Material, row: Row) -> str:
    """The result of a comparison of the conditions, with the means and their intervals."""
    label = short_label(row["measure"])
    if row["status"] != "ok":
        return f"{label}: {brief_sentence(row)}."
    study, p = material.study, decisive_p(row)
    significant = p is not None and p < study.alpha
    found = f"{p_phrase(p)}, n = {row['n']}"
    told = {one["condition"]: one for one in material.rows("descriptives") if one["measure"] == row["measure"]}
    if row["mean_difference"] is not None and set(study.conditions) <= set(told):
        first, second = study.conditions
        change = f"{amount_of_change(row)} {direction(row)}" if row["mean_difference"] else "the same"
        means = f"{_mean(told[second])} with {second} against {_mean(told[first])} with {first}"
        sure = "" if significant else ", a difference that is not statistically significant"
        return f"{label} was {change} with {second} than with {first}{sure}: on average {means} ({found})."
    if ratio_to_first(row):
        first, second = study.conditions
        sure = "" if significant else ", a difference that is not statistically significant"
        side = "lower" if row["details"]["ratio_to_first"] < 1 else "higher"
        return f"{label} was {side} with {second} than with {first}{sure}: its {ratio_to_first(row)} ({found})."
    ranked = sorted((one for one in told.values() if one["mean"] is not None), key=lambda one: one["mean"])
    verb = "differs" if significant else "does not differ statistically significantly"
    if len(ranked) < 2:
        return f"{label} {verb} between the conditions ({found})."
    ends = f"{_mean(ranked[0])} with {ranked[0]['condition']} to {_mean(ranked[-1])} with {ranked[-1]['condition']}"
    return f"{label} {verb} between the conditions: means run from {ends} ({found})."


def _mean(row: Row) -> str:
    """`12.3 s [10.1, 14.5]`: a mean and its 95 % interval."""
    parts = (number(row["mean"]), unit_of(row["measure"]), interval(row["ci_low"], row["ci_high"]))
    return " ".join(part for part in parts if part not in ("", NO_VALUE))


def _closest(material: Material) -> Text:
    """The estimator with the smallest mean error and the one after it, with their range over sessions.

    Without a reference nobody knows which is closest to the hand.
    """
    if without_reference(material.results):
        return (Strong(NOT_KNOWN), f" {_distances(material)}")
    unsure = contradicted(material)
    if unsure and material.rows("accuracy_means"):
        return (Strong(unsure), f" {_distances(material)}")
    means = list(_means(material).items())[:_SENTENCES]
    errors = {
        name: [row["rmse_mm"] for row in material.rows("accuracy") if row["estimator"] == name] for name, _ in means
    }
    told = [
        f"{number(mean, 1)} mm on average over {counted(n, 'session')}"
        + (
            f" ({number(min(errors[name]), 1)} to {number(max(errors[name]), 1)} mm in single sessions)"
            if n > 1
            else ""
        )
        for name, (mean, n) in means
    ]
    if not told:
        return ()
    lead = f"{means[0][0]} comes closest to the reference: its root mean square error (RMSE) is {told[0]}."
    after = (f" Next is {name} with {text}." for (name, _), text in zip(means[1:], told[1:], strict=True))
    return (Strong(lead), *after)


def _figure(material: Material) -> list[Figure]:
    """The one figure that shows the answer."""
    for row in _headline_rows(material):
        wide = material.participant_means(row["measure"])
        if row["status"] == "ok" and wide.notna().any().any():
            return [_of_people(material, row["measure"], wide)]
    rows = pd.DataFrame(material.rows("accuracy"))
    if rows.empty or material.rows("comparisons"):
        return []
    n = rows["session"].nunique()
    return [
        material.figure(
            "answer",
            figures.errors,
            *_of_errors(material, n),
            rows,
        )
    ]


def _of_people(material: Material, measure: str, wide: pd.DataFrame) -> Figure:
    label, compared = measure_label(measure), len(material.study.conditions) == 2 and len(wide.dropna()) > 1
    differences = (
        " Right: each participant's difference, and the mean difference with its interval; zero is no difference."
    )
    mark = "each small mark is a participant" if met_one_each(wide) else "each line is a participant"
    shares = material.of_shares(measure)
    large = f"large marks are means with 95 % intervals{interval_words(wide, measure, shares)}"
    told = [
        f"{row['condition']} {_mean(row)}"
        for row in material.rows("descriptives")
        if row["measure"] == measure and row["mean"] is not None
    ]
    return material.figure(
        "answer",
        figures.paired,
        f"{label}: {mark}, {large}.{differences if compared else ''}",
        f"{label} of each participant by condition. Means with 95 % intervals: {'; '.join(told)}.",
        wide,
        measure,
        shares,
    )


def _data(material: Material) -> Text:
    """Where the data come from."""
    logs = f" {counted(len(material.sessions), 'session')} of raw sensor logs." if material.sessions else ""
    source = material.study.citation.strip()
    kind, _, what = ORIGINS[material.study.data_origin].partition(": ")
    return (Strong(f"{kind}: "), what, logs, f" Source: {source}" if source else "")


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
    return (Strong("How accurately does each estimator follow the hand? "), f"{people}{compared}.")


def _of_conditions(material: Material) -> list[Row]:
    """The rows that compare all conditions at once: omnibus ones, or the pair where there are two conditions."""
    return [
        row
        for row in material.rows("comparisons")
        if row["effect"] in EFFECTS_OF_CONDITION and (row["contrast"] is None or len(material.study.conditions) == 2)
    ]


def _headline_rows(material: Material) -> list[Row]:
    """One omnibus row a measure that is no questionnaire's, the well-known measures first."""
    rows = [
        row for row in _of_conditions(material) if "/" not in row["measure"] and TESTS[row["test"]].tests_difference
    ]
    first = {row["measure"]: row for row in reversed(rows)}
    known = headlines(first)
    return [first[name] for name in [*known, *sorted(set(first) - set(known))]]


def _key_figures(material: Material) -> list[KeyFigure]:
    """Up to three large figures; of more than two conditions none, for no single one answers."""
    if len(material.study.conditions) > 2 and material.rows("comparisons"):
        return []
    keys = [_key_figure(row) for row in _headline_rows(material)]
    return (keys or _accuracy_keys(material))[:_KEY_FIGURES_MAX]


def _key_figure(row: Row) -> KeyFigure:
    label = measure_label(row["measure"])
    if row["status"] != "ok":
        return KeyFigure("undefined", label, row["status"])
    p = p_phrase(decisive_p(row))
    evidence = f"{statistic(row)}, {p}, n = {row['n']}"
    if ratio_to_first(row):
        return KeyFigure(f"× {number(row['details']['ratio_to_first'])}", label, evidence)
    if row["mean_difference"] is None:
        return KeyFigure(p, label, f"{statistic(row)}, n = {row['n']}")
    sign = MINUS if row["mean_difference"] >= 0 else "+"
    return KeyFigure(f"{sign}{amount_of_change(row)}", label, evidence)


def _means(material: Material) -> dict[str, tuple[float, int]]:
    """Mean RMSE over sessions and their number, by estimator, best first where that is known."""
    ranked = material.rows("accuracy_means")
    if not (without_reference(material.results) or contradicted(material)):
        ranked = sorted(ranked, key=lambda row: row["rmse_mm"])
    return {row["estimator"]: (row["rmse_mm"], row["n"]) for row in ranked}


def _distances(material: Material) -> str:
    """How far each estimator is from what it is held against, in the study's order: none is called the best."""
    told = listing([f"{name} {number(mean, 1)} mm" for name, (mean, _) in _means(material).items()])
    if without_reference(material.results):
        return f"Root mean square distance from the smoothed readings, which is not an error: {told}."
    return f"Root mean square error, means over all sessions, those included: {told}."


def _of_errors(material: Material, n: int) -> tuple[str, str]:
    """Caption and alternative text of the figure of errors on the first page."""
    marks = f"small marks are sessions (n = {n}), large marks their means"
    if without_reference(material.results):
        return (
            f"Distance from the smoothed readings (left) and lag behind them (right) of each estimator, {marks}.",
            f"Dot plot of distance and lag from the smoothed readings by estimator over {counted(n, 'session')}.",
        )
    where = contradicted(material) or "An estimator that helps sits to the left in both."
    return (
        f"Error (left) and lag (right) of each estimator, {marks}. {where}",
        f"Dot plot of RMSE and lag by estimator over {counted(n, 'session')}.",
    )


def _accuracy_keys(material: Material) -> list[KeyFigure]:
    if without_reference(material.results) or contradicted(material):
        return []
    return [
        KeyFigure(f"{number(mean, 1)} mm", f"{name}: position error", f"mean RMSE of {counted(n, 'session')}")
        for name, (mean, n) in _means(material).items()
    ]


def _evidence(material: Material) -> list[Text]:
    """What the answer rests on: a sentence a headline, one for the questionnaires, one for the estimators."""
    answers: list[Text] = []
    for row in _headline_rows(material):
        if row["contrast"] is None and row["mean_difference"] is None and not ratio_to_first(row):
            said = brief_sentence(row)
            if row["status"] == "ok":
                said = f"{verdict(row, material.study.alpha)} ({said})"
            answers.append((Strong(f"{measure_label(row['measure'])}: "), f"{said}."))
    for row in _of_conditions(material):
        if not TESTS[row["test"]].tests_difference and row["status"] == "ok":
            said = f"{verdict(row, material.study.alpha)} ({brief_sentence(row, with_change=False)})"
            answers.append((Strong(f"{measure_label(row['measure'])}: "), f"{said}."))
    answers += _ratings(material)
    means = _means(material)
    if means and (without_reference(material.results) or contradicted(material)):
        if answers:  # else the answer at the top of the page has the same distances
            unsure = contradicted(material)
            answers.append((Strong("Accuracy: "), *([f"{unsure} "] if unsure else []), _distances(material)))
    elif means:
        best, (lowest, n) = next(iter(means.items()))
        others = "; ".join(f"{name} {number(mean, 1)} mm" for name, (mean, _) in list(means.items())[1:])
        tail = f" Others: {others}." if others else ""
        answers.append(
            (
                Strong("Accuracy: "),
                (
                    f"{best} comes closest to the reference, with a root mean square error (RMSE) of"
                    f" {number(lowest, 1)} mm on average over {counted(n, 'session')}.{tail}"
                ),
            )
        )
    return answers


def _ratings(material: Material) -> list[Text]:
    """How many scales of a questionnaire differ, before and after the adjustment, over the rows of one test."""
    answers: list[Text] = []
    alpha = material.study.alpha
    families: dict[tuple[str, str], list[Row]] = {}
    for row in _of_conditions(material):
        if "/" in row["measure"] and TESTS[row["test"]].tests_difference:
            families.setdefault((row["measure"].partition("/")[0], row["test"]), []).append(row)
    for (questionnaire, _), rows in families.items():
        label = measure_label(f"{questionnaire}/x").partition(":")[0]
        below = [row for row in rows if row["p"] is not None and row["p"] < alpha]
        text = f"{len(below)} of {counted(len(rows), 'scale')} differ at the {100 * alpha:g} % level before adjustment"
        if any(row["p_adjusted"] is not None for row in rows):
            kept = [row for row in rows if row["p_adjusted"] is not None and row["p_adjusted"] < alpha]
            method = adjustment_label(rows[0]["adjust"])
            text += f", and {len(kept)} after adjustment for {counted(len(rows), 'test')} ({method})"
        answers.append((Strong(f"{label}: "), f"{text}."))
    return answers
