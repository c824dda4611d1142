"""`make limits`: how much a study may hold. Seconds, processor time and the most memory held at once, of a first run.

Each study is made in a temporary folder and reported by the command in a process of its own. docs/limits.md has the
figures of one machine. Nothing here passes or fails; ARGS="trials people" runs those alone, and ARGS="--part 10 trials"
a tenth of them.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from pipeline.sessions.logs.mcap import Message, in_order, write
from tests.benchmarks.archive import HELD, held_mb, write_archive
from tests.benchmarks.stage import STAGES
from tests.conftest import CLONE, EPOCH_NS

_POLL_S = 0.1
_CONDITIONS = "abcdef"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("studies", nargs="*", choices=[*STUDIES, []], help="default: all")
    parser.add_argument("--part", type=int, default=1, help="an N-th of each study's size")
    parser.add_argument("--jobs", default="2")
    words = parser.parse_args()
    print(f"  {'study':<52}{'s':>8}{'CPU s':>8}{'GB':>8}")
    for name in words.studies or STUDIES:
        with tempfile.TemporaryDirectory() as root:
            study = Path(root) / "study"
            study.mkdir()
            said = STUDIES[name](study, words.part)
            took_s, cpu_s, most_gb, end = reported(study, Path(root), words.jobs)
            print(f"  {said:<52}{took_s:>8.0f}{cpu_s:>8.0f}{most_gb:>8.2f}  {end}", flush=True)
            for stage in STAGES if name == "session" else ():
                took_s, cpu_s, most_gb = stage_alone(study, Path(root) / "stages", stage)
                print(f"  {f'its {stage} alone':<52}{took_s:>8.0f}{cpu_s:>8.0f}{most_gb:>8.2f}", flush=True)


def reported(study: Path, root: Path, jobs: str) -> tuple[float, float, float, str]:
    """Seconds, processor seconds and GB of a report, all its processes together, and how it ended if not well."""
    words = ["report", str(study), "--out", str(root / "out"), "--cache", str(root / "cache"), "--jobs", jobs]
    most_mb, began, cpu_before_s = 0.0, time.monotonic(), _cpu_s()
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen([sys.executable, "-m", "pipeline", *words], cwd=CLONE, stdout=said, stderr=said)
        while process.poll() is None:
            most_mb = max(most_mb, held_mb(process.pid))
            time.sleep(_POLL_S)
        took_s = time.monotonic() - began
        said.seek(0)
        lines = said.read().decode().splitlines()
    return (
        took_s,
        _cpu_s() - cpu_before_s,
        most_mb / 1024,
        "" if process.returncode == 0 else f"exit {process.returncode}: {lines[-1][:200]}",
    )


def stage_alone(study: Path, folder: Path, stage: str) -> tuple[float, float, float]:
    """Seconds, processor seconds and GB of one stage of the study's only session."""
    began = time.monotonic()
    words = [sys.executable, "-m", "tests.benchmarks.stage", str(study), str(folder), stage]
    said = subprocess.run(words, cwd=CLONE, check=True, capture_output=True, text=True).stdout.split()
    return time.monotonic() - began, float(said[0]), float(said[1])


