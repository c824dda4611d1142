"""What commands over one or more studies have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from pipeline.commands import console
from pipeline.engine.executors import PROCESS, executor_of
from pipeline.engine.folders import cache_in
from pipeline.engine.machine_code import keep_machine_code_in
from pipeline.engine.messages import damage_messages
from pipeline.engine.progress import show_progress
from pipeline.engine.resources import Resources
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date
from pipeline.engine.stage import Stage
from pipeline.errors import PipelineError
from pipeline.stages import MODULES_OF_SESSIONS

ANONYMISED = "-anonymised"
"""What the name of a folder ends with that holds nobody's id, so that it is never one that holds them."""


def for_each_study(
    studies: Sequence[Path],
    stages: Sequence[Stage],
    jobs: int | None,
    cache: Path | None,
    then: Callable[[Path, Result], int],
    *,
    failed: Callable[[Path, PipelineError], None] = lambda _folder, _error: None,
    bring: Callable[[Path, Sequence[Stage], Resources], Result] | None = None,
    executor_name: str = PROCESS,
    anonymise: bool = False,
) -> int:
    """Bring each study up to date and call `then` with it; the highest of the exit codes that `then` returns.

    The error of a study with which either cannot be done is printed and handed to `failed`; the others go on.
    """
    code = 0
    bring = bring or partial(bring_up_to_date, anonymise=anonymise)
    keep_machine_code_in(cache_in(cache).root)
    with executor_of(jobs, executor_name, console.warn, MODULES_OF_SESSIONS) as executor:
        for folder in studies:
            try:
                with show_progress() as progress:
                    result = bring(folder, stages, Resources(cache_in(cache), executor, progress))
                for line in damage_messages(result):
                    console.warn(line)
                code = max(code, then(folder, result))
            except PipelineError as error:
                console.warn(f"steadyhand: {error}")
                failed(folder, error)
                code = max(code, error.exit_code)
    return code


def refuse_same_names(studies: Sequence[Path]) -> list[str]:
    """The studies' names; PipelineError where two are the same."""
    names = [study.resolve().name for study in studies]
    for name in names:
        if names.count(name) > 1:
            raise PipelineError(f'two studies are called "{name}", so their reports would collide; rename a folder')
    return names
