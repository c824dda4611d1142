"""The same bytes wherever sessions are computed, and a worker that dies takes nothing with it."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.commands.console import PlainLines
from pipeline.commands.run import executor_of
from pipeline.engine import threads
from pipeline.engine.cache import Cache
from pipeline.engine.processes import Processes
from pipeline.engine.resources import Means
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date, over_settings
from pipeline.engine.stage import Stage
from pipeline.errors import PipelineError, WorkerLostError
from pipeline.stages import COMPARE, REPLAY, STAGES
from pipeline.study.settings import Study
from pipeline.study.yaml_text import parse, read_yaml
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.dying import POISONED
from tests.pipeline.helpers import run

Folder = Callable[..., Path]
SETTINGS = (
    "conditions: [a, b]\nsessions: data/{participant}_{condition}.mcap\nestimators: {raw: {type: raw}}\n" + STREAMS
)
SESSIONS = [f"P{person}_{condition}" for person in (1, 2) for condition in "ab"]


@pytest.fixture
def study(folder: Folder) -> Path:
    root = folder(SETTINGS)
    for seed, session in enumerate(SESSIONS):
        write_session(root / "data" / f"{session}.mcap", session_messages(2.5, seed=seed))
    return root


def fusing_with(function: str) -> tuple[Stage, ...]:
    """Logs read, then fused by one of `dying`."""
    return COMPARE[0], replace(COMPARE[1], function=f"tests.pipeline.dying:{function}")


def contents(result: Result) -> dict[str, dict[str, str]]:
    """The digest of every table."""
    return {stage: {name: one.content for name, one in of.items()} for stage, of in result.entries.items()}


def test_processes_give_the_same_entries_as_this_process(study: Path, tmp_path: Path) -> None:
    found = []
    for where in ("inline", "process"):
        with executor_of(2, where) as executor:
            found.append(bring_up_to_date(study, COMPARE, Means(Cache(tmp_path / where), executor, PlainLines())))
    assert contents(found[0]) == contents(found[1])


def test_a_session_that_kills_its_process_is_set_aside_alone(study: Path, tmp_path: Path) -> None:
    with Processes(2) as executor:
        means = Means(Cache(tmp_path / "cache"), executor, PlainLines())
        result = bring_up_to_date(study, fusing_with("whenever"), means)
        ((session, reason),) = result.set_aside
        assert session.id == POISONED
        assert "the process that computed fuse died twice (signal 9)" in reason
        assert set(result.entries["fuse"]) == set(SESSIONS)
        again = bring_up_to_date(study, fusing_with("whenever"), means)
    assert again.computed == {"ingest": 0, "fuse": 1}  # it is tried again


def test_a_process_that_was_killed_is_replaced(study: Path, tmp_path: Path) -> None:
    with Processes(2) as executor:
        means = Means(Cache(tmp_path / "cache"), executor, PlainLines())
        result = bring_up_to_date(study, fusing_with("once"), means)
        assert (study / "died").exists()
        assert result.set_aside == []


def test_of_a_group_only_the_piece_that_kills_its_process_is_set_aside(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where there are many variants, a process computes those of a session in one go."""
    monkeypatch.setattr("pipeline.engine.entries._ENOUGH", 1)
    settings = [
        parse(Study, {**read_yaml(study / "study.yaml"), "estimators": {name: {"type": "raw"}}}, study)
        for name in ("first", "held", "last")
    ]
    stage = replace(REPLAY, function="tests.pipeline.dying:of_one_variant")
    with Processes(2) as executor:
        means = Means(Cache(tmp_path / "cache"), executor, PlainLines())
        result = bring_up_to_date(study, COMPARE[:1], means)
        found = over_settings(result, stage, settings, result.sessions, means)
        again = over_settings(result, stage, settings, result.sessions, means)
    bad = [(i, j) for i, entries in enumerate(found) for j, entry in enumerate(entries) if entry.said["set_aside"]]
    assert bad == [([session.id for session in result.sessions].index(POISONED), 1)]
    assert [[entry.content for entry in entries] for entries in again] == [
        [entry.content for entry in entries] for entries in found
    ]
    assert result.computed["replay"] == 1  # it is tried again


