"""The first page: the question, the answer in numbers, and what to be careful about."""

from __future__ import annotations

from pipeline.document.model import Block, KeyFigure, KeyFigures, Notice, Paragraph, Section, Strong, Text
from pipeline.sections.material import Material, Row
from pipeline.wording import (
    EFFECTS_OF_CONDITION,
    MINUS,
    adjustment,
    comparison_sentence,
    counted,
    decisive_p,
    listing,
    measure_label,
    number,
    p_phrase,
    percent,
    reduction_phrase,
    statistic,
    verdict,
)

_HEADLINES = ("selection_mse_px2", "selection_mse_mm2", "completion_time_s", "trial_time_s")
_KEY_FIGURES_MAX = 3
_NOT_OF_CHANCE = ("tost", "bayes_t")  # they answer another question than whether there is a difference


def section(material: Material) -> Section:
    """Summary."""
    blocks: list[Block] = [Paragraph(_question(material))]
    keys = _key_figures(material)
    if keys:
        blocks.append(KeyFigures(tuple(keys)))
    blocks += [Paragraph(text) for text in _answers(material)]
    cautions = _cautions(material)
    if cautions:
        blocks.append(Notice("To be careful about", tuple(cautions)))
    return Section("summary", "Summary", tuple(blocks))


def _question(material: Material) -> Text:
    conditions = material.study.conditions
    compared = (
        "" if len(conditions) == 1 else f" under {counted(len(conditions), 'condition')}, {listing(list(conditions))}"
    )
    people = counted(material.results["study"]["participants"]["n"], "participant")
    if material.rows("comparisons"):
        return (
            Strong("Does it make a difference to people which system they use? "),
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
    rows = [row for row in _of_conditions(material) if "/" not in row["measure"] and row["test"] not in _NOT_OF_CHANCE]
    first = {row["measure"]: row for row in reversed(rows)}
    known = [name for name in _HEADLINES if name in first]
    return [first[name] for name in [*known, *sorted(set(first) - set(known))]]


def _key_figures(material: Material) -> list[KeyFigure]:
    keys = [_key_figure(row) for row in _headline_rows(material)]
    return (keys or _accuracy_keys(material))[:_KEY_FIGURES_MAX]


def _key_figure(row: Row) -> KeyFigure:
    label = measure_label(row["measure"])
    if row["status"] != "ok":
        return KeyFigure("undefined", label, row["status"])
    p = p_phrase(decisive_p(row))
    evidence = f"{statistic(row)}, {p}, n = {row['n']}"
    if row["reduction"] is None:
        return KeyFigure(p, label, f"{statistic(row)}, n = {row['n']}")
    sign = MINUS if row["reduction"] >= 0 else "+"
    return KeyFigure(f"{sign}{percent(abs(row['reduction']))}", label, evidence)


def _means(material: Material) -> dict[str, tuple[float, int]]:
    """Mean RMSE over sessions and their number, by estimator, best first."""
    ranked = sorted(material.rows("accuracy_means"), key=lambda row: row["rmse_mm"])
    return {row["estimator"]: (row["rmse_mm"], row["n"]) for row in ranked}


def _accuracy_keys(material: Material) -> list[KeyFigure]:
    return [
        KeyFigure(f"{number(mean, 1)} mm", f"{name}: position error", f"mean RMSE of {counted(n, 'session')}")
        for name, (mean, n) in _means(material).items()
    ]


def _answers(material: Material) -> list[Text]:
    """A sentence a headline, one for the questionnaires, one for the estimators."""
    answers: list[Text] = []
    for row in _headline_rows(material):
        label = measure_label(row["measure"])
        if row["status"] != "ok":
            answers.append((Strong(f"{label}: "), f"{comparison_sentence(row)}."))
            continue
        change = ""
        if row["reduction"] is not None:
            first, second = material.study.conditions
            change = f"{reduction_phrase(row['reduction'])} with {second} relative to {first}; "
        said = f"{verdict(row, material.study.alpha)} ({comparison_sentence(row, with_reduction=False)})"
        answers.append((Strong(f"{label}: "), f"{change}{said}."))
    for row in _of_conditions(material):
        if row["test"] in _NOT_OF_CHANCE and row["status"] == "ok":
            said = f"{verdict(row, material.study.alpha)} ({comparison_sentence(row, with_reduction=False)})"
            answers.append((Strong(f"{measure_label(row['measure'])}: "), f"{said}."))
    answers += _ratings(material)
    means = _means(material)
    if means:
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
        if "/" in row["measure"] and row["test"] not in _NOT_OF_CHANCE:
            families.setdefault((row["measure"].partition("/")[0], row["test"]), []).append(row)
    for (questionnaire, _), rows in families.items():
        label = measure_label(f"{questionnaire}/x").partition(":")[0]
        below = [row for row in rows if row["p"] is not None and row["p"] < alpha]
        text = f"{len(below)} of {counted(len(rows), 'scale')} differ at the {100 * alpha:g} % level taken singly"
        if any(row["p_adjusted"] is not None for row in rows):
            kept = [row for row in rows if row["p_adjusted"] is not None and row["p_adjusted"] < alpha]
            text += (
                f", and {len(kept)} after adjusting for {counted(len(rows), 'test')} ({adjustment(rows[0]['adjust'])})"
            )
        answers.append((Strong(f"{label}: "), f"{text}."))
    return answers


def _is_singular(row: Row) -> bool:
    return bool((row["details"] or {}).get("singular"))


def _of_design(material: Material) -> list[Text]:
    """How many things in the check of the design are not as they should be."""
    remarked = [row for row in material.rows("design_check") if row["remark"]]
    if not remarked:
        return []
    return [(f"{counted(len(remarked), 'remark')} on the design; see design and participants.",)]


def _cautions(material: Material) -> list[Text]:
    study = material.study
    cautions: list[Text] = []
    if study.data_origin == "reconstructed":
        cautions.append(
            (
                Strong("The data are reconstructed: "),
                "they fit printed figures and are nobody's measurements.",
            )
        )
    if study.data_origin == "simulated":
        cautions.append((Strong("The data are simulated: "), "they show what a model does, not what people do."))
    n = material.results["study"]["participants"]["n"]
    if material.rows("comparisons") and n < 8:
        cautions.append(
            (
                Strong("Few participants: "),
                f"with n = {n} intervals are wide and a normal distribution cannot be checked.",
            )
        )
    violated = [
        measure_label(row["measure"])
        for row in material.rows("comparisons")
        if row["test"] == "rm_anova" and ((row["details"] or {}).get("mauchly_p") or 1) < study.alpha
    ]
    if violated:
        names = listing(list(dict.fromkeys(violated)))
        cautions.append(
            (
                Strong("Sphericity is violated "),
                f"(the differences between conditions vary unequally) for {names}: judge by the Greenhouse-Geisser p.",
            )
        )
    singular = [measure_label(row["measure"]) for row in material.rows("comparisons") if _is_singular(row)]
    if singular:
        names = listing(list(dict.fromkeys(singular)))
        cautions.append(
            (
                Strong("Singular fit "),
                f"of the mixed model for {names}: it finds no variance between participants, so that it treats their"
                " rows as if of different people.",
            )
        )
    cautions += _of_design(material)
    undefined = sum(row["status"] != "ok" for row in material.rows("comparisons"))
    if undefined:
        cautions.append((f"{counted(undefined, 'comparison')} cannot be computed; the table of comparisons says why.",))
    contradictions = [row for row in material.rows("printed") if row["verdict"] == "contradiction"]
    if contradictions:
        verb = "contradicts" if len(contradictions) == 1 else "contradict"
        cautions.append(
            (f"{counted(len(contradictions), 'printed figure')} {verb} others in the same publication; see there.",)
        )
    lost = [row for row in material.rows("exclusions") if row["what"] in ("session set aside", "session read in part")]
    if lost:
        cautions.append((f"{counted(len(lost), 'session')} could not be used, or only in part; see data quality.",))
    others = len(material.rows("exclusions")) - len(lost)
    if others:
        cautions.append(
            (
                (
                    f"{counted(others, 'further exclusion or gap', 'further exclusions or gaps')} in the data; see data"
                    " quality."
                ),
            )
        )
    honest = [
        row["estimator"] for row in material.rows("accuracy") if row["coverage_95"] < 0.9 and row["estimator"] != "raw"
    ]
    if honest:
        names = listing(list(dict.fromkeys(honest)))
        cautions.append(
            (
                Strong("Stated uncertainty too small "),
                (
                    f"in at least one session for {names}: the 95 % intervals hold the reference in less than 90 % of"
                    " instants."
                ),
            )
        )
    return cautions
