"""Archives of thousands of sessions: seconds, memory and disk of the first run, of the second, and of variants.

`python -m tests.benchmarks.archive --sessions N` makes a study of N simulated sessions in a temporary folder, runs the
command over it in processes of their own, and prints what each run took. Nothing here passes or fails, but for the
tables of a cluster, which must be those of this machine's processes.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.engine.cache import Cache
from pipeline.engine.executors import executor_of
from pipeline.engine.processes import InThisProcess, Processes
from pipeline.engine.progress import PlainLines
from pipeline.engine.resources import Resources
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date
from pipeline.stages import COMPARE, INGEST
from tests.benchmarks.stock import stock_arrays
from tests.conftest import CLONE, STREAMS, session_messages, write_session

LOGS = 12
SMALL = 48  # sessions, where a ratio is asked for and not a total
FUSED = "{fusion: {type: window_gp, window: 5}, kalman_fusion: {type: fusion_kalman}}"
HELD = "{raw: {type: raw}}"
SETTINGS = f"""title: An archive
conditions: [a, b]
sessions: data/{{participant}}_{{condition}}.mcap
comparisons:
  - {{measure: trial_time_s, test: t_paired}}
{STREAMS}"""
VARIANTS = ("--set", "fusion.window=3,10", "--set", "kalman_fusion.jerk_psd_mm2_s5=1e5,1e7")  # and two as they are
_NOBODY = b"P000000"  # as long as every participant's id
_POLL_S = 0.05


def write_archive(folder: Path, sessions: int, seconds: float, estimators: str = FUSED) -> Path:
    """A study of two conditions: twelve logs under many names, each with its own participant in the metadata."""
    (folder / "data").mkdir(parents=True)
    (folder / "study.yaml").write_text(f"{SETTINGS}estimators: {estimators}\n", encoding="utf-8")
    with tempfile.TemporaryDirectory() as made:
        logs = [
            write_session(
                Path(made) / f"{seed}.mcap", session_messages(seconds, seed), participant=_NOBODY.decode()
            ).read_bytes()
            for seed in range(min(LOGS, sessions))
        ]
    for index in range(sessions):
        participant, condition = f"P{index // 2 + 1:06d}", "ab"[index % 2]
        log = logs[index % len(logs)].replace(_NOBODY, participant.encode(), 1)
        (folder / "data" / f"{participant}_{condition}.mcap").write_bytes(log)
    return folder


@dataclass(frozen=True)
class Ran:
    """What a run took: seconds, and the most memory its process and any one of its workers held, in MB."""

    seconds: float
    main_mb: float
    workers_mb: float


def measured(*words: str) -> Ran:
    """Run the command in a process of its own, and watch it and those it starts."""
    most: dict[int, float] = {}
    began = time.perf_counter()
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen([sys.executable, "-m", "pipeline", *words], cwd=CLONE, stdout=said, stderr=said)
        while process.poll() is None:
            for pid in (process.pid, *_children(process.pid)):
                most[pid] = max(most.get(pid, 0.0), _most_held_mb(pid))
            time.sleep(_POLL_S)
        took = time.perf_counter() - began
        if process.returncode:
            said.seek(0)
            raise SystemExit(said.read().decode())
    main = most.pop(process.pid)
    return Ran(took, main, max(most.values(), default=0.0))


def held_mb(pid: int) -> float:
    """What a process and all those that it started hold at this moment, in MB."""
    return _status_mb(pid, "VmRSS:") + sum(held_mb(child) for child in _children(pid))


def _children(pid: int) -> list[int]:
    """The processes a process started, from whichever of its threads."""
    found = []
    for listed in Path("/proc").glob(f"{pid}/task/*/children"):
        with suppress(OSError):
            found += [int(child) for child in listed.read_text().split()]
    return found


def _most_held_mb(pid: int) -> float:
    """The peak of a process's resident memory so far; 0 of one that has ended."""
    return _status_mb(pid, "VmHWM:")


def _status_mb(pid: int, key: str) -> float:
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith(key):
                return int(line.split()[1]) / 1024
    return 0.0


def reading(study: Path, cache: Path) -> None:
    """A log to tables in the cache, beside the stock reader and decoder that make arrays of it."""
    logs = sorted((study / "data").iterdir())[:LOGS]
    began = time.process_time()  # one thread each; what others do on the machine does not count
    for path in logs:
        stock_arrays(path)
    stock = (time.process_time() - began) / len(logs)
    for named in ("cold", "warm"):
        began = time.process_time()
        result = bring_up_to_date(study, INGEST, Resources(Cache(cache / named), InThisProcess(), PlainLines()))
    ours = (time.process_time() - began) / len(result.sessions)
    print(
        f"  first ingest of a session: {1000 * ours:.0f} ms; stock decoder: {1000 * stock:.0f} ms, {stock / ours:.1f} x"
    )


