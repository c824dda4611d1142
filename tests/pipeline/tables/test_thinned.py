"""A long table that is only looked at: every n-th of its rows, whatever parts it is kept in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.tables import table as tables


def _written(folder: Path, count: int, a_part: int) -> pd.DataFrame:
    time_ns = np.arange(count, dtype=np.int64)
    parts = []
    for some in np.split(time_ns, range(a_part, count, a_part)):
        columns = {"session": "s", "estimator": "raw", "time_ns": some, "x_mm": some / 2.0, "sd_x_mm": 1.0}
        parts.append(tables.of_columns("tracks", len(some), columns))
    tables.write_parts("tracks", parts, folder)
    return tables.read("tracks", folder)


@pytest.mark.parametrize("a_part", [3, 7, 100])
def test_every_nth_row_is_left_of_a_long_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, a_part: int) -> None:
    whole = _written(tmp_path, 100, a_part)
    monkeypatch.setattr(tables, "LOOKED_AT", 30)
    pd.testing.assert_frame_equal(tables.read_thinned("tracks", tmp_path), whole.iloc[::4].reset_index(drop=True))


def test_a_short_table_is_read_whole_and_one_that_is_missing_is_empty(tmp_path: Path) -> None:
    whole = _written(tmp_path, 50, 20)
    pd.testing.assert_frame_equal(tables.read_thinned("tracks", tmp_path), whole)
    assert tables.read_thinned("tracks", tmp_path / "none").empty
