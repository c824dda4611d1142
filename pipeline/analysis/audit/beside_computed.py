"""A paper's printed figures beside the computed ones, and checked against each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import REMARK
from pipeline.analysis.audit.phrases import label
from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.printed import (
    Cell,
    Measure,
    PrintedAccuracy,
    PrintedTest,
    Publication,
    Reduction,
    Total,
    load_publication,
)
from pipeline.study.rounded import Rounded
from pipeline.tables import table as tables
from pipeline.tables.table import Row

_STATISTIC_NAMES = {"t": "t", "F": "F", "chi2": "chi2", "W": "W+"}
_ROUND_OFF = Fraction(1, 10**6)  # of a unit in the last digit: what arithmetic leaves of a value halfway


def compare_printed(
    path: Path, descriptives: pd.DataFrame, comparisons: pd.DataFrame, accuracy_means: pd.DataFrame
) -> pd.DataFrame:
    """The table `printed`: each figure with its computed value, then the findings of the audit.

    Raises PipelineError where the file does not fit the study's results: an unknown measure, condition or test.

    Verdicts: agrees, differs, undefined for a figure beside its computed value (`check` is null); those of
    `pipeline.analysis.audit.finding` where printed figures are checked against each other.
    """
    publication = load_publication(path)
    computed = _Computed(path, descriptives, comparisons, accuracy_means)
    rows = [_row(*figure) for figure in _figures(publication, computed)]
    if publication.note:
        rows.append({"what": "These figures", "check": NOTE, "printed": publication.note, "verdict": REMARK})
    for finding in audit(publication):
        rows.append(
            {
                "what": finding.what,
                "check": finding.check,
                "printed": finding.printed,
                "computed": finding.follows,
                "verdict": finding.verdict,
                "explanation": finding.explanation,
            }
        )
    return tables.frame("printed", [{**row, "source": publication.source} for row in rows])


NOTE = "note"
"""The `check` of the row that holds a publication's note."""

Figure = tuple[str, Rounded, float]
"""What the figure is, as it is printed, and its computed value (NaN where undefined)."""


def _figures(publication: Publication, computed: _Computed) -> Iterator[Figure]:
    """Every figure of a measure that the study has, with its value."""
    for measure in publication.measures:
        if measure.measure is None:
            continue
        for condition, cell in measure.cells.items():
            yield from _of_cell(computed, measure, measure.measure, condition, cell)
        for reduction in measure.reductions:
            if reduction.of != "participants":
                what = f"{measure.name}: reduction of the {reduction.of}, {reduction.before} to {reduction.to}, %"
                yield what, reduction.percent, computed.reduction(measure.measure, reduction)
        for test in measure.tests:
            yield from _of_test(computed, measure, measure.measure, test)
    for estimate in publication.accuracy:
        yield from _of_accuracy(computed, estimate)
    for total in publication.totals:
        names = [measure.measure for measure in publication.named(total.measures)]
        if None not in names:
            yield total.label, total.printed, computed.total([name for name in names if name], total)


def _of_cell(computed: _Computed, measure: Measure, name: str, condition: str, cell: Cell) -> Iterator[Figure]:
    for column in ("mean", "sd", "median", "rmse"):
        figure = getattr(cell, column)
        if figure is not None:
            yield f"{measure.name}, {condition}: {column}", figure, computed.descriptive(name, condition, column)


def _of_accuracy(computed: _Computed, printed: PrintedAccuracy) -> Iterator[Figure]:
    for column, what in (("rmse_mm", "RMSE"), ("sd_mm", "stated SD")):
        figure = getattr(printed, column)
        if figure is not None:
            yield f"{printed.label}: {what}, mm", figure, computed.accuracy(printed.estimator, column)
    if printed.percent_below is not None and printed.than is not None:
        own, other = (computed.accuracy(name, "rmse_mm") for name in (printed.estimator, printed.than))
        yield f"{printed.label}: RMSE below that of {printed.than}, %", printed.percent_below, 100 * (1 - own / other)