def running(study: Path, root: Path, sessions: int, variants: bool) -> None:
    """The first run, the second, and variants of the estimators, each the command in a process of its own."""
    where = ["--jobs", "2", "--cache", str(root / "cache")]
    report = ["report", str(study), "--out", str(root / "report"), *where]
    replay = ["replay", str(study), "--out", str(root / "replay"), *where, *VARIANTS]
    runs = [("first run", report), ("second run", report)]
    if variants:
        runs += [("six variants, two of them as they are", replay), ("the same again", replay)]
    for name, words in runs:
        ran = measured(*words)
        memory = f"main process {ran.main_mb:.0f} MB, a worker {ran.workers_mb:.0f} MB"
        print(f"  {name:<40}{ran.seconds:>9.1f} s{1000 * ran.seconds / sessions:>9.1f} ms a session   {memory}")
    logs, kept = (_size_mb(folder) for folder in (study, root / "cache"))
    print(f"  disk: logs {logs:.0f} MB, cache {kept:.0f} MB, report {_size_mb(root / 'report'):.0f} MB")


def _size_mb(folder: Path) -> float:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def two_processes(study: Path, root: Path) -> None:
    """Fusing and assessing by one process and by two, both started and warm."""
    taken = {}
    for count in (1, 2):
        with Processes(count) as executor:
            for named in ("cold", "warm"):
                began = time.perf_counter()
                bring_up_to_date(
                    study, COMPARE[:3], Resources(Cache(root / f"{count}-{named}"), executor, PlainLines())
                )
                taken[count] = time.perf_counter() - began
    print(f"  one process {taken[1]:.1f} s, two {taken[2]:.1f} s: {taken[1] / taken[2]:.2f} x")


@dataclass
class _KillsHalfWay:
    """Kills a process once half of a stage is computed."""

    victim: subprocess.Popen[bytes]
    _left: dict[str, int] = field(default_factory=dict)

    def begin(self, label: str, total: int, unit: str = "sessions") -> None:
        """What is left until then."""
        del unit
        self._left = {label: total // 2} if label == "fusing" else {}

    def advance(self) -> None:
        """One piece is done."""
        for label in self._left:
            self._left[label] -= 1
            if self._left[label] == 0:
                self.victim.kill()

    def end(self) -> None:
        """The stage is done."""


def cluster(study: Path, root: Path) -> None:
    """Two workers of a Dask cluster, one of them killed half-way: are the tables those of this machine's processes?"""
    with executor_of(2) as executor:
        here = bring_up_to_date(study, COMPARE, Resources(Cache(root / "here"), executor, PlainLines()))
    with _on_loopback(root) as (address, workers), executor_of(None, f"dask://{address}") as executor:
        there = bring_up_to_date(study, COMPARE, Resources(Cache(root / "there"), executor, _KillsHalfWay(workers[0])))
        died = workers[0].wait(10) == -signal.SIGKILL
    same = _files(here) == _files(there) and not there.set_aside
    print(
        f"  a cluster of two workers, one killed half-way ({'it died' if died else 'IT LIVED'}): {there.seconds:.1f} s,"
    )
    print(
        f"  processes of this machine: {here.seconds:.1f} s; tables byte for byte the same: {'yes' if same else 'NO'}"
    )
    if not (same and died):
        raise SystemExit(1)


@contextmanager
def _on_loopback(root: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two worker processes; its address."""
    command = [sys.executable, "-m", "distributed.cli.dask_"]
    known = root / "scheduler.json"
    with ExitStack() as until_done:

        def start(what: str, *words: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen(
                [*command[:2], command[2] + what, "--scheduler-file", str(known), "--host", "127.0.0.1", *words],
                cwd=CLONE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            until_done.callback(process.wait)
            until_done.callback(process.terminate)
            return process

        start("scheduler", "--port", "0", "--no-dashboard")
        end = time.monotonic() + 60
        while not known.exists() and time.monotonic() < end:
            time.sleep(0.1)
        workers = [start("worker", "--no-nanny", "--nthreads", "1", "--no-dashboard") for _ in range(2)]
        address = json.loads(known.read_text())["address"].removeprefix("tcp://")
        from distributed import Client

        with Client(f"tcp://{address}") as client:
            client.wait_for_workers(2, timeout=60)
        yield address, workers


def _files(result: Result) -> dict[str, dict[str, bytes]]:
    """Every file of every entry, by stage and session, but for the cache's own."""
    return {
        f"{stage}/{session}": {
            path.name: path.read_bytes() for path in entry.folder.iterdir() if path.name != "entry.json"
        }
        for stage, of in result.entries.items()
        for session, entry in of.items()
    }


def main() -> None:
    """`python -m tests.benchmarks.archive`."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--sessions", type=int, default=SMALL)
    asked.add_argument("--seconds", type=float, default=60.0, help="length of each session")
    asked.add_argument("--light", action="store_true", help="hold the last frame instead of fusing, no variants")
    given = asked.parse_args()
    measure(given.sessions, given.seconds, given.light)


def measure(sessions: int, seconds: float = 60.0, light: bool = False) -> None:
    """All of it, over an archive of so many sessions; `light`: without fusion, which leaves what the archive costs."""
    print(f"An archive of {sessions} sessions of {seconds:g} s, two processes")
    with tempfile.TemporaryDirectory() as made:
        root = Path(made)
        study = write_archive(root / "archive", sessions, seconds, HELD if light else FUSED)
        running(study, root, sessions, not light)
        if not light:
            small = write_archive(root / "small", min(SMALL, sessions), seconds)
            reading(small, root / "read")
            two_processes(small, root)
            cluster(study, root)


if __name__ == "__main__":
    main()
