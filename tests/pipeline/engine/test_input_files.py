"""A file of the study that changes between being hashed and read: no entry of it is kept, and the user is told."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.analysis import compare, measure
from pipeline.engine import usable_sessions
from pipeline.engine.cache import file_digest
from pipeline.sessions import ingest
from pipeline.study.folder import load_study
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand, exit_code

SAID = "changed while it was read; wait until nothing writes to it any more, and run the command again"
SETTINGS = (
    "conditions: [a, b]\nsessions: data/{participant}_{condition}.mcap\nestimators: {raw: {type: raw}}\n"
    "measures: measures.csv\n" + STREAMS
)
ResultsOf = Callable[[Path], bytes]
MEASURES = "participant,condition,measure,value\nP1,a,m,1\nP1,b,m,2\n"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study and the cache of a run that nothing disturbed, to be copied."""
    root = tmp_path_factory.mktemp("finished")
    study = root / "study"
    study.mkdir()
    (study / "study.yaml").write_text(SETTINGS, encoding="utf-8")
    (study / "measures.csv").write_text(MEASURES, encoding="utf-8")
    for seed, condition in enumerate("ab"):
        write_session(study / "data" / f"P1_{condition}.mcap", session_messages(2.5, seed=seed))
    with pytest.MonkeyPatch.context() as patch:
        words = ("compare", study, "--out", root / "out", "--cache", root / "cache", "--jobs", "1")
        assert exit_code(patch, *words) == 0
    return root


@pytest.fixture
def study(finished: Path, tmp_path: Path) -> Path:
    return shutil.copytree(finished / "study", tmp_path / "study")


