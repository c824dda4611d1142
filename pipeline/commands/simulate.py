"""`simulate`: write a study's simulated logs and tables."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from pipeline.commands import console
from pipeline.engine.executors import PROCESS, executor_of
from pipeline.engine.progress import show_progress
from pipeline.errors import PipelineError
from pipeline.simulation.up_to_date import is_made
from pipeline.study.folder import load_study
from pipeline.study.settings import Study
from pipeline.study.simulation import ReachSimulation


def simulate(studies: Sequence[Path], jobs: int | None = None, *, if_needed: bool = False) -> None:
    """Write the files of each study's `simulation:` block into its folder.

    With `if_needed` only where they are missing or were made from other settings or other code; a study without the
    block is skipped.
    """
    for folder in studies:
        study = load_study(folder, to_be_made=True)
        if study.simulation is None:
            if if_needed:
                continue
            raise PipelineError(f"{folder / 'study.yaml'}: has no `simulation:` block, so there is nothing to simulate")
        if isinstance(study.simulation, ReachSimulation):
            _reach(folder, study, if_needed)
        else:
            _selection(folder, study, jobs, if_needed)


def _reach(folder: Path, study: Study, if_needed: bool) -> None:
    """Write the paper's Experiment 1, whose logs are small and come with the study."""
    from pipeline.study.session_files import find_sessions

    if if_needed and find_sessions(folder, study).sessions:
        return
    reach = importlib.import_module("pipeline.simulation.reach")
    with show_progress() as progress:
        paths = reach.simulate(folder, study, partial(progress.begin, "simulating"), progress.advance)
        progress.end()
    console.say(f"{folder}: wrote {len(paths)} logs, {paths[0].name} to {paths[-1].name}")


def _selection(folder: Path, study: Study, jobs: int | None, if_needed: bool) -> None:
    if if_needed and is_made(folder, study):
        return
    from pipeline.simulation.study_files import simulate_study

    with executor_of(jobs, PROCESS, modules=[simulate_study.__module__]) as executor, show_progress() as progress:
        files = simulate_study(folder, study, executor, partial(progress.begin, "simulating"), progress.advance)
        progress.end()
    console.say(f"{folder}: wrote {len(files)} logs, {Path(files[0]).name} to {Path(files[-1]).name}, and tables")
