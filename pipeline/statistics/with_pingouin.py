"""What pingouin computes (Vallat 2018), on plain arrays. Only here is it imported, and are its warnings silenced.

Its answers equal R's in these tests. Equal data, on which it raises or divides by zero, are sorted out before.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from pipeline.statistics.arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd


def welch_anova(groups: Sequence[FloatArray]) -> tuple[float, float, float, float]:
    """Welch's F, its two degrees of freedom, p."""
    with _quiet():
        import pingouin

        table = pingouin.welch_anova(data=_table(groups), dv="value", between="group").iloc[0]
    return float(table["F"]), float(table["ddof1"]), float(table["ddof2"]), float(table["p_unc"])


def games_howell(groups: Sequence[FloatArray]) -> list[tuple[float, float, float, float]]:
    """t, its degrees of freedom, the standard error of the difference and p, of every two groups in order."""
    with _quiet():
        import pingouin

        table = pingouin.pairwise_gameshowell(data=_table(groups), dv="value", between="group")
    columns = (table[name].to_numpy(np.float64) for name in ("T", "df", "se", "pval"))
    return [(float(t), float(df), float(error), float(p)) for t, df, error, p in zip(*columns, strict=True)]


def kruskal(groups: Sequence[FloatArray]) -> tuple[float, float]:
    """H corrected for ties, and its p by χ²."""
    with _quiet():
        import pingouin

        table = pingouin.kruskal(data=_table(groups), dv="value", between="group").iloc[0]
    return float(table["H"]), float(table["p_unc"])


@contextmanager
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _table(groups: Sequence[FloatArray]) -> pd.DataFrame:
    """Groups as numbers, which pingouin keeps in order."""
    import pandas as pd

    number = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return pd.DataFrame({"group": number, "value": np.concatenate(groups)})


def cronbach_alpha(items: FloatArray) -> float:
    """Of ratings (n, k)."""
    with _quiet():
        import pandas as pd
        import pingouin

        return float(pingouin.cronbach_alpha(data=pd.DataFrame(items))[0])
