"""The command line. Heavy libraries are imported where they are used: `--help` must answer at once."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated

import typer

from pipeline.commands import kept, planning, recording
from pipeline.commands.options import Anonymise, CacheFolder, ExecutorName, Jobs, Out, Studies
from pipeline.engine import threads

_INTERRUPTED = 130

# A process that ends looks through all of its memory for garbage: half a second of a run, for what ends with it anyway.
atexit.register(gc.freeze)

app = typer.Typer(
    name="steadyhand",
    help="From a folder of study logs to a report: does the tracking help people?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"steadyhand {version('steadyhand')}")
        raise typer.Exit


@app.callback()
def _of_all_commands(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


@app.command()
def report(
    studies: Studies,
    out: Out = None,
    jobs: Jobs = None,
    cache: CacheFolder = None,
    executor: ExecutorName = "process",
    formats: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="FORMAT,...",
            help="What to write, joined by commas: html, pdf, json (results.json), csv (tables), svg (figures), zip"
            " (the others in one file). Default: all.",
        ),
    ] = None,
    anonymise: Anonymise = False,
) -> None:
    """Write each study's report: HTML, PDF, results.json, tables and figures, and all of it as a ZIP."""
    from pipeline.commands import run

    run.report(studies, out, jobs, cache, executor, formats, anonymise=anonymise)


@app.command()
def compare(
    studies: Studies,
    out: Out = None,
    jobs: Jobs = None,
    cache: CacheFolder = None,
    executor: ExecutorName = "process",
    anonymise: Anonymise = False,
) -> None:
    """Everything but figures and pages: print the comparisons and write results.json."""
    from pipeline.commands import run

    run.compare(studies, out, jobs, cache, executor, anonymise=anonymise)


@app.command()
def check(
    studies: Studies,
    accept: Annotated[
        bool,
        typer.Option("--accept", help="Take today's results as the expected ones; a person reviews what it changes."),
    ] = False,
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the outcome as JUnit XML too, for a CI page.")
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(
            metavar="PROGRAM,…",
            help="Compare with what other programs compute instead: scipy, pingouin, statsmodels, r. Says why their"
            " figures differ, where that is known.",
        ),
    ] = None,
    jobs: Jobs = None,
    cache: CacheFolder = None,
    executor: ExecutorName = "process",
) -> None:
    """Recompute and compare with expected.json in the study folder: a table of what moved, and by how much.

    Exit codes: 0 nothing moved, 1 some session was set aside or read in part, or with --against a figure differs for no
    known reason, 2 a study could not be checked, 3 numbers moved.
    """
    if against is not None:
        from pipeline.commands.against import against as compare_programs

        compare_programs(studies, against, accept, junit, jobs, cache, executor)
        return
    from pipeline.commands import check as command

    command.check(studies, accept, junit, jobs, cache, executor)


@app.command()
def diff(
    before: Annotated[Path, typer.Argument(metavar="A", help="A results.json, or a folder that holds one.")],
    now: Annotated[Path, typer.Argument(metavar="B", help="Another one.")],
    tolerance: Annotated[
        float,
        typer.Option(
            min=0,
            max=1,
            help="By which share of the larger numbers may differ and count as the same; below 1e-12 all do. With 0,"
            " every bit counts.",
        ),
    ] = 1e-9,
    as_json: Annotated[bool, typer.Option("--json", help="Print all of it as JSON.")] = False,
) -> None:
    """Show what changed between two results, by how much, and which settings, inputs or versions may explain it.

    Exit codes: 0 no result changed, 2 a file cannot be compared, 3 numbers moved, rows came or went, or text changed.
    """
    from pipeline.commands import diff as command

    command.diff(before, now, tolerance, as_json)


@app.command()
def export(
    studies: Studies,
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="csv or parquet: every table, with a dictionary of the columns; r: the tables and a script that"
            " computes the comparisons anew; mcap: each session's log with every track, and a layout for Foxglove;"
            " bids: the recordings as a dataset of Motion-BIDS.",
        ),
    ],
    out: Out = None,
    jobs: Jobs = None,
    cache: CacheFolder = None,
    executor: ExecutorName = "process",
    anonymise: Anonymise = False,
) -> None:
    """Write a study's data for other programs."""
    from pipeline.commands import export as command

    command.export(studies, to, out, jobs, cache, executor, anonymise=anonymise)


@app.command()
def fit(
    studies: Studies,
    first: Annotated[float, typer.Option(min=5, metavar="S", help="Seconds of each session to fit on.")] = 30.0,
    jobs: Jobs = None,
    cache: CacheFolder = None,
) -> None:
    """Say what a study's recordings tell of its noise, latency and other parameters, as lines for study.yaml."""
    from pipeline.commands import fit as command

    command.fit_studies(studies, first, jobs, cache)


@app.command()
def replay(
    studies: Studies,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="ESTIMATOR.KEY=VALUE,…",
            help="Values to try for a parameter of an estimator; may be given often, and those of one estimator"
            " multiply out.",
        ),
    ] = None,
    estimators: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A YAML file with further estimators, as in study.yaml.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Where to write; one report for all studies.")] = None,
    jobs: Jobs = None,
    cache: CacheFolder = None,
    executor: ExecutorName = "process",
) -> None:
    """Run variants of the estimators over studies and rank them: HTML, PDF, results.json and Parquet."""
    from pipeline.commands import replay as command

    command.replay(studies, changes or [], estimators, out, jobs, cache, executor)