def _of_test(computed: _Computed, measure: Measure, name: str, test: PrintedTest) -> Iterator[Figure]:
    for symbol, statistic in _STATISTIC_NAMES.items():
        figure = getattr(test, symbol)
        if figure is not None:
            yield f"{label(measure, test)}, {symbol}", figure, computed.comparison(name, test, "statistic", statistic)
    for column in ("p", "p_adjusted"):
        figure = getattr(test, column)
        if figure is not None:
            yield f"{label(measure, test)}, {column.replace('_', ' ')}", figure, computed.comparison(name, test, column)


def _row(what: str, printed: Rounded, value: float) -> Row:
    row: Row = {"what": what, "printed": printed.text}
    if not np.isfinite(value):
        return row | {"computed": "undefined", "verdict": "undefined"}
    interval, room = printed.interval, printed.unit * _ROUND_OFF
    agrees = interval.low - room <= Fraction(value) <= interval.high + room
    return row | {
        "computed": printed.like(value),
        "computed_value": value,
        "verdict": "agrees" if agrees else "differs",
    }


class _Computed:
    """Looks up, in a study's descriptives and comparisons, the figures that a publication prints."""

    def __init__(
        self, path: Path, descriptives: pd.DataFrame, comparisons: pd.DataFrame, accuracy_means: pd.DataFrame
    ) -> None:
        self._path, self._descriptives, self._comparisons = path, descriptives, comparisons
        self._accuracy_means = accuracy_means
        # A paper prints a hundred figures; to look each up in the frame takes longer than all else here.
        self._cells = {(row["measure"], row["condition"]): row for row in descriptives.to_dict("records")}

    def descriptive(self, measure: str, condition: str, column: str) -> float:
        """A condition's mean, sd or median; as `rmse` the root of its mean."""
        if (measure, condition) not in self._cells:
            rows = self._rows(self._descriptives, "measure", measure)
            self._rows(rows, "condition", condition)  # which says what there is instead
        value = self._cells[measure, condition]["mean" if column == "rmse" else column]
        if pd.isna(value):
            return np.nan
        return float(np.sqrt(value)) if column == "rmse" else float(value)

    def accuracy(self, estimator: str, column: str) -> float:
        """An estimator's error or stated SD, the mean over sessions."""
        return float(self._rows(self._accuracy_means, "estimator", estimator).iloc[0][column])

    def reduction(self, measure: str, reduction: Reduction) -> float:
        """In percent of the first figure."""
        before, after = (self.descriptive(measure, name, reduction.of) for name in (reduction.before, reduction.to))
        return 100 * (1 - after / before) if before != 0 else np.nan

    def total(self, measures: Sequence[str], total: Total) -> float:
        """Sum or average of the measures' means; for a sum, over all participants."""
        means = [self.descriptive(measure, total.condition, "mean") for measure in measures]
        if total.sum is not None:
            means = [
                mean * self.descriptive(measure, total.condition, "n")
                for mean, measure in zip(means, measures, strict=True)
            ]
        return sum(means) / (len(means) if total.average is not None else 1)

    def comparison(self, measure: str, test: PrintedTest, column: str, statistic: str | None = None) -> float:
        """The value in `column` of the comparison that is the printed test; PipelineError unless exactly one is."""
        rows = self._rows(self._comparisons, "measure", measure)
        for name, wanted in (("test", test.test), ("effect", test.effect), ("contrast", test.contrast)):
            rows = rows if wanted is None else self._rows(rows, name, wanted)
        if test.contrast is None and rows["contrast"].isna().any():
            rows = rows[rows["contrast"].isna()]  # without the follow-up tests
        if statistic is not None:
            rows = self._rows(rows, "statistic_name", statistic)
        if len(rows) != 1:
            raise PipelineError(
                f'{self._path}: a printed test of "{measure}" matches {len(rows)} of the study\'s comparisons; it must'
                " match exactly one: state its test, effect or contrast"
            )
        value = rows.iloc[0][column]
        return np.nan if pd.isna(value) else float(value)

    def _rows(self, table: pd.DataFrame, column: str, wanted: str) -> pd.DataFrame:
        rows = table[table[column] == wanted]
        if rows.empty:
            known = [str(value) for value in table[column].dropna().unique()]
            raise PipelineError(
                f'{self._path}: the study\'s results have no {column} "{wanted}"{did_you_mean(wanted, known)}'
            )
        return rows
