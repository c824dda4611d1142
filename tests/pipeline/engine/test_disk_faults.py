"""One operation on files fails: the run says so or is right all the same, and the next run is right.

A run does several hundred operations. The tests fail every so manieth of them, and all of them with
STEADYHAND_EVERY_FAULT=1 (a quarter of an hour).
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.failing_disk import FailingDisk
from tests.pipeline.helpers import Ran, Steadyhand

SETTINGS = (
    "conditions: [a, b]\nsessions: data/{participant}_{condition}.mcap\nestimators: {raw: {type: raw}}\n"
    "measures: m.csv\ncomparisons: [{test: t_paired, measure: m}]\n" + STREAMS
)
FAULTS = (errno.ENOSPC, errno.EIO)
EVERY = os.environ.get("STEADYHAND_EVERY_FAULT") == "1"


@pytest.fixture
def study(folder: Callable[..., Path]) -> Path:
    rows = "".join(f"P{p},{c},m,{p * at + at}\n" for p in range(3) for at, c in enumerate("ab"))
    root = folder(SETTINGS, **{"m.csv": f"participant,condition,measure,value\n{rows}"})
    write_session(root / "data" / "P1_a.mcap", session_messages(2.5))
    return root


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FailingDisk:
    disk = FailingDisk(tmp_path)
    disk.install(monkeypatch)
    return disk


def _written(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _check(disk: FailingDisk, run: Callable[[], Ran], begin: Callable[[], None], out: Path, step: int) -> None:
    """Fail every `step`-th operation of `run`, which each time begins with what `begin` leaves."""
    begin()
    disk.begin(None)
    assert run().code == 0
    right, count = _written(out), len(disk.done)
    for fails_at, error in _faults(count, 1 if EVERY else step):
        begin()
        disk.begin(fails_at, error)
        ran = run()
        failed = disk.done[fails_at] if fails_at < len(disk.done) else "nothing"
        disk.begin(None)
        about = (fails_at, failed, os.strerror(error), ran)
        after = _written(out) if out.is_dir() else {}
        if ran.code == 0:
            assert after == right, about
        else:
            assert os.strerror(error) in ran.err, about
            assert "internal error" not in ran.err, about
        if ran.code != 1:  # with 1 there is a report, and it says what is missing
            assert after.items() <= right.items(), about
        again = run()
        assert again.code == 0, (about, again)
        assert _written(out) == right, about


def _faults(count: int, step: int) -> Iterator[tuple[int, int]]:
    """Where to fail, and with what."""
    for place, fails_at in enumerate(range(0, count, step)):
        yield fails_at, FAULTS[place % len(FAULTS)]


@pytest.mark.slow
def test_while_a_run_computes(study: Path, steadyhand: Steadyhand, disk: FailingDisk) -> None:
    def begin() -> None:
        for folder in (steadyhand.out, steadyhand.cache):
            shutil.rmtree(folder, ignore_errors=True)

    _check(disk, lambda: steadyhand("compare", study), begin, steadyhand.out, step=17)


@pytest.mark.slow
@pytest.mark.usefixtures("no_figures", "blank_print")
def test_while_a_report_is_put_in_its_place(study: Path, steadyhand: Steadyhand, disk: FailingDisk) -> None:
    """The lines that copy the files of one folder copy those of another: figures are written, and tables are not."""

    def report() -> Ran:
        return steadyhand("report", study, "--format", "html,pdf,json,svg,zip")

    assert report().code == 0
    assert {path.name for path in steadyhand.out.iterdir()} > {"figures", "report.html", "report.pdf", "report.zip"}
    _check(disk, report, lambda: shutil.rmtree(steadyhand.out, ignore_errors=True), steadyhand.out, step=5)
