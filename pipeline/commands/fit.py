"""`fit`: print what a study's recordings say its parameters are, as a block to paste into study.yaml."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.commands import console
from pipeline.commands.studies import for_each_study
from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.sessions import recording
from pipeline.sessions.fitting import Fit, Parameter, fit
from pipeline.stages import INGEST


def fit_studies(studies: Sequence[Path], first_s: float, jobs: int | None, cache: Path | None) -> None:
    """Fit each study and print the block; exit with the highest of their codes."""

    def then(folder: Path, result: Result) -> int:
        recordings = {
            session.id: recording.load(result.study, result.entries["ingest"][session.id].folder)
            for session in result.sessions
        }
        if not recordings:
            raise PipelineError(f"{folder}: has no session to fit to")
        try:
            fitted = fit(result.study, recordings, first_s)
        except PipelineError as error:
            raise PipelineError(f"{folder}: {error}") from None
        for line in _lines(result.name, fitted, first_s, recordings):
            console.say(line)
        return result.exit_code

    sys.exit(for_each_study(studies, INGEST, jobs, cache, then))


def _lines(name: str, fitted: Fit, first_s: float, recordings: dict[str, recording.Recording]) -> Iterator[str]:
    yield f"# {name}: fitted on the first {first_s:g} s of {len(recordings)} sessions; copy what you trust."
    yield from _block(fitted.parameters)
    for stream, (mean, half) in fitted.gravity_mm_s2.items():
        values = ", ".join(f"{value:.0f}" for value in mean)
        yield f"# streams.{stream}.gravity_mm_s2 by the mean specific force: [{values}] ± {float(np.max(half)):.0f}"
    yield from _mountings(recordings)
    for row in fitted.parameters:
        if not row.fitted.told:
            yield (
                f"# {row.where}.{row.key} cannot be fitted from these data: anything from {_short(row.fitted.low)} to"
                f" {_short(row.fitted.high)} fits; {_short(row.stated)} was kept."
            )
    if fitted.scores:
        yield "# RMSE in mm on the rest of each session, with study.yaml's values -> with the fitted ones:"
    for score in fitted.scores:
        yield f"#   {score.session}  {score.estimator}: {score.stated_rmse_mm:.1f} -> {score.fitted_rmse_mm:.1f}"


def _block(parameters: Sequence[Parameter]) -> Iterator[str]:
    """YAML, section by section, each value with its interval."""
    fitted = [row for row in parameters if row.fitted.told]
    for section in dict.fromkeys(row.where.split(".", 1)[0] for row in fitted):
        yield f"{section}:"
        for where in dict.fromkeys(row.where for row in fitted if row.where.startswith(f"{section}.")):
            yield f"  {where.split('.', 1)[1]}:"
            for row in fitted:
                if row.where == where:
                    interval = f"{_short(row.fitted.low)} to {_short(row.fitted.high)}"
                    yield f"    {row.key}: {_short(row.fitted.value)}  # {interval}; was {_short(row.stated)}"


def _short(value: float) -> str:
    """Three digits, as YAML reads a number."""
    text = f"{value:.3g}"
    return text if "e" not in text else f"{float(text):.2e}"


def _mountings(recordings: dict[str, recording.Recording]) -> Iterator[str]:
    """What `calibrate_s` learned, session by session."""
    for session, loaded in recordings.items():
        for stream, phone in loaded.phones.items():
            if phone.calibration is None:
                continue
            learned = phone.calibration
            degrees, half = np.degrees(learned.mounting_rad), 1.96 * np.degrees(learned.mounting_sd_rad)
            angles = ", ".join(f"{value:.2f} ± {one:.2f}" for value, one in zip(degrees, half, strict=True))
            pairs = zip(learned.lever_arm_mm, 1.96 * learned.lever_arm_sd_mm, strict=True)
            arm = ", ".join(f"{value:.0f} ± {one:.0f}" for value, one in pairs)
            yield f"# {session}: {stream} is mounted at [{angles}] degrees, lever arm [{arm}] mm"
