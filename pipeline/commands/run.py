"""`report` and `compare`: bring studies up to date and write what was asked for."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.commands import console
from pipeline.commands.publish import FORMATS, publish, publish_results, refuse_study
from pipeline.commands.studies import ANONYMISED, for_each_study, refuse_same_names
from pipeline.commands.summary import say_results
from pipeline.engine.folders import reports_folder
from pipeline.engine.messages import computed_message, session_messages
from pipeline.engine.result import Result
from pipeline.engine.stage import Stage
from pipeline.errors import PipelineError, did_you_mean
from pipeline.stages import COMPARE, STAGES
from pipeline.tables import results


def report(
    studies: Sequence[Path],
    out: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
    formats: str | None = None,
    *,
    anonymise: bool = False,
) -> None:
    """Write reports; exit with 1 where some session was set aside or read in part. `formats` are joined by commas."""
    wanted = list(FORMATS) if formats is None else [name.strip() for name in formats.split(",")]
    for name in wanted:
        if name not in FORMATS:
            raise PipelineError(f'--format: there is no "{name}"{did_you_mean(name, FORMATS)}')
    options = () if formats is None else ("--format", formats)
    stages = COMPARE if wanted == ["json"] else STAGES
    _run(studies, stages, out, jobs, cache, executor, wanted, options, anonymise=anonymise)


def compare(
    studies: Sequence[Path],
    out: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
    *,
    anonymise: bool = False,
) -> None:
    """Write results.json only."""
    _run(studies, COMPARE, out, jobs, cache, executor, anonymise=anonymise)


def _run(
    studies: Sequence[Path],
    stages: Sequence[Stage],
    out: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
    formats: Sequence[str] = (),
    options: Sequence[str] = (),
    *,
    anonymise: bool,
) -> None:
    folders = dict(zip(studies, _out_folders(studies, out, ANONYMISED if anonymise else ""), strict=True))
    words = (*options, *(["--anonymise"] if anonymise else ()))
    for folder in folders.values():
        refuse_study(folder)

    def write(study: Path, result: Result) -> int:
        _show(result)
        if formats:
            publish(result, folders[study], ("report", result.name, *words), formats)
            pages = (console.short_path(folders[study] / FORMATS[name][0]) for name in formats[:2])
            console.say(f"Report: {'  '.join(pages)}")
        else:
            publish_results(result, folders[study], ("compare", result.name, *words))
            console.say(f"Results: {console.short_path(folders[study] / 'results.json')}")
        console.say(computed_message(result))
        return result.exit_code

    sys.exit(for_each_study(studies, stages, jobs, cache, write, executor_name=executor, anonymise=anonymise))


def _out_folders(studies: Sequence[Path], out: Path | None, ending: str) -> list[Path]:
    """A folder a study; `--out` itself for a single one."""
    if out is not None and len(studies) == 1:
        return [out]
    return [(out or reports_folder()) / f"{name}{ending}" for name in refuse_same_names(studies)]


def _show(result: Result) -> None:
    """What happened to the sessions, and the results in a few lines."""
    for line in session_messages(result):
        console.warn(line)
    say_results(results.read(result.entry("compare") / "results.json"))
