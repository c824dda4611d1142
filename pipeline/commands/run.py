"""`report` and `compare`: bring studies up to date and write what was asked for."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from pipeline import results
from pipeline.cache import Cache
from pipeline.commands import console
from pipeline.commands.publish import publish, publish_results, refuse_study
from pipeline.commands.summary import summary
from pipeline.errors import PipelineError
from pipeline.runner import InThisProcess, Means, Result, bring_up_to_date
from pipeline.stage import Stage
from pipeline.stages import COMPARE, STAGES

_CLONE = Path(__file__).resolve().parents[2]
CACHE_FOLDER = ".steadyhand-cache"


def reports_folder() -> Path:
    """The clone's `reports`, or `./reports` where the program does not run from a clone."""
    return _CLONE / "reports" if (_CLONE / "reports" / "README.md").is_file() else Path.cwd() / "reports"


def cache_in(folder: Path | None) -> Cache:
    """The cache in a folder, or beside the reports."""
    return Cache(folder if folder is not None else reports_folder().parent / CACHE_FOLDER)


@contextmanager
def executor_of(jobs: int | None) -> Iterator[Executor]:
    """This process for one job, a pool of processes for more; no process starts before there is work."""
    count = jobs or os.cpu_count() or 1
    if count == 1:
        yield InThisProcess()
        return
    import multiprocessing

    with ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield pool


def for_each(
    studies: Sequence[Path],
    stages: Sequence[Stage],
    jobs: int | None,
    cache: Path | None,
    then: Callable[[Path, Result], int],
    *,
    failed: Callable[[Path, PipelineError], None] = lambda _folder, _error: None,
    bring: Callable[[Path, Sequence[Stage], Means], Result] = bring_up_to_date,
) -> int:
    """Bring each study up to date and do with it what `then` does; the highest of the exit codes.

    A study with which either cannot be done is said, handed to `failed`, and does not stop the others.
    """
    code = 0
    with executor_of(jobs) as executor:
        for folder in studies:
            try:
                with console.progress() as progress:
                    result = bring(folder, stages, Means(cache_in(cache), executor, progress))
                code = max(code, then(folder, result))
            except PipelineError as error:
                console.warn(f"steadyhand: {error}")
                failed(folder, error)
                code = max(code, error.exit_code)
    return code


def _out_folders(studies: Sequence[Path], out: Path | None) -> list[Path]:
    """A folder a study; `--out` itself for a single one."""
    if out is not None and len(studies) == 1:
        return [out]
    return [(out or reports_folder()) / name for name in refuse_same_names(studies)]


def refuse_same_names(studies: Sequence[Path]) -> list[str]:
    """The studies' names; PipelineError where two are the same."""
    names = [study.resolve().name for study in studies]
    for name in names:
        if names.count(name) > 1:
            raise PipelineError(f'two studies are called "{name}", and their reports would be one; rename a folder')
    return names


def report(studies: Sequence[Path], out: Path | None, jobs: int | None, cache: Path | None) -> None:
    """Write reports; exit with 1 where some session was set aside or read in part."""
    _run(studies, STAGES, out, jobs, cache)


def compare(studies: Sequence[Path], out: Path | None, jobs: int | None, cache: Path | None) -> None:
    """Write results.json only."""
    _run(studies, COMPARE, out, jobs, cache)


def _run(
    studies: Sequence[Path], stages: Sequence[Stage], out: Path | None, jobs: int | None, cache: Path | None
) -> None:
    folders = dict(zip(studies, _out_folders(studies, out), strict=True))
    for folder in folders.values():
        refuse_study(folder)

    def write(study: Path, result: Result) -> int:
        _show(result)
        if stages is STAGES:
            publish(result, folders[study], sys.argv)
            console.say(f"Report: {short(folders[study] / 'report.html')}  {short(folders[study] / 'report.pdf')}")
        else:
            publish_results(result, folders[study])
            console.say(f"Results: {short(folders[study] / 'results.json')}")
        console.say(what_was_done(result))
        return result.exit_code

    sys.exit(for_each(studies, stages, jobs, cache, write))


def what_befell(result: Result) -> Iterator[str]:
    """A line a session that is not wholly in the results, and a file that is not used."""
    for session, reason in result.set_aside:
        yield f"{result.name}: session {session.id} set aside: {reason}"
    for session, reason in result.in_part:
        yield f"{result.name}: session {session.id} read in part: {reason}"
    for name, reason in result.unused:
        yield f"{result.name}: {name} not used: {reason}"


def _show(result: Result) -> None:
    """What happened to the sessions, and the results in a few lines."""
    for line in what_befell(result):
        console.warn(line)
    for line in summary(results.read(result.entry("compare") / "results.json")):
        console.say(line)


def short(path: Path) -> str:
    """Relative to where the user is, when that is shorter."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def what_was_done(result: Result) -> str:
    """How much of each stage was computed, in how long."""
    done = [f"{stage} {count}" for stage, count in result.computed.items() if count]
    if not done:
        return f"Nothing had changed, so nothing was computed again ({result.seconds:.1f} s)."
    return f"Computed: {', '.join(done)} ({result.seconds:.1f} s)."
