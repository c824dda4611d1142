"""The same bytes wherever sessions are computed, and a worker that dies takes nothing with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest

from pipeline.engine import processes, threads
from pipeline.engine.cache import Cache
from pipeline.engine.executors import executor_of
from pipeline.engine.processes import Processes
from pipeline.engine.progress import PlainLines
from pipeline.engine.resources import Resources
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date, run_variants
from pipeline.engine.stage import Stage
from pipeline.errors import PipelineError, WorkerLostError
from pipeline.stages import COMPARE, REPLAY, STAGES
from pipeline.study.settings import Study
from pipeline.study.yaml_text import parse, read_yaml
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.dying import POISONED
from tests.pipeline.forked import FORKED
from tests.pipeline.helpers import run

pytestmark = pytest.mark.forks

Folder = Callable[..., Path]
SETTINGS = (
    "conditions: [a, b]\nsessions: data/{participant}_{condition}.mcap\nestimators: {raw: {type: raw}}\n" + STREAMS
)
SESSIONS = [f"P{person}_{condition}" for person in (1, 2) for condition in "ab"]
MANY = [f"P{person}_{condition}" for person in (1, 2, 3, 4) for condition in "ab"]  # figures are drawn side by side


@pytest.fixture
def study(folder: Folder) -> Path:
    root = folder(SETTINGS)
    for seed, session in enumerate(SESSIONS):
        write_session(root / "data" / f"{session}.mcap", session_messages(2.5, seed=seed))
    return root


@pytest.fixture
def many(folder: Folder) -> Path:
    """So many sessions that other processes draw a report's figures; of events alone, so that these are few."""
    root = folder("conditions: [a, b]\nsessions: data/{participant}_{condition}.mcap\nevents: {topic: /events}\n")
    for seed, session in enumerate(MANY):
        write_session(root / "data" / f"{session}.mcap", session_messages(2.5, seed=seed))
    return root


def fusing_with(function: str) -> tuple[Stage, ...]:
    """Logs read, then fused by one of `dying`."""
    return COMPARE[0], replace(COMPARE[1], function=f"tests.pipeline.dying:{function}")


def contents(result: Result) -> dict[str, dict[str, str]]:
    """The digest of every table."""
    return {stage: {name: one.digest for name, one in of.items()} for stage, of in result.entries.items()}


def test_processes_give_the_same_entries_as_this_process(study: Path, tmp_path: Path) -> None:
    found = []
    for where in ("inline", "process"):
        with executor_of(2, where) as executor:
            found.append(bring_up_to_date(study, COMPARE, Resources(Cache(tmp_path / where), executor, PlainLines())))
    assert contents(found[0]) == contents(found[1])


def test_a_session_that_kills_its_process_is_set_aside_alone(study: Path, tmp_path: Path) -> None:
    with Processes(2, FORKED) as executor:
        resources = Resources(Cache(tmp_path / "cache"), executor, PlainLines())
        result = bring_up_to_date(study, fusing_with("whenever"), resources)
        ((session, reason),) = result.set_aside
        assert session.id == POISONED
        assert reason == 'the process computing stage "fuse" died twice (signal 9), possibly out of memory'
        assert set(result.entries["fuse"]) == set(SESSIONS)
        again = bring_up_to_date(study, fusing_with("whenever"), resources)
    assert again.computed == {"ingest": 0, "fuse": 1}  # it is tried again


def test_a_process_that_was_killed_is_replaced(study: Path, tmp_path: Path) -> None:
    with Processes(2, FORKED) as executor:
        resources = Resources(Cache(tmp_path / "cache"), executor, PlainLines())
        result = bring_up_to_date(study, fusing_with("once"), resources)
        assert (study / "died").exists()
        assert result.set_aside == []


def test_of_a_group_only_the_piece_that_kills_its_process_is_set_aside(study: Path, tmp_path: Path) -> None:
    """Where there are many variants, a process computes those of a session in one go."""
    settings = [
        parse(Study, {**read_yaml(study / "study.yaml"), "estimators": {name: {"type": "raw"}}}, study)
        for name in ("first", "held", "last")
    ]
    stage = replace(REPLAY, function="tests.pipeline.dying:of_one_variant")
    with Processes(2, FORKED) as executor:
        resources = Resources(Cache(tmp_path / "cache"), executor, PlainLines(), fewest_groups=1)
        result = bring_up_to_date(study, COMPARE[:1], resources)
        found = run_variants(result, stage, settings, result.sessions, resources)
        first = result.computed["replay"]
        again = run_variants(result, stage, settings, result.sessions, resources)
    bad = [(i, j) for i, entries in enumerate(found) for j, entry in enumerate(entries) if entry.outcome["set_aside"]]
    assert bad == [([session.id for session in result.sessions].index(POISONED), 1)]
    assert [[entry.digest for entry in entries] for entries in again] == [
        [entry.digest for entry in entries] for entries in found
    ]
    # It is tried again. What a run computed is counted together, however often it went over its stages.
    assert (first, result.computed["replay"] - first) == (12, 1)