def _cpu_s() -> float:
    """Processor time of all processes that this one started and that have ended, and of those that they started."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


# The studies ----------------------------------------------------------------------------------------------------------


def long_session(study: Path, part: int) -> str:
    """One session of three hours: a phone at 1 kHz, a tracker at 120 Hz and a reference."""
    hours = 3 / part
    (study / "data").mkdir()
    _settings(
        study,
        "ab",
        "sessions: data/{participant}_{condition}.mcap\n"
        "estimators: {raw: {type: raw}, fusion: {type: fusion_kalman}}\n"
        "log_limits: {unpacked_mib: 16384, messages: 100000000}\n"
        "streams:\n"
        "  tracker: {topic: /tracker, kind: position, latency_s: 0.05, noise_sd_mm: 8}\n"
        "  imu: {topic: /imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100}\n"
        "  reference: {topic: /reference, kind: reference}\n",
    )
    write(study / "data" / "P1_a.mcap", {}, _readings(hours * 3600))
    return f"one session of {hours:.3g} h, 1 kHz and 120 Hz"


def _readings(seconds: float) -> Iterator[Message]:
    """Second by second, so that no more than one is in memory."""
    random = np.random.default_rng(0)
    for begins in range(int(seconds)):
        second: list[Message] = []
        for topic, content, rate, width, noise in (
            ("/tracker", "position", 120, 3, 0.008),
            ("/reference", "position", 120, 3, 0.0001),
            ("/imu", "acceleration", 1000, 10, 0.1),
        ):
            at = begins + np.arange(rate) / rate
            values = random.normal(0, noise, (rate, width))
            if content == "position":
                values[:, 0] += 0.1 * np.sin(2 * at)
            else:
                values[:, :3] += np.column_stack([-0.4 * np.sin(2 * at), np.full(rate, 9.80665), np.zeros(rate)])
                values[:, 6:] = (0.0, 0.0, 0.0, 1.0)
            late = 0.05 if topic == "/tracker" else 0.0
            for instant, value in zip(at, values, strict=True):
                arrival = EPOCH_NS + round((instant + late) * 1e9)
                second.append(Message(topic, content, arrival, arrival, value))  # type: ignore[arg-type]
        yield from in_order(second)


def trials(study: Path, part: int) -> str:
    """Two million trials of a table: 200 people, 2 conditions."""
    count = 2_000_000 // part
    _settings(study, "ab", "trials: t.csv\ncomparisons: [{measure: selection_mse_mm2, test: t_paired}]\n")
    random = np.random.default_rng(0)
    each = count // 400
    with (study / "t.csv").open("w", encoding="utf-8") as file:
        file.write(
            "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,start_s,selection_s\n"
        )
        for person in range(200):
            for condition in "ab":
                off = random.normal(0, 5, (each, 2)).round(3)
                file.writelines(
                    f"P{person:03d},{condition},{trial},100,50,{100 + x},{50 + y},{trial},{trial + 0.8}\n"
                    for trial, (x, y) in enumerate(off.tolist())
                )
    return f"{each * 400:,} trials"


def people(study: Path, part: int) -> str:
    """300 people, 6 conditions, 40 measures, each tested over all conditions with its follow-ups."""
    count = max(300 // part, 4)
    _settings(study, _CONDITIONS, 'measures: m.csv\ncomparisons: [{measure: "*", test: rm_anova}]\n')
    random = np.random.default_rng(0)
    _measures(study, (f"P{n:03d}" for n in range(count)), _CONDITIONS, [f"m{n:02d}" for n in range(40)], random)
    return f"{count} people, 6 conditions, 40 measures"


def sessions(study: Path, part: int) -> str:
    """10 000 sessions of four seconds."""
    count = 10_000 // part
    study.rmdir()
    write_archive(study, count, 4.0, HELD)
    return f"{count:,} sessions"


def conditions(study: Path, part: int) -> str:
    """60 conditions, each compared with each other one: 1 770 pairs."""
    count = max(60 // part, 3)
    names = [f"c{n:02d}" for n in range(count)]
    _settings(study, names, "measures: m.csv\ncomparisons: [{measure: m, test: t_paired}]\n")
    _measures(study, (f"P{n:02d}" for n in range(20)), names, ["m"], np.random.default_rng(0))
    return f"{count} conditions, {count * (count - 1) // 2:,} pairs"


def _settings(study: Path, names: Iterator[str] | str | list[str], rest: str) -> None:
    (study / "study.yaml").write_text(f"conditions: [{', '.join(names)}]\n{rest}", encoding="utf-8")


def _measures(
    study: Path, who: Iterator[str], names: str | list[str], measures: list[str], random: np.random.Generator
) -> None:
    rows = (
        f"{person},{name},{measure},{10 + at / 10 + value:.4f}\n"
        for person in who
        for at, name in enumerate(names)
        for measure, value in zip(measures, random.normal(0, 1, len(measures)), strict=True)
    )
    (study / "m.csv").write_text("participant,condition,measure,value\n" + "".join(rows), encoding="utf-8")


STUDIES: Mapping[str, Callable[[Path, int], str]] = {
    "trials": trials,
    "people": people,
    "conditions": conditions,
    "session": long_session,
    "sessions": sessions,
}

if __name__ == "__main__":
    main()
