"""Columns of a study's table of trials that are its own: what nothing uses is said, so that nothing is lost unseen."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from pipeline.analysis.practice_trials import MARKS
from pipeline.analysis.values import CELL
from pipeline.sessions.checks.finding import Finding, of, rows_of
from pipeline.study.given_tables import own_columns_of_trials
from pipeline.study.guessing.headers import meaning
from pipeline.study.settings import Study
from pipeline.study.yaml_text import flow
from pipeline.tables.table import Row
from pipeline.words.phrases import counted, listing

_PRACTICE, _UNUSED = "practice trials", "further columns"
_COMPUTED = ("estimator", "squared_error_mm2", "position_error_mm", "duration_s", "factors")


def check_rows(study: Study, trials: pd.DataFrame) -> list[Row]:
    """Rows of `checks` for the columns of trials.csv that study.yaml does not mention."""
    used = {*study.factors, *([study.practice.column] if study.practice else []), *CELL, *_COMPUTED}
    further = [name for name in own_columns_of_trials(trials) if name not in used]
    return rows_of(_findings(trials[further], bool(study.practice))) if further else []


def _findings(cells: pd.DataFrame, knows_practice: bool) -> Iterator[Finding]:
    """Amber for a column that marks practice trials, which count as all others; green for those that are kept."""
    names = [str(name) for name in cells]
    for name in list(names):
        marked = int(cells[name].str.casefold().isin(MARKS).sum())
        if meaning(name) == "practice" and 0 < marked < len(cells) and not knows_practice:
            names.remove(name)
            message = (
                f'the column "{name}" of the trials marks {counted(marked, "trial")}, which count as all others do: if'
                f" they were practice, write practice: {flow({'column': name})} in study.yaml"
            )
            yield Finding(of(_PRACTICE, name), "amber", f"{marked} of {len(cells)}", "none", message)
    if names:
        message = (
            f"not used: {listing(names)}; to compare by one, write factors: {flow({names[0]: 'within'})} in study.yaml,"
            " and its name under within"
        )
        yield Finding(_UNUSED, "green", listing(names), "any", message)
