"""The means of the conditions that a row of `comparisons` compares, as text.

A sentence states means only where they belong to its test: of all conditions that it compares, and of the same people.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pipeline.study.statistical_tests import TESTS, Values
from pipeline.words.comparison import EFFECTS_OF_CONDITION, Row
from pipeline.words.names import measure_as_subject, unit_of
from pipeline.words.numbers import digits_beside, number, percent


@dataclass(frozen=True)
class StudyFacts:
    """What a sentence needs of the study beside its own row of `comparisons`.

    `conditions` are in the study's order, `alpha` is the level of significance, `descriptives` holds the rows of that
    table by measure and condition.
    """

    conditions: tuple[str, ...]
    alpha: float
    descriptives: Mapping[tuple[str, str], Row]


def study_facts(conditions: Sequence[str], alpha: float, descriptives: Sequence[Row]) -> StudyFacts:
    """`StudyFacts` from the rows of the table `descriptives`."""
    return StudyFacts(tuple(conditions), alpha, {(row["measure"], row["condition"]): row for row in descriptives})


def means_sentence(measure: str, facts: StudyFacts) -> str:
    """M, SD and n of every condition, for a measure whose sentences do not state them."""
    rows = [row for condition in facts.conditions if (row := facts.descriptives.get((measure, condition)))]
    parts = [f"{_mean_and_sd(row)}, n = {row['n']}" for row in rows]
    return f"{measure_as_subject(measure)}: {'; '.join(parts)}." if parts else ""


def states_means(row: Row, facts: StudyFacts) -> bool:
    """Does the row's sentence state the means of all conditions?"""
    return row["status"] == "ok" and TESTS[row["test"]].tests_difference and any(means_of_conditions(row, facts))


def means_of_conditions(row: Row, facts: StudyFacts) -> Iterator[str]:
    """M and SD of each condition, or nothing where the row does not compare all of them or is of other people.

    A test of answers or counts rests on all trials, not on a mean per participant: its own share or rate is stated.
    """
    if row["effect"] not in EFFECTS_OF_CONDITION or (row["contrast"] is not None and len(facts.conditions) > 2):
        return
    of_all_trials = (row["details"] or {}).get("means")
    if of_all_trials is not None:
        for condition, mean in zip(facts.conditions, of_all_trials, strict=True):
            yield f"{condition}: {_share_or_rate(row, mean)}"
        return
    described = [facts.descriptives.get((row["measure"], condition)) for condition in facts.conditions]
    if all(one is not None and one["n"] == row["n"] for one in described):
        yield from (_mean_and_sd(one, TESTS[row["test"]].values) for one in described if one is not None)


def _share_or_rate(row: Row, mean: float) -> str:
    """`93.0 %` of answers, `0.42 per trial` of counts."""
    return percent(mean) if TESTS[row["test"]].values == "answers" else f"{number(mean)} per {_unit_of_exposure(row)}"


def _unit_of_exposure(row: Row) -> str:
    """What a rate is of: a trial, or a unit of the exposure."""
    exposure = (row["details"] or {}).get("exposure")
    if exposure is None:
        return "trial"
    return unit_of(exposure) or f"unit of {measure_as_subject(exposure).lower()}"


def _mean_and_sd(described: Row, values: Values = "measurements") -> str:
    if values == "answers":
        return f"{described['condition']}: {percent(described['mean'])}"
    digits = digits_beside(2, described["mean"], described["sd"] or 0)
    spread = "" if described["sd"] is None else f", SD = {number(described['sd'], digits)}"
    return f"{described['condition']}: M = {number(described['mean'], digits)}{spread}"
