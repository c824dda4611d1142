"""What is computed again, and what is not."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.engine.cache import Cache
from pipeline.engine.processes import InThisProcess
from pipeline.engine.progress import PlainLines
from pipeline.engine.resources import Resources
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date
from pipeline.stages import COMPARE
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

SETTINGS = (
    """
title: T
conditions: [a, b]
sessions: data/{participant}_{condition}.mcap
estimators:
  raw: {type: raw}
  fusion: {type: window_gp}
measures: measures.csv
"""
    + STREAMS
)
MEASURES = "participant,condition,measure,value\nP1,a,m,1\nP1,b,m,2\n"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study and the cache of its first run, to be copied."""
    root = tmp_path_factory.mktemp("finished")
    for condition in "ab":
        write_session(root / "study" / "data" / f"P1_{condition}.mcap", session_messages(2.5))
    (root / "study" / "study.yaml").write_text(SETTINGS, encoding="utf-8")
    (root / "study" / "measures.csv").write_text(MEASURES, encoding="utf-8")
    bring_up_to_date(root / "study", COMPARE, Resources(Cache(root / "cache"), InThisProcess(), PlainLines()))
    return root


@pytest.fixture
def study(finished: Path, tmp_path: Path) -> Path:
    return shutil.copytree(finished / "study", tmp_path / "study")


@pytest.fixture
def filled(finished: Path, tmp_path: Path) -> None:
    """The cache holds a run of the study."""
    shutil.copytree(finished / "cache", tmp_path / "cache")


@pytest.fixture
def update(study: Path, tmp_path: Path) -> Callable[[], Result]:
    resources = Resources(Cache(tmp_path / "cache"), InThisProcess(), PlainLines())
    return lambda: bring_up_to_date(study, COMPARE, resources)


def test_a_second_run_computes_nothing(update: Callable[[], Result]) -> None:
    assert update().computed == {"ingest": 2, "fuse": 2, "assess": 2, "measure": 1, "compare": 1}
    assert set(update().computed.values()) == {0}


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_a_second_report_says_that_nothing_was_computed(study: Path, steadyhand: Steadyhand) -> None:
    assert steadyhand("report", study).code == 0
    before = {path: path.stat().st_mtime_ns for path in steadyhand.out.rglob("*.*") if path.name != "provenance.json"}
    ran = steadyhand("report", study)
    assert "Nothing had changed, so nothing was computed again" in ran.out
    assert {path: path.stat().st_mtime_ns for path in before} == before


@pytest.mark.usefixtures("filled")
@pytest.mark.parametrize(
    ("before", "after", "computed"),
    [
        ("title: T", "title: Another", {"compare"}),
        ("fusion: {type: window_gp}", "fusion: {type: window_gp, window: 3}", {"fuse", "assess", "measure", "compare"}),
        ("raw: {type: raw}", "raw: {type: raw}\n  holt: {type: holt}", {"fuse", "assess", "measure", "compare"}),
        ("title: T", "title: T\nalpha: 0.01", {"compare"}),
        ("raw: {type: raw}", "held: {type: raw}", {"fuse", "assess", "measure", "compare"}),
        ("title: T", "title: T\ndisplay: {px_per_mm: 10}", {"measure", "compare"}),
        ("noise_sd_mm: 8", "noise_sd_mm: 9", {"ingest", "fuse", "assess", "measure", "compare"}),
    ],
)
def test_a_setting_reaches_the_stages_that_use_it_and_no_others(
    study: Path, update: Callable[[], Result], before: str, after: str, computed: set[str]
) -> None:
    update()
    path = study / "study.yaml"
    path.write_text(path.read_text().replace(before, after))
    again = {stage for stage, count in update().computed.items() if count}
    # A stage whose inputs come out the same again is not computed again.
    assert again <= computed
    assert again & {next(stage for stage in ("ingest", "fuse", "assess", "measure", "compare") if stage in computed)}


@pytest.mark.usefixtures("filled")
def test_a_changed_log_reaches_its_own_session_only(study: Path, update: Callable[[], Result]) -> None:
    update()
    write_session(study / "data" / "P1_a.mcap", session_messages(2.5, seed=9))
    computed = update().computed
    assert (computed["ingest"], computed["fuse"], computed["assess"]) == (1, 1, 1)


@pytest.mark.usefixtures("filled")
def test_a_new_session_computes_that_session(study: Path, update: Callable[[], Result]) -> None:
    update()
    write_session(study / "data" / "P2_a.mcap", session_messages(2.5, seed=3))
    assert update().computed["fuse"] == 1


@pytest.mark.usefixtures("filled")
def test_a_damaged_entry_is_computed_again(update: Callable[[], Result]) -> None:
    entry = update().entries["fuse"]["P1_a"].folder
    (entry / "tracks.parquet").write_bytes(b"half")
    assert update().computed["fuse"] == 1
    assert update().computed["fuse"] == 0


def test_an_internal_error_in_one_session_is_said_and_tried_again(
    study: Path, update: Callable[[], Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipeline.sessions import fuse

    original = fuse.run

    def failing(work: object) -> object:
        if getattr(work, "session").id == "P1_a":  # noqa: B009 - untyped on purpose
            raise ZeroDivisionError("no")
        return original(work)  # type: ignore[arg-type]

    monkeypatch.setattr(fuse, "run", failing)
    result = update()
    said = 'internal error in stage "fuse"; please report it: ZeroDivisionError: no'
    assert [(session.id, reason) for session, reason in result.set_aside] == [("P1_a", said)]
    monkeypatch.setattr(fuse, "run", original)
    assert update().set_aside == []


def test_an_entry_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    with pytest.raises(KeyboardInterrupt), cache.new("fuse") as folder:
        (folder / "tracks.parquet").write_text("half")
        raise KeyboardInterrupt
    assert cache.get("fuse", "0" * 64) is None
    assert not any((tmp_path / "new").iterdir())
    with cache.new("fuse") as folder:
        (folder / "tracks.parquet").write_text("whole")
        kept = cache.keep("fuse", "1" * 64, folder, {"set_aside": None})
    found = cache.get("fuse", "1" * 64)
    assert found == kept
    assert json.loads((kept.folder / "entry.json").read_text())["files"]["tracks.parquet"]["size"] == 5
