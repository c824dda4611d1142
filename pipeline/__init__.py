"""From a study folder to a report. In Python, `load` brings a study up to date and gives its tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.notebook import Tables

__all__ = ["load"]


def load(study: str | Path, *, cache: str | Path | None = None, jobs: int = 1, executor: str = "process") -> Tables:
    """A study's tables as DataFrames, brought up to date as `steadyhand compare` does, with the same cache.

    `cache`, `jobs` and `executor` are those of the command, but that one job is the default: several need a notebook,
    or a script whose own work stands under `if __name__ == "__main__":`. What befell sessions is a warning. Raises
    PipelineError where nothing can be done.
    """
    from pipeline import notebook as loading  # pandas and the rest only when there is something to load

    return loading.load(Path(study), None if cache is None else Path(cache), jobs, executor)
