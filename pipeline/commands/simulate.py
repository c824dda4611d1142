"""`simulate`: write a study's simulated logs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from pipeline.commands import console
from pipeline.simulate import simulate as write_logs
from pipeline.study import load_study


def simulate(studies: Sequence[Path]) -> None:
    """Write the logs of each study's `simulation:` block into its folder."""
    for folder in studies:
        study = load_study(folder)
        with console.progress() as progress:
            paths = write_logs(folder, study, partial(progress.begin, "simulate"), progress.advance)
            progress.end()
        console.say(f"{folder}: wrote {len(paths)} logs, {paths[0].name} to {paths[-1].name}")
