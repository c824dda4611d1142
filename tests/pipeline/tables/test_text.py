"""While a stage runs, text of a table is Python's where it has few rows and Arrow's where it has many."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from pipeline.tables import table as tables
from tests.conftest import CLONE
from tests.pipeline.helpers import run


@pytest.mark.parametrize("name", ["feng2016", "reach"])
def test_results_do_not_depend_on_how_text_is_held(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    few_rows_at_most = {"python": 1_000_000, "pyarrow": -1}
    for storage, rows in few_rows_at_most.items():
        monkeypatch.setattr(tables, "FEW_ROWS", rows)
        with pd.option_context("mode.string_storage", "python"):  # as while a stage runs
            assert tables.frame("orders", [{"participant": "P1"}])["participant"].dtype == f"string[{storage}]"
        words = ("--out", tmp_path / storage, "--cache", tmp_path / f"cache-{storage}", "--jobs", "1")
        assert run(capsys, monkeypatch, "compare", CLONE / "studies" / name, *words).code == 0
    by_python, by_arrow = ((tmp_path / storage / "results.json").read_bytes() for storage in few_rows_at_most)
    assert by_python == by_arrow
