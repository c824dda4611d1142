"""`export`: a study's data for other programs: tables with a dictionary, a script for R, logs with the tracks, BIDS."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path

from pipeline.commands import console
from pipeline.commands.publish import refuse_study
from pipeline.commands.studies import ANONYMISED, for_each_study, refuse_same_names
from pipeline.engine.messages import session_messages
from pipeline.engine.result import Result
from pipeline.errors import PipelineError, did_you_mean
from pipeline.stages import COMPARE

FORMATS: Mapping[str, str] = {
    "csv": "pipeline.commands.export_tables:as_csv",
    "parquet": "pipeline.commands.export_tables:as_parquet",
    "r": "pipeline.commands.export_r:for_r",
    "mcap": "pipeline.commands.export_mcap:as_mcap",
    "bids": "pipeline.commands.export_bids:as_bids",
}
"""What `--to` takes, and the function that writes it: of a result and a folder, the number of files."""


def export(
    studies: Sequence[Path],
    to: str,
    out: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
    *,
    anonymise: bool = False,
) -> None:
    """Write each study into a folder; exit with 1 where some session was set aside or read in part.

    Raises PipelineError for a format that is not known, and for a folder that belongs to a study.
    """
    if to not in FORMATS:
        raise PipelineError(f'--to: there is no "{to}"{did_you_mean(to, FORMATS)}')
    folders = _folders(studies, f"{to}{ANONYMISED}" if anonymise else to, out)
    for folder in folders.values():
        refuse_study(folder)

    def write(study: Path, result: Result) -> int:
        for line in session_messages(result):
            console.warn(line)
        folder = folders[study]
        _refuse_within(folder, result.folder)
        folder.mkdir(parents=True, exist_ok=True)
        count = _function(to)(result, folder)
        console.say(f"{result.name}: {count} files in {console.short_path(folder)}")
        return result.exit_code

    sys.exit(for_each_study(studies, COMPARE, jobs, cache, write, executor_name=executor, anonymise=anonymise))


def _folders(studies: Sequence[Path], what: str, out: Path | None) -> dict[Path, Path]:
    """A folder for each study; `--out` itself for a single one."""
    if out is not None and len(studies) == 1:
        return {studies[0]: out}
    names = refuse_same_names(studies)
    return {study: (out or Path("exports")) / f"{name}-{what}" for study, name in zip(studies, names, strict=True)}


def _refuse_within(folder: Path, study: Path) -> None:
    """An export in the study's own folder could be taken for its data."""
    if folder.resolve().is_relative_to(study.resolve()):
        raise PipelineError(
            f"--out {folder}: is within the study folder, which is never changed; choose another folder"
        )


def _function(to: str) -> Callable[[Result, Path], int]:
    module, _, name = FORMATS[to].partition(":")
    function: Callable[[Result, Path], int] = getattr(import_module(module), name)
    return function