def test_tables_of_an_archive_are_joined_in_a_process_of_its_own(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the same bytes, report and all; what a process that died of it costs is said."""
    with executor_of(1, "inline") as executor:
        here = bring_up_to_date(study, STAGES, Means(Cache(tmp_path / "here"), executor, PlainLines()))
    monkeypatch.setattr("pipeline.engine.entries._ARCHIVE", 1)
    with Processes(1) as executor:
        means = Means(Cache(tmp_path / "apart"), executor, PlainLines())
        apart = bring_up_to_date(study, STAGES, means)
        assert contents(apart) == contents(here)
        dying = replace(COMPARE[3], function="tests.pipeline.dying:of_a_study")
        with pytest.raises(PipelineError, match=r"the process that computed measure died \(signal 9\); its memory"):
            bring_up_to_date(study, (*COMPARE[:3], dying), means)


@contextmanager
def dask(count: int) -> Iterator[Executor]:
    """A real scheduler with worker processes on loopback."""
    pytest.importorskip("distributed")
    with executor_of(count, "dask") as executor:
        yield executor


def test_dask_workers_give_the_same_entries_also_where_one_is_killed(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with executor_of(None, "inline") as executor:
        here = bring_up_to_date(study, COMPARE[:2], Means(Cache(tmp_path / "here"), executor, PlainLines()))
    with dask(2) as executor:
        assert "Dask's dashboard: http://127.0.0.1:" in capsys.readouterr().err
        means = Means(Cache(tmp_path / "there"), executor, PlainLines())
        there = bring_up_to_date(study, fusing_with("once"), means)
        assert executor.submit(os.getenv, "NUMBA_NUM_THREADS").result() == "1"
        assert executor.submit(os.getpid).result() != os.getpid()
        with pytest.raises(ZeroDivisionError):
            executor.submit(divmod, 1, 0).result()
        with pytest.raises(PipelineError, match="does not see"):
            executor.submit(str, tmp_path / "elsewhere").result()
        poisoned = bring_up_to_date(study, fusing_with("whenever"), replace(means, cache=Cache(tmp_path / "anew")))
    assert (study / "died").exists()
    assert there.set_aside == []
    assert contents(here) == contents(there)
    ((session, reason),) = poisoned.set_aside
    assert session.id == POISONED
    assert "the process that computed fuse died twice (several workers died of it)" in reason


def test_workers_with_other_code_are_refused() -> None:
    pytest.importorskip("distributed")
    from pipeline.engine.dask_cluster import _guarded

    with pytest.raises(PipelineError, match="do not run the same Steadyhand as this command"):
        _guarded("0" * 64, [], str, (1,), {})


def test_a_scheduler_that_does_not_answer_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    from pipeline.engine import dask_cluster

    monkeypatch.setattr(dask_cluster, "_CONNECT_S", 0.5)
    with pytest.raises(PipelineError, match="no Dask scheduler answers there"), executor_of(1, "dask://127.0.0.1:1"):
        pass


def test_an_executor_that_is_none_is_said(
    study: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for command in ("report", "compare", "check", "replay"):
        ran = run(capsys, monkeypatch, command, study, "--executor", "proces")
        assert ran.code == 2
        assert '--executor: there is no "proces"; did you mean "process"?' in ran.err


def test_dask_that_is_not_installed_is_said(
    study: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    ran = run(capsys, monkeypatch, "compare", study, "--executor", "dask")
    assert ran.code == 2
    assert 'pip install "steadyhand[dask]"' in ran.err


def test_processes_hand_on_errors_and_stop_at_work() -> None:
    with Processes(1) as executor:
        assert executor.submit(divmod, 7, 2).result() == (3, 1)
        with pytest.raises(ZeroDivisionError):
            executor.submit(divmod, 1, 0).result()
        began = time.monotonic()
        asleep = executor.submit(time.sleep, 60)
        while not asleep.running():
            time.sleep(0.01)
    assert time.monotonic() - began < 30
    with pytest.raises(WorkerLostError):
        asleep.result()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
def test_a_process_ends_with_the_one_that_started_it() -> None:
    import multiprocessing

    here, there = multiprocessing.Pipe()
    starter = multiprocessing.get_context("spawn").Process(target=_start_one, args=(there,))
    starter.start()
    pid = here.recv()
    assert starter.pid is not None
    os.kill(starter.pid, signal.SIGKILL)
    starter.join()
    until = time.monotonic() + 10
    while Path(f"/proc/{pid}").exists() and _state(pid) != "Z" and time.monotonic() < until:
        time.sleep(0.02)
    assert not Path(f"/proc/{pid}").exists() or _state(pid) == "Z"


def _start_one(pipe: object) -> None:
    with Processes(1) as executor:
        pipe.send(executor.submit(os.getpid).result())  # type: ignore[attr-defined]
        time.sleep(60)


def _state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return "Z"


def test_numeric_libraries_start_no_threads_where_a_process_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    for name in ("MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    threads.one_a_process()
    with Processes(1) as executor:
        assert executor.submit(os.getenv, "OPENBLAS_NUM_THREADS").result() == "1"
        assert executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "4"  # the user's own is kept
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