class Between:
    """Does something to the study between the hash of its files and a stage's function, the first `times` times."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._monkeypatch = monkeypatch

    def __call__(self, stage: object, change: Callable[[int], object], times: int = 1, after: bool = False) -> None:
        original, calls = getattr(stage, "run"), 0  # noqa: B009 - any stage's module

        def run(work: object) -> object:
            nonlocal calls
            calls += 1
            if calls > times:
                return original(work)
            if not after:
                change(calls)
            try:
                return original(work)
            finally:
                if after:
                    change(calls)

        self._monkeypatch.setattr(stage, "run", run)


@pytest.fixture
def between(monkeypatch: pytest.MonkeyPatch) -> Between:
    return Between(monkeypatch)


@pytest.fixture
def results_of(finished: Path, steadyhand: Steadyhand, tmp_path: Path) -> ResultsOf:
    """results.json of a study as it is now, with a cache that holds nothing of a run that was disturbed."""

    def compute(study: Path) -> bytes:
        kept, steadyhand.cache = steadyhand.cache, tmp_path / "undisturbed"
        shutil.copytree(finished / "cache", steadyhand.cache)
        assert steadyhand("compare", study).code == 0
        shutil.rmtree(steadyhand.cache)
        steadyhand.cache = kept
        return (steadyhand.out / "results.json").read_bytes()

    return compute


def inputs(steadyhand: Steadyhand) -> dict[str, str]:
    listed: dict[str, str] = json.loads((steadyhand.out / "provenance.json").read_text())["inputs_sha256"]
    return listed


@pytest.mark.parametrize("after", [False, True])
def test_a_log_that_changes_before_or_after_it_is_read_is_read_once_more(
    study: Path, steadyhand: Steadyhand, between: Between, results_of: ResultsOf, after: bool
) -> None:
    before = results_of(study)
    log = study / "data" / "P1_a.mcap"
    first = log.read_bytes()
    between(ingest, lambda _: write_session(log, session_messages(2.5, seed=9)), after=after)
    ran = steadyhand("compare", study)
    assert (ran.code, "changed" in ran.err) == (0, False)
    changed = (steadyhand.out / "results.json").read_bytes()
    assert inputs(steadyhand)["data/P1_a.mcap"] == file_digest(log)
    assert changed == results_of(study) != before
    log.write_bytes(first)
    assert steadyhand("compare", study).code == 0
    assert (steadyhand.out / "results.json").read_bytes() == before


def test_a_log_that_is_another_for_a_moment_is_read_once_more(
    study: Path, steadyhand: Steadyhand, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, results_of: ResultsOf
) -> None:
    log = study / "data" / "P1_a.mcap"
    undisturbed = results_of(study)
    first, original, calls = log.read_bytes(), ingest.run, 0
    write_session(tmp_path / "other.mcap", session_messages(2.5, seed=9))

    def run(work: object) -> object:
        nonlocal calls
        calls += 1
        if calls > 1:
            return original(work)  # type: ignore[arg-type]
        log.write_bytes((tmp_path / "other.mcap").read_bytes())
        try:
            return original(work)  # type: ignore[arg-type]
        finally:
            log.write_bytes(first)

    monkeypatch.setattr(ingest, "run", run)
    assert steadyhand("compare", study).code == 0
    assert (steadyhand.out / "results.json").read_bytes() == undisturbed


@pytest.mark.parametrize("harm", ["rewritten", "cut", "removed"])
def test_a_log_that_keeps_changing_is_set_aside_and_read_by_the_next_run(
    study: Path, steadyhand: Steadyhand, between: Between, results_of: ResultsOf, harm: str
) -> None:
    undisturbed = results_of(study)
    log = study / "data" / "P1_a.mcap"
    first = log.read_bytes()

    def change(call: int) -> None:
        if harm == "removed":
            log.unlink(missing_ok=True)
        elif harm == "cut":
            os.truncate(log, len(first) // (call + 1))
        else:
            write_session(log, session_messages(2.5, seed=10 + call))

    between(ingest, change, times=3)  # the other session, this one, and this one once more
    log.rename(study / "data" / "P0_a.mcap")  # it comes first
    log = study / "data" / "P0_a.mcap"
    ran = steadyhand("compare", study)
    assert ran.code == 1
    assert f"session P0_a set aside: {SAID}" in ran.err
    log.write_bytes(first)
    log.rename(study / "data" / "P1_a.mcap")
    assert steadyhand("compare", study).code == 0
    assert (steadyhand.out / "results.json").read_bytes() == undisturbed


@pytest.mark.parametrize("stage", [measure, compare])
def test_a_table_that_changes_while_it_is_read_never_poisons_the_cache(
    study: Path, steadyhand: Steadyhand, between: Between, results_of: ResultsOf, stage: object
) -> None:
    table = "measures.csv"
    if stage is compare:
        (study / "study.yaml").write_text(SETTINGS + "participants: people.csv\n")
        table = "people.csv"
        (study / table).write_text("participant,sex\nP1,f\n")
    before = results_of(study)
    first = (study / table).read_text()
    other = first.replace("m,1", "m,5").replace(",f", ",m")
    between(stage, lambda _: (study / table).write_text(other))
    ran = steadyhand("compare", study)
    assert (ran.code, "changed" in ran.err) == (0, False)
    changed = (steadyhand.out / "results.json").read_bytes()
    assert inputs(steadyhand)[table] == file_digest(study / table)
    assert changed == results_of(study) != before
    (study / table).write_text(first)
    assert steadyhand("compare", study).code == 0
    assert (steadyhand.out / "results.json").read_bytes() == before


def test_a_table_that_keeps_changing_stops_the_run(study: Path, steadyhand: Steadyhand, between: Between) -> None:
    table = study / "measures.csv"
    between(measure, lambda call: table.write_text(MEASURES.replace("m,1", f"m,{call + 3}")), times=2)
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert ran.err.endswith(f"steadyhand: {table}: {SAID}\n")
    assert not any(steadyhand.cache.glob("measure/*/*"))
    assert steadyhand("compare", study).code == 0


def test_a_preregistration_that_appears_while_it_is_looked_for_is_read_once_more(
    study: Path, steadyhand: Steadyhand, between: Between
) -> None:
    between(compare, lambda _: (study / "preregistered.yaml").write_text("no: preregistration\n"))
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert "preregistered.yaml" in ran.err
    assert not any(steadyhand.cache.glob("compare/*/*"))


@pytest.mark.parametrize("times", [1, 2])
def test_settings_that_change_while_they_are_read(
    study: Path, steadyhand: Steadyhand, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    settings, calls = study / "study.yaml", 0

    def load(root: Path) -> object:
        nonlocal calls
        calls += 1
        loaded = load_study(root)
        if calls <= times:
            settings.write_text(f"alpha: 0.0{calls}\n{SETTINGS}")
        return loaded

    monkeypatch.setattr(usable_sessions, "load_study", load)
    ran = steadyhand("compare", study)
    if times == 2:
        assert ran.code == 2
        assert ran.err.endswith(f"steadyhand: {settings}: {SAID}\n")
        return
    assert ran.code == 0
    assert inputs(steadyhand)["study.yaml"] == file_digest(settings)
    assert steadyhand.results()["study"]["alpha"] == 0.01
