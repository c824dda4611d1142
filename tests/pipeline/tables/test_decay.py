"""No bit of a kept table can change without being noticed when the table is read."""

from __future__ import annotations

import os
import pickle
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from pipeline.errors import DamagedTableError
from pipeline.tables import table as tables


def _tracks(rows: int) -> pa.Table:
    random = np.random.default_rng(0)
    columns = {"session": "P1_a", "estimator": "raw", "time_ns": np.arange(rows) * 11_000_000}
    numbers = {name: random.normal(size=rows) for name in ("x_mm", "y_mm", "z_mm")}
    return tables.of_columns("tracks", rows, columns | numbers)


@pytest.mark.parametrize(("rows", "every"), [(3, 1), (2000, 97)])
def test_a_flipped_bit_is_noticed_or_changes_nothing(tmp_path: Path, rows: int, every: int) -> None:
    written = _tracks(rows)
    tables.write("tracks", written, tmp_path)
    file = tmp_path / "tracks.parquet"
    whole = file.read_bytes()
    noticed = 0
    places = {*range(0, len(whole), every), *range(len(whole) - 300, len(whole))}
    with file.open("r+b", buffering=0) as disk:
        for place in places:
            for bit in range(8):
                os.pwrite(disk.fileno(), bytes([whole[place] ^ 1 << bit]), place)
                try:
                    read = tables.read_arrow("tracks", tmp_path)
                except DamagedTableError:
                    noticed += 1
                else:
                    assert read.equals(written), (place, bit)
            os.pwrite(disk.fileno(), whole[place : place + 1], place)
    assert file.read_bytes() == whole
    assert noticed > 4 * len(places)


def test_a_damaged_table_is_named_with_the_remedy(tmp_path: Path) -> None:
    tables.write("tracks", _tracks(3), tmp_path)
    file = tmp_path / "tracks.parquet"
    file.write_bytes(file.read_bytes()[:-5])
    with pytest.raises(DamagedTableError) as raised:
        tables.read("tracks", tmp_path)
    message = f"{file}: is damaged; run `steadyhand cache verify`, which removes it, and the command again"
    assert str(raised.value) == message == str(pickle.loads(pickle.dumps(raised.value)))  # noqa: S301 - our own