@app.command()
def simulate(
    studies: Studies,
    jobs: Jobs = None,
    if_needed: Annotated[
        bool, typer.Option("--if-needed", help="Only what is not there yet, or was made from other settings.")
    ] = False,
) -> None:
    """Write the simulated logs and tables of a study whose study.yaml has a `simulation:` block."""
    from pipeline.commands import simulate as command

    command.simulate(studies, jobs, if_needed=if_needed)


@app.command()
def explore(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="A study with a simulation: block of kind selection.")],
    *,
    latency: Annotated[
        str | None,
        typer.Option(metavar="S,…", help="The tracker's latencies, in s. Default: half, once and twice the study's."),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(metavar="MM,…", help="Its noise SDs, in mm. Default: a quarter, half and all of the study's."),
    ] = None,
    rate: Annotated[
        str | None, typer.Option(metavar="HZ,…", help="Its rates, in Hz. Default: half, once and twice the study's.")
    ] = None,
    estimators: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,…",
            help="The study's estimators, each as what is displayed; the others are compared with the first. Default:"
            " those that the conditions show.",
        ),
    ] = None,
    participants: Annotated[int, typer.Option(min=2, max=999, help="People in each small study.")] = 12,
    repeats: Annotated[int, typer.Option(min=1, max=1000, help="Small studies at each point.")] = 2,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Where to write.")] = None,
    jobs: Jobs = None,
    executor: ExecutorName = "process",
) -> None:
    """A better tracker or a better filter? Simulate small studies over both: error, time and participants needed."""
    from pipeline.commands import explore as command

    options = command.Options(latency, noise, rate, estimators, participants, repeats)
    command.explore(study, options, out, jobs, executor)


app.command()(recording.record)
app.command()(recording.marker)


@app.command()
def inspect(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="A log, or several.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows of the table `quality`.")] = False,
) -> None:
    """Show what a log contains and how much of it can be read."""
    from pipeline.commands import inspect as command

    command.inspect(files, as_json)


@app.command("new")
def new_study(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="A folder with logs, tables, or both.")],
    template: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="An empty study with example tables: peephole, tlx, fitts or between."),
    ] = None,
    title: Annotated[str | None, typer.Option(help="The study's title. Default: the folder's name.")] = None,
    conditions: Annotated[
        str | None, typer.Option(metavar="NAME,…", help="The conditions, the baseline first.")
    ] = None,
    columns: Annotated[
        list[str] | None,
        typer.Option("--column", metavar="HEADER=COLUMN", help="What a header of your tables means; may be repeated."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option(metavar="UNIT", help="Of positions in a table of trials: mm, cm, m or px.")
    ] = None,
    px_per_mm: Annotated[float | None, typer.Option(min=0.001, help="Pixels in a millimetre of the display.")] = None,
    gravity: Annotated[
        str | None,
        typer.Option(metavar="AXIS", help="Along which of the tracker's axes gravity points, such as -y."),
    ] = None,
) -> None:
    """Look at what a folder holds and write a study.yaml for it, with a comment on every line.

    What cannot be told is asked on a terminal; elsewhere the options say it, or the likeliest is taken and named.
    Nothing is ever overwritten.
    """
    from pipeline.commands import new as command

    command.run(folder, template, command.stated_by(title, conditions, columns or [], unit, px_per_mm, gravity))


app.command()(planning.power)
app.command()(planning.plan)


@app.command()
def audit(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A paper's printed figures; docs/audit.md says how.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Say which of a paper's printed figures agree with each other; exit code 3 where some cannot."""
    from pipeline.commands import audit as command

    command.audit(file, as_json)


app.add_typer(kept.app, name="cache")


@cache
def _commands() -> Callable[[], None]:
    """All commands, with their options read off the functions above; a process may run several, as tests do."""
    command: Callable[[], None] = typer.main.get_command(app)
    return command


def main() -> None:
    """Run the command; an error that the user can correct is a message, not a traceback."""
    threads.limit_to_one_thread()
    from pipeline.commands.console import warn
    from pipeline.errors import RUN_AGAIN, PipelineError

    try:
        _commands()()
    except BrokenPipeError:  # the reader of our output, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except PipelineError as error:
        warn(f"steadyhand: {error}")
        sys.exit(error.exit_code)
    except SystemExit as stop:
        if stop.code == _INTERRUPTED:  # Typer makes this of Ctrl-C
            warn(f"steadyhand: interrupted. {RUN_AGAIN}")
        raise
    except OSError as error:
        from pipeline.commands.places import remedy

        where = error.filename or "a file"
        warn(f"steadyhand: {where}: {error.strerror or error}{remedy(error, sys.argv)}")
        sys.exit(2)
    except Exception as error:
        if os.environ.get("STEADYHAND_TRACEBACK"):
            raise
        warn(f"steadyhand: internal error; please report it: {type(error).__name__}: {error}")
        warn("(set STEADYHAND_TRACEBACK=1 to see where it happened)")
        sys.exit(2)


if __name__ == "__main__":
    main()
