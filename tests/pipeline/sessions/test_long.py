"""A long session goes through every stage in parts, and comes out as it would as a whole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fusion_core import accuracy
from pipeline.engine.stage import Work
from pipeline.sessions import assess, by_parts, fuse, growing, ingest, recording
from pipeline.study.folder import load_study
from pipeline.study.session_files import find_sessions
from pipeline.tables import table as tables
from tests.conftest import STREAMS, session_messages, write_session

SETTINGS = f"""
title: T
conditions: [a]
sessions: data/{{participant}}_{{condition}}.mcap
estimators:
  raw: {{type: raw}}
  holt: {{type: holt}}
  kalman: {{type: position_kalman}}
  fusion: {{type: fusion_kalman}}
  adaptive: {{type: fusion_adaptive}}
{STREAMS}"""


def _computed(root: Path, out: Path) -> dict[str, pa.Table]:
    """Every table of the study's session, by stage and name."""
    study = load_study(root)
    (session,) = find_sessions(root, study).sessions
    entries = {stage: (out / stage,) for stage in ("ingest", "fuse", "assess")}
    for stage in (ingest, fuse, assess):
        folder = out / stage.__name__.rsplit(".", maxsplit=1)[-1]
        folder.mkdir(parents=True)
        stage.run(Work("t", study, root, folder, (session,), entries))
    return {f"{path.parent.name}/{path.stem}": pq.read_table(path) for path in sorted(out.rglob("*.parquet"))}


def test_a_long_session_has_the_tables_that_it_would_have_as_a_whole(
    folder: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = folder(SETTINGS)
    write_session(root / "data" / "P1_a.mcap", session_messages(12.0))
    whole = _computed(root, tmp_path / "whole")
    monkeypatch.setattr(tables, "ROWS_AT_ONCE", 100)
    monkeypatch.setattr(growing, "SPILLED", 64)
    monkeypatch.setattr(by_parts, "AT_ONCE", 50)
    monkeypatch.setattr(accuracy, "ROWS_AT_ONCE", 50)
    parts = _computed(root, tmp_path / "parts")
    long = recording.load(load_study(root), tmp_path / "parts" / "ingest", may_be_long=True)
    assert long.long_phone is not None
    assert long.long_phone.count == 12 * 90
    at_once = recording.load(load_study(root), tmp_path / "parts" / "ingest")
    anyhow = np.random.default_rng(1).permutation(long.times)[:300]
    for name in ("raw", "fusion"):
        shown, expected = (recording.show(load_study(root), name, one, anyhow) for one in (long, at_once))
        np.testing.assert_array_equal(shown.mean, expected.mean)
        np.testing.assert_array_equal(shown.sd, expected.sd)
    assert not [path for path in (tmp_path / "parts").rglob("*") if path.is_file() and path.suffix != ".parquet"]
    assert whole.keys() == parts.keys()
    for name, table in whole.items():
        assert parts[name].equals(table), name


def test_the_correlation_of_a_long_signal_is_that_of_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = np.random.default_rng(2).normal(5.0, 1.0, (2, 1003, 3))
    shifts, whole = accuracy.cross_correlation(first, second, 40)
    monkeypatch.setattr(accuracy, "ROWS_AT_ONCE", 100)
    monkeypatch.setattr(accuracy, "TRANSFORMED", 1000)
    same_shifts, parts = accuracy.cross_correlation(first, second, 40)
    np.testing.assert_array_equal(same_shifts, shifts)
    np.testing.assert_allclose(parts, whole, rtol=0, atol=1e-12)
