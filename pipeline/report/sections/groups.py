"""Figures of groups of participants, where groups are compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import Figure
from pipeline.report.figures.group_clouds import by_group
from pipeline.report.sections.material import Material, safe_name
from pipeline.study.statistical_tests import TESTS


def drawn(material: Material, called: str, measures: Sequence[str]) -> Iterator[Figure]:
    """A figure for each factor that tells groups apart, with a panel for each of these measures compared between them.

    Of a mixed design each group under each condition; else each participant's mean over the conditions. `called` is
    the beginning of the figures' names.
    """
    members = material.table("group_members")
    members = members[members["measure"].isin(measures)]
    for factor, rows in members.groupby("factor", sort=False):
        tables: dict[str, pd.DataFrame] = {}
        looks: list[int] = []
        for measure, of_measure in rows.groupby("measure", sort=False):
            group_of = dict(zip(of_measure["participant"], of_measure["group"], strict=True))
            names = list(dict.fromkeys(of_measure["group"]))
            mixed, conditions = _is_mixed(material, str(measure)), range(len(material.study.conditions))
            wide = by_group(material.participant_means(str(measure)), group_of, names, mixed)
            if wide.notna().any().any():
                tables[str(measure)] = wide
                looks = [*conditions] * len(names) if mixed else [len(conditions) + at for at in range(len(names))]
        if tables:
            yield material.drawn(f"{called}-by-{safe_name(str(factor))}", figures.groups, tables, str(factor), looks)


def _is_mixed(material: Material, measure: str) -> bool:
    return any(TESTS[row["test"]].design == "mixed" for row in material.comparisons_of(measure))
