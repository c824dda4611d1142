"""A stage's small jobs: each done once, by whichever process, whoever dies."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from pathlib import Path

import pytest

from pipeline.engine.jobs import Jobs
from pipeline.engine.processes import InThisProcess, Processes


def note(folder: Path, number: int) -> None:
    with (folder / f"{number:02d}").open("a") as file:
        file.write(f"{number}")


def note_process(folder: Path, number: int) -> None:
    (folder / f"{number:02d}").write_text(str(os.getpid()))


def die_elsewhere(folder: Path, number: int, here: int) -> None:
    if os.getpid() != here:
        os.kill(os.getpid(), signal.SIGKILL)
    note(folder, number)


def fail(folder: Path) -> None:
    raise ValueError(f"nothing goes into {folder.name}")


def note_late(folder: Path, number: int, wait_s: float = 0.05) -> None:
    time.sleep(wait_s)
    note(folder, number)


def wait_for(file: Path) -> None:
    end = time.monotonic() + 60
    while not file.exists():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.fixture(scope="module")
def processes() -> Iterator[Processes]:
    with Processes(2) as executor:
        yield executor


@pytest.fixture(params=["nobody", "this process", "others"])
def executor(request: pytest.FixtureRequest, processes: Processes) -> Executor | None:
    return {"nobody": None, "this process": InThisProcess(), "others": processes}[request.param]


def read(folder: Path) -> list[str]:
    return [path.read_text() for path in sorted(folder.iterdir())]


@pytest.mark.parametrize("count", [0, 3, 40])
def test_every_job_is_done_once(tmp_path: Path, count: int, executor: Executor | None) -> None:
    with Jobs(executor) as jobs:
        for number in range(count):
            jobs.add(note, tmp_path, number)
    assert read(tmp_path) == [str(number) for number in range(count)]


def test_the_executor_does_jobs_while_more_are_added(tmp_path: Path, executor: Executor | None) -> None:
    with Jobs(executor) as jobs:
        jobs.add(note_process, tmp_path, 0)
        end = time.monotonic() + 60
        while not read(tmp_path) or not read(tmp_path)[0]:
            assert time.monotonic() < end
            time.sleep(0.01)
    assert (read(tmp_path) == [str(os.getpid())]) == (not isinstance(executor, Processes))


def test_what_the_executor_has_not_begun_is_done_here(tmp_path: Path) -> None:
    with Processes(1) as executor, Jobs(executor) as jobs:
        jobs.add(wait_for, tmp_path / "00")  # of those that follow, the last that is done here
        for number in range(20):
            jobs.add(note_process, tmp_path, number)
    assert read(tmp_path) == [str(os.getpid())] * 20


def test_what_a_dying_process_leaves_is_done_here(tmp_path: Path, processes: Processes) -> None:
    with Jobs(processes) as jobs:
        for number in range(4):
            jobs.add(die_elsewhere, tmp_path, number, os.getpid())
    assert read(tmp_path) == [str(number) for number in range(4)]


def test_an_error_of_a_job_is_raised_once_no_other_is_at_work(tmp_path: Path, executor: Executor | None) -> None:
    """What they write into may be gone a moment later."""
    (tmp_path / "gone").mkdir()
    longest_s = 0.3 if isinstance(executor, Processes) else 0.01  # in this process each job waits for the one before
    with pytest.raises(ValueError, match="nothing goes into"), Jobs(executor) as jobs:
        jobs.add(fail, tmp_path)
        for number in range(20):  # the first is still at work when all others are done
            jobs.add(note_late, tmp_path / "gone", number, 0.01 if number else longest_s)
    written = read(tmp_path / "gone")
    time.sleep(1.5 * longest_s)
    assert read(tmp_path / "gone") == written


def test_an_error_beside_the_jobs_ends_them(tmp_path: Path, processes: Processes) -> None:
    with pytest.raises(KeyboardInterrupt), Jobs(processes) as jobs:
        for number in range(50):
            jobs.add(note_late, tmp_path, number)
        wait_for(tmp_path / "00")  # both processes are at work
        raise KeyboardInterrupt
    written = read(tmp_path)
    assert len(written) < 50
    time.sleep(0.15)
    assert read(tmp_path) == written


def test_all_but_one_process_help_and_the_fewest_are_started(tmp_path: Path) -> None:
    with Processes(3) as executor:
        first = executor.submit(os.getpid).result()
        with executor.all_but_one() as helpers:
            assert helpers is not None
            assert [helpers.submit(os.getpid).result() for _ in range(5)] == [first] * 5
            waiting = [helpers.submit(wait_for, tmp_path / "go on") for _ in range(3)]
            while not all(future.running() for future in waiting[:2]):
                time.sleep(0.01)
            assert not waiting[2].running()
            (tmp_path / "go on").touch()
        assert executor.submit(os.getpid).result()
    with Processes(1) as executor, executor.all_but_one() as helpers:
        assert helpers is None


def test_processes_that_end_while_idle_are_replaced(tmp_path: Path) -> None:
    with Processes(1) as executor:
        before = executor.submit(os.getpid).result()
        executor.end_idle()
        after = executor.submit(os.getpid).result()
        with pytest.raises(ProcessLookupError):
            os.kill(before, 0)
    assert before != after
    assert executor.count == 1
