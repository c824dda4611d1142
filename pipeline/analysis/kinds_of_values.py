"""What kind of values a measure has, where a test of study.yaml takes them for another kind: rows of `design_check`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from pipeline.analysis.complete_cases import Request
from pipeline.statistics.shape import SKEWED, residual_skewness
from pipeline.study.measures import measure
from pipeline.study.statistical_tests import TESTS
from pipeline.tables import table as tables
from pipeline.tables.table import Row
from pipeline.words.numbers import number
from pipeline.words.phrases import listing

SHAPE = "shape of values"
_WHOLE = 1e-9  # how far a count of yes may be from a whole number, for round-off


def yes_or_no(requests: Sequence[Request]) -> Iterator[Row]:
    """Measures whose values are all 0 or 1, in tests that treat them as measurements."""
    for name, of_measure in _by_measure(requests):
        rows = of_measure[0].observations[of_measure[0].observations["measure"] == name]
        if not (are_answers(rows) and rows["value"].nunique() > 1):
            continue
        row = {"what": "kind of values", "measure": name, "found": "0 or 1 in every trial"}
        of_answers = [one for one in of_measure if TESTS[one.entry.test].values == "answers"]
        several = bool((rows["n"] > 1).any())
        if several and any(TESTS[one.entry.test].complete_cases for one in of_answers):
            remark = (
                "mcnemar and cochran_q take one answer of each participant in each condition, and there are several"
            )
            yield {**row, "expected": "one in each cell", "remark": f"{remark}; test: gee_logit takes all of them"}
        as_measured = [one for one in of_measure if one not in of_answers]
        if as_measured:
            of_one = "mcnemar" if len(of_measure[0].study.conditions) == 2 else "cochran_q"
            suited = "gee_logit" if several else of_one
            kinds = f"McNemar's or Cochran's test, or a logistic model, suits such data (test: {suited})"
            remark = f"{_labels(as_measured)} treat yes and no as measurements; {kinds}"
            yield {**row, "expected": "measurements", "remark": remark}


def are_answers(observations: pd.DataFrame) -> bool:
    """Are all values behind the observations of a measure 0 or 1, so that each mean of several is a share?"""
    values = observations["value"].to_numpy(np.float64)
    ones = values * observations["n"].to_numpy(np.float64)
    whole = len(ones) > 0 and bool((abs(ones - ones.round()) < _WHOLE).all())
    return whole and bool(((values >= 0) & (values <= 1)).all())


def skewed(requests: Sequence[Request]) -> Iterator[Row]:
    """Skewed measures above zero, as times often are, whose means are tested although their logarithms could be.

    Only measures that are known to have a zero that means none: a ratio of anything else means nothing.
    """
    for name, of_measure in _by_measure(requests):
        able = [request for request in of_measure if "transform" in request.entry.options]
        if not able or measure(name).scale != "ratio" or any(one.entry.transform == "log" for one in able):
            continue
        wide = tables.participant_means(able[0].measures, name, able[0].study.conditions).to_numpy(np.float64)
        values, cells = wide[np.isfinite(wide)], np.nonzero(np.isfinite(wide))[1]
        if not len(values) or values.min() <= 0:
            continue
        plain, of_logs = residual_skewness(values, cells), residual_skewness(np.log(values), cells)
        if plain is None or of_logs is None or plain <= SKEWED or abs(of_logs) >= plain:
            continue
        yield {
            "what": SHAPE,
            "measure": name,
            "found": f"skewness {number(plain)}, of the logarithms {number(of_logs)}",
            "expected": f"skewness up to {SKEWED:g}",
            "remark": f"skewed; {_labels(able)} with transform: log would compare geometric means",
        }


def _by_measure(requests: Sequence[Request]) -> Iterator[tuple[str, list[Request]]]:
    for name in dict.fromkeys(request.measure for request in requests):
        yield name, [request for request in requests if request.measure == name]


def _labels(requests: Sequence[Request]) -> str:
    return listing(list(dict.fromkeys(TESTS[request.entry.test].label for request in requests)))
