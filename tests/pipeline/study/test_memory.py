"""What does not fit into memory is refused before the memory is gone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from pipeline.sessions import ingest, long_phone
from pipeline.study import memory, table_file
from pipeline.tables import table as tables
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand


def test_the_least_of_what_the_system_and_the_container_leave_is_free(tmp_path: Path) -> None:
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal:       24000000 kB\nMemAvailable:    2000000 kB\n")
    assert memory.free_bytes(meminfo, tmp_path) == 2_000_000 * 1024
    (tmp_path / "memory.max").write_text("1000000000\n")
    (tmp_path / "memory.current").write_text("600000000\n")
    assert memory.free_bytes(meminfo, tmp_path) == 400_000_000
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.free_bytes(meminfo, tmp_path) == 2_000_000 * 1024
    assert memory.free_bytes(tmp_path / "none", tmp_path) is None


def test_small_files_and_unknown_memory_are_no_reason_to_refuse() -> None:
    assert memory.shortage(1_000_000, 27.0, 10) is None
    assert memory.shortage(10**12, 27.0, None) is None
    assert memory.shortage(10**8, 27.0, 10**10) is None


def test_a_table_that_does_not_fit_is_refused_with_what_it_would_take(
    folder: Callable[..., Path], steadyhand: Steadyhand, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = folder(
        "conditions: [a, b]\nmeasures: m.csv\n", **{"m.csv": "participant,condition,measure,value\nP1,a,m,1\n"}
    )
    monkeypatch.setattr(memory, "SMALL_BYTES", 10)
    monkeypatch.setattr(table_file, "free_bytes", lambda: 100)
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert "m.csv: refused: it is 0 MB, for which a report needs about 0.0 GB of memory, and 0.0 GB are free" in ran.err


@pytest.mark.parametrize(("where", "what"), [(ingest, "it"), (long_phone, "what its phone measured")])
def test_what_does_not_fit_of_a_session_stops_the_run_and_is_computed_once_there_is_room(
    folder: Callable[..., Path], steadyhand: Steadyhand, monkeypatch: pytest.MonkeyPatch, where: ModuleType, what: str
) -> None:
    whole = "estimators: {window: {type: window_gp, window: 5}}\n"  # needs all of the phone at once
    study = folder("conditions: [a]\nsessions: data/{participant}_{condition}.mcap\n" + whole + STREAMS)
    write_session(study / "data" / "P1_a.mcap", session_messages(2.5))
    with monkeypatch.context() as patch:
        patch.setattr(memory, "SMALL_BYTES", 10)
        patch.setattr(tables, "ROWS_AT_ONCE", 100)
        patch.setattr(where, "free_bytes", lambda: 1000)
        ran = steadyhand("compare", study, "--jobs", "1")
        assert ran.code == 2
        assert f"session P1_a: refused: {what} is 0 MB" in ran.err
    assert steadyhand("compare", study).code == 0
