"""Q-Q plots of the values whose normality the study's comparisons assume."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd

from pipeline.report import figures
from pipeline.report.document.model import Block, Folded
from pipeline.report.figures.quantile_plots import SAMPLE
from pipeline.report.sections.material import Material
from pipeline.study.statistical_tests import TESTS
from pipeline.words.names import measure_label
from pipeline.words.phrases import counted, listing

PANELS_MAX = 12  # tables/normal_quantiles.csv has all values


def plots(material: Material) -> Iterator[Block]:
    """A folded figure with a panel for each sample; of many those with the most values outside their band."""
    table = material.table("normal_quantiles")
    if not len(table):
        return
    outside = table.groupby(SAMPLE, sort=False)["outside"].agg(["sum", "mean"])
    leaving = int((outside["sum"] > 0).sum())
    shown = _furthest(table, outside["mean"])
    more = " Rows: tables/normal_quantiles.csv."
    if len(outside) > PANELS_MAX:
        more = (
            f" Of {len(outside)} samples {PANELS_MAX} are drawn, {which_are_drawn(leaving)}; all are in"
            " tables/normal_quantiles.csv."
        )
    more += _lacking(material, table)
    summary = (
        "Do the values lie as normal ones would? Q-Q plots: some lie outside the 95 % band in"
        f" {leaving} of {counted(len(outside), 'sample')}"
    )
    figure = material.drawn("normality", figures.normality, shown, more=more)
    yield Folded(summary, (figure,), figures_in_annex=True)


def which_are_drawn(leaving: int) -> str:
    """Which of many samples have a panel, if so many have values outside their band."""
    if leaving >= PANELS_MAX:
        return "those with the largest share of values outside"
    return "all that have values outside and the first of the others" if leaving else "the first ones"


def _furthest(table: pd.DataFrame, shares: pd.Series) -> pd.DataFrame:
    """The rows of as many samples as there are panels for, in the table's order."""
    chosen = set(shares.sort_values(ascending=False, kind="stable").index[:PANELS_MAX])
    kept = [sample in chosen for sample in zip(*(table[name] for name in SAMPLE), strict=True)]
    return table[kept]


def _lacking(material: Material, table: pd.DataFrame) -> str:
    """What has no panel, although a test of it assumes normality."""
    assumed = [row["measure"] for row in material.rows("comparisons") if _assumes(row["test"])]
    missing: Sequence[str] = [name for name in dict.fromkeys(assumed) if name not in set(table["measure"])]
    said = ""
    if missing:
        names = listing([measure_label(name) for name in missing])
        said = f" Without a panel, for fewer than three values or none that vary: {names}."
    if any(row["test"] == "mixed_anova" and row["contrast"] is not None for row in material.rows("comparisons")):
        said += " The pairs that follow up a mixed ANOVA have no panels of their own."
    return said


def _assumes(test: str) -> bool:
    return TESTS[test].assumes_normality or test == "mixed_model"
