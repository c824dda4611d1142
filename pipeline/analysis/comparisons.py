"""From the study's entries under `comparisons` to the rows of that table: which test, of which values, and families."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence

import pandas as pd

from pipeline.analysis import error_tests, families
from pipeline.analysis.between_tests import all_groups, mixed_design, pairs_of_groups, welch_t
from pipeline.analysis.comparison_rows import Answer
from pipeline.analysis.complete_cases import Request
from pipeline.analysis.within_tests import anova, art, crossover_design, friedman_test, mixed_models, paired_t, pairwise
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.bayes import bayes_t
from pipeline.statistics.equivalence import tost
from pipeline.statistics.kruskal import kruskal_pairs, kruskal_wallis
from pipeline.statistics.mann_whitney import mann_whitney
from pipeline.statistics.rank import wilcoxon
from pipeline.statistics.welch import anova_welch, games_howell
from pipeline.study.comparison import Comparison
from pipeline.study.measures import has_total, measure_order
from pipeline.study.settings import Study
from pipeline.tables.table import Row

People = Mapping[str, Mapping[str, str]]
"""participants.csv by column: the value of each participant."""


def compared(study: Study, measures: pd.DataFrame, observations: pd.DataFrame, people: People | None = None) -> Answer:
    """Every row of `comparisons`, and every exclusion that results from them, once each.

    Raises PipelineError where an entry names no measure of the data or does not fit the design.
    """
    rows: list[Row] = []
    exclusions: list[Row] = []
    if study.comparisons and len(study.conditions) < 2:
        raise PipelineError("study.yaml: comparisons need at least two conditions; `conditions` lists only one")
    by_entry: list[tuple[Comparison, list[Row]]] = []
    for requests in all_requests(study, measures, observations, people):
        entry_rows: list[Row] = []
        for request in requests:
            answer, incomplete = RUN[request.entry.test](request)
            entry_rows += answer
            exclusions += incomplete
        by_entry.append((requests[0].entry, entry_rows))
        rows += entry_rows
    families.adjust(by_entry)
    for row in rows:
        row["details"] = json.dumps(row["details"]) if row["details"] else None
    unique = {tuple(sorted(row.items())): row for row in exclusions}
    return rows, list(unique.values())


def all_requests(
    study: Study, measures: pd.DataFrame, observations: pd.DataFrame, people: People | None = None
) -> Iterator[list[Request]]:
    """The requests of each entry, one per measure."""
    known = sorted(set(measures["measure"]), key=measure_order)
    for entry in study.comparisons:
        named = list(dict.fromkeys(name for wanted in entry.measures for name in _matching(wanted, known)))
        yield [Request(study, entry, name, measures, observations, people or {}) for name in named]


def _matching(wanted: str, known: Sequence[str]) -> list[str]:
    """The measures an entry names; `*` stands for scales, never for a total."""
    if "*" in wanted:
        pattern = ".*".join(re.escape(piece) for piece in wanted.split("*"))
        matching = [name for name in known if re.fullmatch(pattern, name) and not name.endswith("/total")]
    else:
        matching = [name for name in known if name == wanted]
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
    "anova_welch": all_groups(anova_welch, games_howell, adjusts_itself=True),
    "kruskal": all_groups(kruskal_wallis, kruskal_pairs, adjusts_itself=False),
    "mixed_anova": mixed_design,
}
"""What computes each test of study.yaml."""
