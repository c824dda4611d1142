"""`fit`: estimate a study's parameters from its recordings, and print them as a block to paste into study.yaml."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from pipeline.commands import console, fit_frames
from pipeline.commands.studies import for_each_study
from pipeline.engine.progress import show_progress
from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.sessions import recording
from pipeline.sessions.checks.agreement import LAG
from pipeline.sessions.fitting import Fit, Parameter, fit
from pipeline.stages import INGEST
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.study.streams import AccelerationStream
from pipeline.tables import table as tables
from pipeline.tables.table import Row
from pipeline.words.phrases import counted, listing

_NAMED_MAX = 3
_GRAVITY_OFF_MM_S2 = 500.0  # 3° of tilt


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
            with show_progress() as progress:
                begin = partial(progress.begin, "fitting", unit="steps")
                fitted = fit(result.study, recordings, first_s, begin, progress.advance)
                progress.end()
        except PipelineError as error:
            raise PipelineError(f"{folder}: {error}") from None
        folders = [result.entries["ingest"][session.id].folder for session in result.sessions]
        frames = list(fit_frames.lines(result.study, dict(zip(recordings, folders, strict=True)), first_s))
        checks = list(tables.records("checks", tables.read("checks", folders)))
        lines = _lines(result.study, result.name, fitted, first_s, recordings)
        for line in (*_in_doubt(checks, len(recordings)), *lines, *frames, *_of_checks(checks)):
            console.say(line)
        return result.exit_code

    sys.exit(for_each_study(studies, INGEST, jobs, cache, then))


def _lines(
    study: Study, name: str, fitted: Fit, first_s: float, recordings: dict[str, recording.Recording]
) -> Iterator[str]:
    yield f"# {name}: fitted on the first {first_s:g} s of {len(recordings)} sessions; copy what you trust."
    yield from _block(fitted.parameters)
    for stream, (mean, half) in fitted.gravity_mm_s2.items():
        yield from _gravity(study, stream, mean, float(np.max(half)))
    yield from _mountings(recordings)
    for row in fitted.parameters:
        if row.at_bound:
            yield (
                f"# {row.where}.{row.key}: the fit stopped at its limit {_short(row.fitted.value)}, so that is no"
                f" estimate; probably other settings of study.yaml do not match the data; {_short(row.stated)} was"
                " kept."
            )
        elif row.worse:
            yield (
                f"# {row.where}.{row.key}: {_short(row.fitted.value)} fits the first {first_s:g} s and makes the rest"
                f" less likely; {_short(row.stated)} was kept."
            )
        elif not row.fitted.identified:
            yield (
                f"# {row.where}.{row.key} cannot be fitted from these data: anything from {_short(row.fitted.low)} to"
                f" {_short(row.fitted.high)} fits; {_short(row.stated)} was kept."
            )
    yield from _latencies(study, fitted.parameters)
    yield from _apart(fitted, first_s)
    if fitted.scores:
        yield "# RMSE in mm on the rest of each session, with study.yaml's values -> with the fitted ones:"
    for score in fitted.scores:
        yield f"#   {score.session}  {score.estimator}: {score.stated_rmse_mm:.1f} -> {score.fitted_rmse_mm:.1f}"


def _latencies(study: Study, parameters: Sequence[Parameter]) -> Iterator[str]:
    """A tracker that is later or earlier than stated may as well be a phone that is: only the difference shows."""
    phone = study.stream_of_kind("acceleration")
    for row in parameters:
        if row.key != "latency_s" or not row.usable or row.fitted.low <= row.stated <= row.fitted.high:
            continue
        off_ms = 1000.0 * (row.fitted.value - row.stated)
        other = f"{phone} is stamped {abs(off_ms):.0f} ms too {'early' if off_ms > 0 else 'late'}"
        yield f"# {row.where}.latency_s: or it is right as stated and {other}: the data cannot tell which"


def _apart(fitted: Fit, first_s: float) -> Iterator[str]:
    """The sensors session by session, to see whether one value suits all."""
    if len(fitted.apart) > 1:
        yield f"# Each session alone, by its first {first_s:g} s, with 95 % intervals:"
        for session, rows in fitted.apart.items():
            values = (f"{row.where.split('.', 1)[1]}.{row.key} {_alone(row)}" for row in rows)
            yield f"#   {session}  {'; '.join(values)}"
    if all(row.gain is None for row in fitted.parameters):
        yield f"# No session goes on after its first {first_s:g} s, so that nothing of this could be checked on a rest."


def _alone(row: Parameter) -> str:
    if row.at_bound or not row.fitted.identified:
        return "cannot be told"
    return f"{_short(row.fitted.value)} [{_short(row.fitted.low)}, {_short(row.fitted.high)}]"


def _gravity(study: Study, stream: str, mean: FloatArray, half: float) -> Iterator[str]:
    """Gravity by the mean specific force, with its 95 % interval, compared with study.yaml."""
    stated = study.streams[stream]
    assert isinstance(stated, AccelerationStream)  # noqa: S101 - only phones have a gravity
    off = float(np.linalg.norm(mean - np.array(stated.gravity_mm_s2)))
    measured, in_settings = (", ".join(f"{value:.0f}" for value in vector) for vector in (mean, stated.gravity_mm_s2))
    yield f"# streams.{stream}.gravity_mm_s2 by the mean specific force: [{measured}] ± {half:.0f}"
    if off <= max(_GRAVITY_OFF_MM_S2, 3 * half):
        yield f"#   which agrees with [{in_settings}] in study.yaml, {off:.0f} mm/s² off"
    else:
        cause = "gravity, orientation or accelerometer is wrong"
        yield f"#   and study.yaml has [{in_settings}], {off:.0f} mm/s² off: {cause}"


def _in_doubt(rows: Sequence[Row], sessions: int) -> Iterator[str]:
    """What to put right before any figure is copied."""
    red = list(dict.fromkeys(str(row["session"]) for row in rows if row["status"] == "red"))
    if red:
        yield (
            f"# {len(red)} of {counted(sessions, 'session')} with a red check ({listing(red[:_NAMED_MAX])}"
            f"{', …' if len(red) > _NAMED_MAX else ''}), named below: put that right first, for the fit makes up for it"
        )


def _of_checks(rows: Sequence[Row]) -> Iterator[str]:
    """The lag of each session with what it means for either kind of stamp, and the checks that are not green."""
    lags = [row for row in rows if row["check"] == LAG]
    if lags:
        yield "# How much later the tracker's stamps are than the phone's, by their movement, with the 95 % interval."
        yield "# With stamp: arrival this is latency_s; with stamp: measurement it should be 0, or the clocks differ."
    for row in lags:
        yield f"#   {row['session']}  {row['found']}; {row['expected']}"
    for row in rows:
        if row["status"] != "green":
            yield f"# {row['session']}: {row['status']}, {row['check']}: {row['message']}"


def _block(parameters: Sequence[Parameter]) -> Iterator[str]:
    """YAML, section by section, each value with its interval."""
    fitted = [row for row in parameters if row.usable]
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
            angles = ", ".join(f"{value:.2f} ± {margin:.2f}" for value, margin in zip(degrees, half, strict=True))
            pairs = zip(learned.lever_arm_mm, 1.96 * learned.lever_arm_sd_mm, strict=True)
            arm = ", ".join(f"{value:.0f} ± {margin:.0f}" for value, margin in pairs)
            yield f"# {session}: {stream} is mounted at [{angles}] degrees, lever arm [{arm}] mm"
