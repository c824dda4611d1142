"""Printed errors of estimators beside those of a study's recordings."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from pipeline.analysis.audit.beside_computed import NOTE, compare_printed
from pipeline.errors import PipelineError
from pipeline.tables import table as tables

PRINTED = """
source: A paper
accuracy:
  - {estimator: gp, label: GP, rmse_mm: 10.0, sd_mm: 12.5}
  - {estimator: fusion, label: GP fusion, rmse_mm: 7.4, percent_below: 25.0, than: gp}
note: Their hand was another one.
"""


def beside(folder: Path, printed: str) -> pd.DataFrame:
    (folder / "printed.yaml").write_text(printed, encoding="utf-8")
    errors = [{"estimator": "gp", "n": 3, "rmse_mm": 10.02, "sd_mm": 12.6}]
    errors.append({"estimator": "fusion", "n": 3, "rmse_mm": 7.51, "sd_mm": 8.0})
    descriptives, comparisons = (tables.frame(name, []) for name in ("descriptives", "comparisons"))
    return compare_printed(folder / "printed.yaml", descriptives, comparisons, tables.frame("accuracy_means", errors))


def test_each_figure_stands_beside_that_of_the_estimator(tmp_path: Path) -> None:
    rows = beside(tmp_path, PRINTED)
    figures = {row["what"]: (row["printed"], row["computed"], row["verdict"]) for row in rows.to_dict("records")}
    assert figures["GP: RMSE, mm"] == ("10.0", "10.0", "agrees")
    assert figures["GP: stated SD, mm"] == ("12.5", "12.6", "differs")
    assert figures["GP fusion: RMSE, mm"] == ("7.4", "7.5", "differs")
    assert figures["GP fusion: RMSE below that of gp, %"] == ("25.0", "25.0", "agrees")  # 1 − 7.51 / 10.02
    assert list(rows.loc[rows["check"] == NOTE, "printed"]) == ["Their hand was another one."]


@pytest.mark.parametrize(
    ("written", "instead", "said"),
    [
        ("estimator: gp,", "estimator: gpp,", 'no estimator "gpp"; did you mean "gp"?'),
        (", than: gp", "", "percent_below and than go together"),
        ("than: gp", "than: raws", 'no estimator "raws"'),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, written: str, instead: str, said: str) -> None:
    with pytest.raises(PipelineError, match=said.replace("?", r"\?")):
        beside(tmp_path, PRINTED.replace(written, instead))
