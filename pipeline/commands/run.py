"""`report` and `compare`: bring studies up to date and write what was asked for."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

from pipeline.commands import console
from pipeline.commands.publish import FORMATS, publish, publish_results, refuse_study
from pipeline.commands.summary import summary
from pipeline.engine.cache import Cache
from pipeline.engine.processes import InThisProcess, Processes
from pipeline.engine.resources import Means
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date
from pipeline.engine.stage import Stage
from pipeline.errors import PipelineError, did_you_mean
from pipeline.stages import COMPARE, STAGES
from pipeline.tables import results

_CLONE = Path(__file__).resolve().parents[2]
CACHE_FOLDER = ".steadyhand-cache"
PROCESS, INLINE, DASK = "process", "inline", "dask"


def reports_folder() -> Path:
    """The clone's `reports`, or `./reports` where the program does not run from a clone."""
    return _CLONE / "reports" if (_CLONE / "reports" / "README.md").is_file() else Path.cwd() / "reports"


def cache_in(folder: Path | None) -> Cache:
    """The cache in a folder, or beside the reports."""
    return Cache((folder if folder is not None else reports_folder().parent / CACHE_FOLDER).resolve())


@contextmanager
def executor_of(jobs: int | None, where: str = PROCESS) -> Iterator[Executor]:
    """What computes, by its name; no process of this machine's pool starts before there is work.

    Raises PipelineError where the name is none of ours, or Dask is not installed or does not answer.
    """
    count = jobs or os.cpu_count() or 1
    if where == INLINE or (where == PROCESS and count == 1):
        yield InThisProcess()
    elif where == PROCESS:
        with Processes(count) as processes:
            yield processes
    elif where == DASK or (where.startswith(f"{DASK}://") and where != f"{DASK}://"):
        _require_dask(where)
        from pipeline.engine.dask_cluster import on_dask

        with on_dask(where.partition("://")[2] or None, count, console.warn) as cluster:
            yield cluster
    else:
        known = (PROCESS, INLINE, DASK, f"{DASK}://host:port")
        raise PipelineError(f'--executor: there is no "{where}"{did_you_mean(where, known)}')


def _require_dask(where: str) -> None:
    try:
        import distributed  # noqa: F401 - whether it is there
    except ImportError:
        raise PipelineError(
            f'--executor {where}: Dask is not installed here; install it with: pip install "steadyhand[dask]"'
        ) from None


def for_each(
    studies: Sequence[Path],
    stages: Sequence[Stage],
    jobs: int | None,
    cache: Path | None,
    then: Callable[[Path, Result], int],
    *,
    failed: Callable[[Path, PipelineError], None] = lambda _folder, _error: None,
    bring: Callable[[Path, Sequence[Stage], Means], Result] = bring_up_to_date,
    where: str = PROCESS,
) -> int:
    """Bring each study up to date and do with it what `then` does; the highest of the exit codes.

    A study with which either cannot be done is said, handed to `failed`, and does not stop the others.
    """
    code = 0
    with executor_of(jobs, where) as executor:
        for folder in studies:
            try:
                with console.progress() as progress:
                    result = bring(folder, stages, Means(cache_in(cache), executor, progress))
                for line in mended(result):
                    console.warn(line)
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


def report(
    studies: Sequence[Path],
    out: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
    formats: str | None = None,
) -> None:
    """Write reports; exit with 1 where some session was set aside or read in part. `formats` are joined by commas."""
    asked = list(FORMATS) if formats is None else [name.strip() for name in formats.split(",")]
    for name in asked:
        if name not in FORMATS:
            raise PipelineError(f'--format: there is no "{name}"{did_you_mean(name, FORMATS)}')
    _run(studies, COMPARE if asked == ["json"] else STAGES, out, jobs, cache, executor, asked)


def compare(studies: Sequence[Path], out: Path | None, jobs: int | None, cache: Path | None, executor: str) -> None:
    """Write results.json only."""
    _run(studies, COMPARE, out, jobs, cache, executor)


def _run(
    studies: Sequence[Path],
    stages: Sequence[Stage],
    out: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
    formats: Sequence[str] = (),
) -> None:
    folders = dict(zip(studies, _out_folders(studies, out), strict=True))
    for folder in folders.values():
        refuse_study(folder)

    def write(study: Path, result: Result) -> int:
        _show(result)
        if formats:
            publish(result, folders[study], sys.argv, formats)
            console.say(f"Report: {'  '.join(short(folders[study] / FORMATS[name][0]) for name in formats[:2])}")
        else:
            publish_results(result, folders[study], sys.argv)
            console.say(f"Results: {short(folders[study] / 'results.json')}")
        console.say(what_was_done(result))
        return result.exit_code

    sys.exit(for_each(studies, stages, jobs, cache, write, where=executor))


def mended(result: Result) -> Iterator[str]:
    """A line a damaged entry of the cache."""
    for stage, session, fault in result.damaged:
        which = f"{stage} of session {session}" if session else stage
        yield f"{result.name}: what was kept of {which} was damaged ({fault}), and has been computed again"


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