def test_tables_of_an_archive_are_joined_in_a_process_of_its_own(
    many: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the same bytes, report and all, its figures drawn by others; if that process dies, the user is told."""
    monkeypatch.setattr(processes, "SPAWN", FORKED)
    with executor_of(1, "inline") as executor:
        here = bring_up_to_date(many, STAGES, Resources(Cache(tmp_path / "here"), executor, PlainLines()))
    with Processes(2, FORKED) as executor:
        resources = Resources(Cache(tmp_path / "apart"), executor, PlainLines(), archive_sessions=1)
        apart = bring_up_to_date(many, STAGES, resources)
        assert contents(apart) == contents(here)
        dying = replace(COMPARE[3], function="tests.pipeline.dying:of_a_study")
        with pytest.raises(PipelineError, match=r'stage "measure" died \(signal 9\), possibly out of memory'):
            bring_up_to_date(many, (*COMPARE[:3], dying), resources)


def test_an_archive_leaves_the_processes_of_the_run_before_others_start(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that no more of them are there at once than the user allowed."""
    monkeypatch.setattr(processes, "SPAWN", FORKED)
    noting = replace(COMPARE[3], function="tests.pipeline.dying:note_helper")
    with Processes(2, FORKED) as executor:
        of_run = executor.submit(os.getpid).result()
        apart = bring_up_to_date(
            study,
            (*COMPARE[:3], noting),
            Resources(Cache(tmp_path / "apart"), executor, PlainLines(), archive_sessions=1),
        )
        with pytest.raises(ProcessLookupError):
            os.kill(of_run, 0)
        here = bring_up_to_date(
            study, (*COMPARE[:3], noting), Resources(Cache(tmp_path / "here"), executor, PlainLines())
        )
    computed_in, helped_by = (apart.entry("measure") / "processes").read_text().split()
    assert len({computed_in, helped_by, str(os.getpid())}) == 3
    computed_in, helped_by = (here.entry("measure") / "processes").read_text().split()
    assert computed_in == str(os.getpid()) != helped_by


@pytest.mark.usefixtures("blank_figures", "blank_print")
@pytest.mark.parametrize("options", [("--jobs", "1"), ("--jobs", "2", "--executor", "inline")])
def test_one_job_or_inline_starts_no_process(
    options: tuple[str, ...],
    many: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not for the figures of a report either."""

    def refuse(_process: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr(BaseProcess, "start", refuse)
    monkeypatch.setattr(subprocess.Popen, "__init__", refuse)
    places = ("--out", tmp_path / "out", "--cache", tmp_path / "cache")
    ran = run(capsys, monkeypatch, "report", many, *places, *options)
    assert (ran.code, "assess 8" in ran.out) == (0, True)
    assert (tmp_path / "out" / "report.pdf").is_file()


@contextmanager
def dask(count: int) -> Iterator[Executor]:
    """A real scheduler with worker processes on loopback, forked as the others here."""
    pytest.importorskip("distributed")
    import dask

    forked = dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"})
    with forked, executor_of(count, "dask") as executor:
        yield executor


def assert_answers_nobody_else(executor: Executor) -> None:
    """Other users of this machine reach the scheduler's port, and could run code in the workers."""
    from distributed import Client
    from distributed.security import Security

    address = executor._client.scheduler.address  # type: ignore[attr-defined]
    assert address.startswith("tls://127.0.0.1:")
    for claimed, security in ((address.replace("tls", "tcp"), None), (address, Security.temporary())):
        with pytest.raises(OSError, match=r"TLS|closed|timed out|Timed out"):
            Client(claimed, timeout=2, security=security)


def test_dask_workers_give_the_same_entries_also_where_one_is_killed(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with executor_of(None, "inline") as executor:
        here = bring_up_to_date(study, COMPARE[:2], Resources(Cache(tmp_path / "here"), executor, PlainLines()))
    with dask(2) as executor:
        assert "Dask dashboard: http://127.0.0.1:" in capsys.readouterr().err
        resources = Resources(Cache(tmp_path / "there"), executor, PlainLines())
        there = bring_up_to_date(study, fusing_with("once"), resources)
        assert executor.submit(os.getenv, "NUMBA_NUM_THREADS").result() == "1"
        assert executor.submit(os.getpid).result() != os.getpid()
        assert_answers_nobody_else(executor)
        with pytest.raises(ZeroDivisionError):
            executor.submit(divmod, 1, 0).result()
        with pytest.raises(PipelineError, match="a worker cannot see"):
            executor.submit(str, tmp_path / "elsewhere").result()
        poisoned = bring_up_to_date(study, fusing_with("whenever"), replace(resources, cache=Cache(tmp_path / "anew")))
    assert (study / "died").exists()
    assert there.set_aside == []
    assert contents(here) == contents(there)
    ((session, reason),) = poisoned.set_aside
    assert session.id == POISONED
    assert 'the process computing stage "fuse" died twice (several workers died)' in reason


def test_workers_with_other_code_are_refused() -> None:
    pytest.importorskip("distributed")
    from pipeline.engine.dask_cluster import checked_call

    with pytest.raises(PipelineError, match="do not run the same Steadyhand as this command"):
        checked_call("0" * 64, [], str, (1,), {})


def test_a_scheduler_that_does_not_answer_is_said() -> None:
    pytest.importorskip("distributed")
    from pipeline.engine.dask_cluster import on_dask

    answers = on_dask("tcp://127.0.0.1:1", 1, print, connect_s=0.1)
    with pytest.raises(PipelineError, match=r"dask://127.0.0.1:1: no Dask scheduler answers there"), answers:
        pass
    answers = on_dask("tls://127.0.0.1:1", 1, print, connect_s=0.1)
    with pytest.raises(PipelineError, match=r"with the certificates of distributed.comm.tls"), answers:
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
    starter = FORKED.Process(target=_start_one, args=(there,))
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
    threads.limit_to_one_thread()
    with Processes(1) as executor:
        assert executor.submit(os.getenv, "OPENBLAS_NUM_THREADS").result() == "1"
        assert executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "4"  # the user's own is kept
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
