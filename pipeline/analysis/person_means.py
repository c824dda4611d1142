"""Each participant's mean in each condition, as descriptives and figures show it: of whole conditions only."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.analysis.factors import BETWEEN_FACTORS, factors_of, missing_cells, without_rare
from pipeline.study.comparison import matching_measures
from pipeline.study.settings import Study
from pipeline.tables import table as tables


def person_means(study: Study, measures: pd.DataFrame, name: str) -> pd.DataFrame:
    """One row per participant and one column per condition, in the study's order: means over all else, or NaN.

    Who lacks a cell of a further factor in a condition has no mean there: one over the cells that are left would be of
    another mixture than other people's. A comparison that says `missing: available` takes it all the same, and then so
    do its descriptives. Values at levels that are likely misspelt do not count, as in the tests.
    """
    rows = measures[measures["measure"] == name]
    factors = factors_of(rows)
    rows = without_rare(rows, factors)
    wide = tables.participant_means(rows, name, study.conditions)
    if not factors.crossed or _takes_what_is_available(study, name):
        return wide
    for person, cells in missing_cells(rows, study.conditions, factors.crossed).items():
        for cell in cells:
            wide.loc[person, cell.split(BETWEEN_FACTORS)[0]] = np.nan
    return wide.dropna(how="all")


def _takes_what_is_available(study: Study, name: str) -> bool:
    return any(
        matching_measures(wanted, [name])
        for entry in study.comparisons
        if entry.missing == "available"
        for wanted in entry.measures
    )
