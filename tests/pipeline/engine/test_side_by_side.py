"""Jobs of two processes: each done once, whoever dies."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipeline.engine import two_processes as side_by_side
from pipeline.engine.two_processes import Job


def note(folder: Path, number: int) -> None:
    with (folder / f"{number:02d}").open("a") as file:
        file.write(f"{number}")


def die_elsewhere(folder: Path, number: int, here: int) -> None:
    if os.getpid() != here:
        os._exit(1)
    note(folder, number)


def fail(folder: Path) -> None:
    raise ValueError(f"nothing goes into {folder.name}")


def done(jobs: list[Job], *, apart: bool) -> None:
    with side_by_side.another_process(apart, "pathlib") as pool:
        side_by_side.carry_out(jobs, pool)


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("count", [0, 3, 40])
def test_every_job_is_done_once(tmp_path: Path, count: int, apart: bool) -> None:
    done([Job(note, (tmp_path, number)) for number in range(count)], apart=apart)
    assert [path.read_text() for path in sorted(tmp_path.iterdir())] == [str(number) for number in range(count)]


def test_what_a_dying_process_leaves_is_done_here(tmp_path: Path) -> None:
    done([Job(die_elsewhere, (tmp_path, number, os.getpid())) for number in range(20)], apart=True)
    assert len(list(tmp_path.iterdir())) == 20


@pytest.mark.parametrize("apart", [False, True])
def test_a_fault_of_a_job_is_raised(tmp_path: Path, apart: bool) -> None:
    with pytest.raises(ValueError, match="nothing goes into"):
        done([Job(fail, (tmp_path,))] * 20, apart=apart)
