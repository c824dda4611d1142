"""What simulated people gain from one condition to another, over repeated studies, beside a publication's figures."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
import pandas as pd

from pipeline.study.simulation import SelectionSimulation
from pipeline.tables.table import Row


def reductions(settings: SelectionSimulation, conditions: tuple[str, ...], repeats: pd.DataFrame) -> Iterator[Row]:
    """Rows of `simulated_reductions`: each measure and pair of conditions, 1 − mean₂/mean₁ in each repeated study.

    `repeats` has the columns repeat, condition, measure and value (a mean over participants). 95 % of the studies
    lie between the bounds: they say where one study of as many people may land, not where the mean is.
    """
    for measure, rows in repeats.groupby("measure", sort=False):
        wide = rows.pivot(index="repeat", columns="condition", values="value")
        for first, second in combinations(conditions, 2):
            if not {first, second} <= set(wide.columns):
                continue
            both = wide[[first, second]].dropna()
            share = (1.0 - both[second] / both[first]).to_numpy(np.float64)
            share = share[np.isfinite(share)]
            if not len(share):
                continue
            low, high = np.percentile(share, [2.5, 97.5])
            yield {
                "measure": measure,
                "contrast": f"{first} - {second}",
                "n": len(share),
                "reduction": float(share.mean()),
                "ci_low": float(low),
                "ci_high": float(high),
                **_published(settings, str(measure), (first, second)),
            }


def _published(settings: SelectionSimulation, measure: str, pair: tuple[str, str]) -> Row:
    for published in settings.published:
        if published.measure == measure and published.conditions == pair:
            return {"published_reduction": published.reduction, "source": published.source}
    return {"published_reduction": None, "source": None}
