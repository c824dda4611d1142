"""`explore`: simulate a study's participants with better and worse trackers and other estimators; write one report."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.commands import console
from pipeline.engine.executors import executor_of
from pipeline.engine.folders import reports_folder
from pipeline.engine.progress import show_progress
from pipeline.errors import PipelineError
from pipeline.study.folder import load_study
from pipeline.study.settings import Study
from pipeline.study.simulation import SelectionSimulation

if TYPE_CHECKING:
    from pipeline.report.sections.exploration import Explored
    from pipeline.simulation.exploration import Grid
    from pipeline.simulation.session import Setting

_PAGE, _PRINT, _RESULTS = "explore.html", "explore.pdf", "results.json"
_VALUES, _RATES = 6, 4  # of an option: what a figure has room for
_LIMITS = {"--latency": (0.0, 0.9), "--noise": (0.01, 1000.0), "--rate": (1.0, 1000.0)}


@dataclass(frozen=True)
class Options:
    """The command's options as they were typed; None for what the study decides."""

    latency: str | None
    noise: str | None
    rate: str | None
    estimators: str | None
    participants: int
    repeats: int


def explore(folder: Path, options: Options, out: Path | None, jobs: int | None, executor_name: str) -> None:
    """Simulate every point and write the report; nothing is written until everything is computed."""
    from pipeline.commands.publish import refuse_study

    study = _study(folder)
    target = out or reports_folder() / f"{folder.resolve().name}-explore"
    refuse_study(target)
    from pipeline.simulation import exploration
    from pipeline.simulation.session import Setting

    setting = Setting(study, str(folder / "study.yaml"))
    grid = _grid(setting, options)
    try:
        with (
            executor_of(jobs, executor_name, console.warn, [exploration.__name__]) as executor,
            show_progress() as progress,
        ):
            begin = partial(progress.begin, "exploring", unit="small studies")
            rows = exploration.explore(setting, grid, executor, begin, progress.advance)
            progress.end()
    except KeyboardInterrupt:
        raise _StoppedError("interrupted; nothing was written") from None
    explored = _explored(folder.resolve().name, setting, grid, rows)
    _write(explored, grid, target, ("explore", explored.name, *_given(options)))
    _say(explored)
    console.say(f"Report: {console.short_path(target / _PAGE)}  {console.short_path(target / _PRINT)}")


def _given(options: Options) -> list[str]:
    return [f"--{name}={value}" for name, value in asdict(options).items() if value is not None]


class _StoppedError(PipelineError):
    exit_code = 130  # as a shell says of Ctrl-C


def _study(folder: Path) -> Study:
    study = load_study(folder, to_be_made=True)
    if not isinstance(study.simulation, SelectionSimulation):
        kind = "none" if study.simulation is None else f"kind: {study.simulation.kind}"
        raise PipelineError(
            f"{folder / 'study.yaml'}: explore needs a `simulation:` block of kind: selection, found {kind};"
            " studies/peephole has one to start from"
        )
    return study


def _grid(setting: Setting, options: Options) -> Grid:
    """The points to simulate: as the options say, or else the study's own tracker with better and worse ones."""
    from pipeline.simulation.exploration import Grid, shown_estimators, stated

    own = stated(setting)
    latencies_s = (own.latency_s / 2, own.latency_s, min(2 * own.latency_s, 0.9)) if own.latency_s else (0.0, 0.05, 0.1)
    return Grid(
        _numbers("--latency", options.latency) or latencies_s,
        _numbers("--noise", options.noise) or (own.noise_sd_mm / 4, own.noise_sd_mm / 2, own.noise_sd_mm),
        _numbers("--rate", options.rate) or (own.rate_hz / 2, own.rate_hz, 2 * own.rate_hz),
        _names("--estimators", options.estimators) or shown_estimators(setting.study),
        options.participants,
        options.repeats,
    )


def _numbers(option: str, text: str | None) -> tuple[float, ...]:
    """The numbers of `0.1,0.05`, in ascending order; empty where the option was not given."""
    low, high = _LIMITS[option]
    values = []
    for piece in _names(option, text, _RATES if option == "--rate" else _VALUES):
        try:
            value = float(piece)
        except ValueError:
            raise PipelineError(f'{option}: "{piece}" is not a number; give numbers separated by commas') from None
        if not low <= value <= high:
            raise PipelineError(f"{option}: should lie between {low:g} and {high:g}, found {piece}")
        values.append(value)
    if len(set(values)) < len(values):
        raise PipelineError(f"{option}: a value is listed twice: {text}")
    return tuple(sorted(values))


def _names(option: str, text: str | None, most: int = _VALUES) -> tuple[str, ...]:
    if text is None:
        return ()
    names = tuple(piece.strip() for piece in text.split(","))
    if "" in names:
        raise PipelineError(f'{option}: a value is missing in "{text}"')
    if len(set(names)) < len(names):
        raise PipelineError(f"{option}: a value is listed twice: {text}")
    if len(names) > most:
        raise PipelineError(f"{option}: takes up to {most} values at once, found {len(names)}; explore in several runs")
    return names


def _explored(name: str, setting: Setting, grid: Grid, rows: list[dict[str, Any]]) -> Explored:
    from pipeline.report.sections.exploration import Explored
    from pipeline.simulation.exploration import stated
    from pipeline.simulation.what_pays import MEASURES, differences, means, what_pays
    from pipeline.tables import table as tables

    people, own = tables.frame("explore_people", rows), grid.nearest(stated(setting))
    result_tables = {
        "explore": tables.frame("explore", means(people)),
        "explore_differences": tables.frame("explore_differences", differences(people, setting.study.alpha)),
        "explore_people": people,
    }
    pays = tuple(what_pays(people, own, measure) for measure in MEASURES)
    return Explored(name, setting.study, result_tables, pays, own, grid.participants, grid.repeats)


def _write(explored: Explored, grid: Grid, target: Path, command: Sequence[str]) -> None:
    """The pages, results.json and the tables, each whole or not at all."""
    from pipeline.commands.publish import copy, publish_exploration
    from pipeline.report.document import html, pdf
    from pipeline.report.sections.exploration import document
    from pipeline.tables import results
    from pipeline.tables import table as tables

    study = {"name": explored.name, "title": explored.study.title, "alpha": explored.study.alpha}
    settings: Mapping[str, Any] = {**study, "own_tracker": explored.own._asdict(), **asdict(grid)}
    with tempfile.TemporaryDirectory() as written, tempfile.TemporaryDirectory() as drawn:
        folder, pictures = Path(written), Path(drawn)
        results.write_exploration(
            folder / _RESULTS, settings, explored.tables, [pays.record() for pays in explored.pays]
        )
        for name, table in explored.tables.items():
            tables.write(name, table, folder)
            tables.write_csv(name, table, folder)
        pages = document(explored, pictures)
        html.render(pages, pictures, folder / _PAGE)
        pdf.render(pages, pictures, folder / _PRINT)
        for path in sorted(folder.iterdir()):
            copy(path, target / path.name)
    publish_exploration(explored.study, target, command)


def _say(explored: Explored) -> None:
    from pipeline.report.sections.exploration import pays_sentence

    for pays in explored.pays:
        console.say("".join(pays_sentence(pays, pays.now.estimator)))
    console.say("Simulated participants; direction and rough size only.")
