"""The command line. Heavy libraries are imported where they are used: `--help` must answer at once."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    name="steadyhand",
    help="From a folder of study logs to a report: does the tracking help people?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Studies = Annotated[list[Path], typer.Argument(metavar="STUDY...", help="A study folder, or several.")]
Out = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where to write; with several studies a folder each in it.")
]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes to compute in. Default: one a processor.")]
CacheFolder = Annotated[Path | None, typer.Option("--cache", metavar="DIR", help="Where computed tables are kept.")]


@app.command()
def report(studies: Studies, out: Out = None, jobs: Jobs = None, cache: CacheFolder = None) -> None:
    """Write each study's report: HTML, PDF, results.json, tables and figures."""
    from pipeline.commands import run

    run.report(studies, out, jobs, cache)


@app.command()
def compare(studies: Studies, out: Out = None, jobs: Jobs = None, cache: CacheFolder = None) -> None:
    """Everything but figures and pages: print the comparisons and write results.json."""
    from pipeline.commands import run

    run.compare(studies, out, jobs, cache)


@app.command()
def check(
    studies: Studies,
    accept: Annotated[bool, typer.Option("--accept", help="Take today's results as the expected ones.")] = False,
    jobs: Jobs = None,
    cache: CacheFolder = None,
) -> None:
    """Recompute and compare with expected.json in the study folder; exit code 3 where a number moved."""
    from pipeline.commands import check as command

    command.check(studies, accept, jobs, cache)


@app.command()
def simulate(studies: Studies) -> None:
    """Write the logs of a study's `simulation:` block into the study folder."""
    from pipeline.commands import simulate as command

    command.simulate(studies)


@app.command()
def inspect(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="A log, or several.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows of the table `quality`.")] = False,
) -> None:
    """Say what a log holds and what of it can be read."""
    from pipeline.commands import inspect as command

    command.inspect(files, as_json)


@app.command()
def audit(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A paper's printed figures; docs/audit.md says how.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Say which of a paper's printed figures agree with each other; exit code 3 where some cannot."""
    from pipeline.commands import audit as command

    command.audit(file, as_json)


def main() -> None:
    """Run the command; an error the user can mend is a message, not a traceback."""
    # One thread a process: many small matrices, and processes for the rest. Set before NumPy is imported.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    from pipeline.errors import PipelineError

    try:
        app()
    except BrokenPipeError:  # the reader of our output, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except PipelineError as error:
        from pipeline.commands.console import warn

        warn(f"steadyhand: {error}")
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        print("steadyhand: interrupted; what was computed is kept, run it again to go on", file=sys.stderr)  # noqa: T201
        sys.exit(130)
    except OSError as error:
        where = error.filename or "a file"
        print(f"steadyhand: {where}: {error.strerror or error}; check --out and --cache", file=sys.stderr)  # noqa: T201
        sys.exit(2)
    except Exception as error:
        if os.environ.get("STEADYHAND_TRACEBACK"):
            raise
        fault = f"{type(error).__name__}: {error}"
        print(f"steadyhand: a fault of Steadyhand's own, please report it: {fault}", file=sys.stderr)  # noqa: T201
        print("(STEADYHAND_TRACEBACK=1 shows where)", file=sys.stderr)  # noqa: T201
        sys.exit(2)


if __name__ == "__main__":
    main()
