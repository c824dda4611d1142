"""From the study's entries under `comparisons` to the rows of that table: which test, of which values, and families."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.analysis import error_tests, families
from pipeline.analysis.between_tests import all_groups, mixed_design, pairs_of_groups, welch_t
from pipeline.analysis.comparison_rows import Answer
from pipeline.analysis.complete_cases import People, Request, Values
from pipeline.analysis.groups import one_condition_each
from pipeline.analysis.within_tests import anova, art, crossover_design, friedman_test, mixed_models, paired_t, pairwise
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics import NO_COMPLETE, ONE_CONDITION_EACH
from pipeline.statistics.bayes import bayes_t
from pipeline.statistics.equivalence import tost
from pipeline.statistics.kruskal import kruskal_pairs, kruskal_wallis
from pipeline.statistics.mann_whitney import mann_whitney
from pipeline.statistics.tukey import tukey_kramer
from pipeline.statistics.welch import anova_welch, games_howell
from pipeline.statistics.wilcoxon import wilcoxon
from pipeline.study.comparison import Comparison, matching_measures
from pipeline.study.given_tables import read_participants
from pipeline.study.measures import has_total, measure_order
from pipeline.study.pseudonyms import Pseudonyms
from pipeline.study.settings import Study
from pipeline.study.statistical_tests import TUKEY
from pipeline.study.table_file import table_file
from pipeline.tables.table import Row


def people_of(study: Study, folder: Path, pseudonyms: Pseudonyms | None = None) -> People:
    """participants.csv of a study folder by column, under pseudonyms where there are any; empty without that file."""
    file = table_file(study, folder, "participants", pseudonyms)
    if file is None:
        return {}
    table = read_participants(file).set_index("participant")
    return {str(column): {str(person): str(value) for person, value in table[column].items()} for column in table}


def compared(answers: Sequence[Answered]) -> Answer:
    """Every row of `comparisons`, and every exclusion that results from them, once each."""
    rows = [row for one in answers for row in one.rows]
    for row in rows:
        row["details"] = json.dumps(row["details"]) if row["details"] else None
    exclusions = (row for one in answers for row in one.exclusions)
    unique = {tuple(sorted(row.items())): row for row in exclusions}
    return rows, list(unique.values())


@dataclass(frozen=True)
class Answered:
    """A request, its rows of `comparisons` with `details` as a mapping, and the exclusions of incomplete people."""

    request: Request
    rows: list[Row]
    exclusions: list[Row]


def answered(study: Study, values: Values) -> list[Answered]:
    """Every request and its rows, in the order of study.yaml, with p values adjusted.

    Raises PipelineError where an entry names no measure of the data or does not fit the design.
    """
    if study.comparisons and len(study.conditions) < 2:
        raise PipelineError("study.yaml: comparisons need at least two conditions; `conditions` lists only one")
    answers: list[Answered] = []
    by_entry: list[tuple[Comparison, list[Row]]] = []
    for requests in all_requests(study, values):
        of_entry = [_answer(request) for request in requests]
        answers += of_entry
        by_entry.append((requests[0].entry, [row for one in of_entry for row in one.rows]))
    families.adjust(by_entry)
    return answers


def _answer(request: Request) -> Answered:
    """A request's rows; where nobody is complete since each participant met one condition, that is the status."""
    rows, exclusions = RUN[request.entry.test](request)
    met = set(zip(request.measures["participant"], request.measures["condition"], strict=True))
    if any(row["status"] == NO_COMPLETE for row in rows) and one_condition_each(request.study, met):
        rows = [{**row, "status": ONE_CONDITION_EACH} if row["status"] == NO_COMPLETE else row for row in rows]
    return Answered(request, rows, exclusions)


def all_requests(study: Study, values: Values) -> Iterator[list[Request]]:
    """The requests of each entry, one per measure."""
    known = sorted(set(values.measures["measure"]), key=measure_order)
    for entry in study.comparisons:
        named = list(dict.fromkeys(name for wanted in entry.measures for name in _matching(wanted, known)))
        yield [Request(**vars(values), study=study, entry=entry, measure=name) for name in named]


def _matching(wanted: str, known: Sequence[str]) -> list[str]:
    """The measures an entry names; PipelineError where there are none."""
    matching = matching_measures(wanted, known)
    if not matching and wanted.endswith("/total"):
        matching = _only_score(wanted.removesuffix("total"), known)
    if not matching:
        hint = did_you_mean(wanted, known)
        raise PipelineError(f'study.yaml: comparisons: there is no measure "{wanted}" in the data{hint}')
    return matching


def _only_score(prefix: str, known: Sequence[str]) -> list[str]:
    """What is meant by the total of an instrument that has a single score; PipelineError for one without a rule."""
    scores = [name for name in known if name.startswith(prefix)]
    if len(scores) == 1:
        return scores
    if scores and not has_total(prefix.removesuffix("/")):
        questionnaire = prefix.removesuffix("/")
        raise PipelineError(
            f'study.yaml: comparisons: "{questionnaire}" has no total because nothing says how it is scored; state'
            f" scoring: {{{questionnaire}: {{rule: sum, range: [lowest, highest answer]}}}}, or compare"
            f" {questionnaire}/*"
        )
    return []


RUN: Mapping[str, Callable[[Request], Answer]] = {
    "rm_anova": anova,
    "art_anova": art,
    "friedman": friedman_test,
    "t_paired": pairwise(paired_t),
    "wilcoxon": pairwise(lambda request, first, second: wilcoxon(first, second, zeros=request.entry.zeros)),
    "tost": pairwise(lambda request, first, second: tost(first, second, request.entry.bounds or (0.0, 0.0))),
    "bayes_t": pairwise(lambda request, first, second: bayes_t(first, second, request.entry.prior_scale)),
    "mixed_model": mixed_models,
    "mcnemar": error_tests.mcnemar_pairs,
    "cochran_q": error_tests.cochran,
    "gee_logit": error_tests.logistic,
    "gee_poisson": error_tests.counted,
    "crossover": crossover_design,
    "t_welch": pairs_of_groups(welch_t),
    "mann_whitney": pairs_of_groups(lambda _, first, second, effect: mann_whitney(first, second, effect)),
    "anova_welch": all_groups(anova_welch, games_howell, adjusts_itself=True, others={TUKEY: tukey_kramer}),
    "kruskal": all_groups(kruskal_wallis, kruskal_pairs, adjusts_itself=False),
    "mixed_anova": mixed_design,
}
"""What computes each test of study.yaml."""
