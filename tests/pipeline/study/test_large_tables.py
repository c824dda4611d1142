"""A large table is read by column, with what reading it row by row gives, and the same message where it is at fault."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import PipelineError
from pipeline.study import large_tables, table_file
from pipeline.study.given_tables import read_trials
from pipeline.study.table_file import TableFile

HEADER = "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,start_ms,block"
CELLS = st.sampled_from(
    ["1", "2", " 3 ", "1.5", "-7", "1e3", "+4", "1_0", "NA", "", "nan", "inf", "-99", "−5", "0x1", "x", "1e200", '"6"']
)
IDS = st.sampled_from(["P1", "P2", " P3", "Ä", "A\u0308", ""])
ROWS = st.lists(st.tuples(IDS, st.sampled_from(["a", "b"]), *[CELLS] * 6, CELLS), min_size=1, max_size=8)


def outcome(path: Path, large_bytes: int) -> pd.DataFrame | str:
    """The table, or the message."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table_file, "by_column", partial(large_tables.by_column, large_bytes=large_bytes))
        try:
            return read_trials(TableFile(path, "trials", ("a", "b"), missing=(-99.0,)))
        except PipelineError as error:
            return str(error)


def same(path: Path, text: str) -> pd.DataFrame | str:
    path.write_text(text, encoding="utf-8", newline="")
    by_row, by_column = outcome(path, 10**9), outcome(path, 0)
    if isinstance(by_row, str) or isinstance(by_column, str):
        assert by_row == by_column
    else:
        pd.testing.assert_frame_equal(by_row, by_column, check_index_type=False)
    return by_column


@given(ROWS, st.sampled_from(["\n", "\r\n"]), st.sampled_from(["", "\n", "\n\n", ","]))
def test_by_column_is_as_by_row(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[str, ...]], ends: str, after: str
) -> None:
    lines = [HEADER, *(",".join(row) for row in rows)]
    same(tmp_path_factory.mktemp("table") / "t.csv", ends.join(lines) + after)


def test_what_is_right_is_read_by_column(tmp_path: Path) -> None:
    text = f"\ufeff{HEADER}\n" + "".join(f"P{n},a,{n},100,50,{100 + n / 8},49,{1000 * n},first\n" for n in range(50))
    assert not isinstance(same(tmp_path / "t.csv", text), str)
    assert large_tables.by_column(tmp_path / "t.csv", TableFile(tmp_path).form, 0) is not None


@pytest.mark.parametrize("text", ['a\n"1"\n', "a\n1\n\n2\n", "a\r1\r2\r", "a,b\n1\n", "a\n", "", "a\n\xff\n"])
def test_what_is_not_plain_is_left_to_the_other_way(tmp_path: Path, text: str) -> None:
    (tmp_path / "t.csv").write_bytes(text.encode("latin-1"))
    assert large_tables.by_column(tmp_path / "t.csv", TableFile(tmp_path).form, 0) is None
