"""The options of `record` and `marker`, the two commands for a study that runs.

It imports nothing heavy, so that --help stays fast.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def record(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="A study folder whose study.yaml says recording:.")],
    demo: Annotated[
        bool,
        typer.Option("--demo", help="Simulated senders, and the mouse is the phone; into a folder of its own."),
    ] = False,
    bots: Annotated[
        bool, typer.Option("--bots", help="With --demo: simulated participants play the study, faster than it takes.")
    ] = False,
    participants: Annotated[int, typer.Option(min=1, max=999, help="How many the bots are.")] = 2,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="With --demo: the folder. Default: demo/ and the study's name.")
    ] = None,
    lan: Annotated[
        bool, typer.Option("--lan", help="Serve pages to the network too, by TLS with a certificate made here.")
    ] = False,
    host: Annotated[
        str | None,
        typer.Option(help="With --lan: which of this computer's addresses to serve at."),
    ] = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="The port to serve pages on.")] = 8443,
    plain: Annotated[
        bool,
        typer.Option("--plain", help="With --lan: without TLS. Phones only display then; an app sends the motion."),
    ] = False,
    operator_lan: Annotated[
        bool, typer.Option("--operator-lan", help="With --lan: the operator's page may be on another computer.")
    ] = False,
    certificate: Annotated[
        Path | None, typer.Option("--cert", metavar="FILE", help="With --lan: a certificate of your own, in PEM.")
    ] = None,
    key: Annotated[Path | None, typer.Option("--key", metavar="FILE", help="Its private key, in PEM.")] = None,
    goes_on: Annotated[
        bool, typer.Option("--continue", help="Go on though study.yaml has changed since the first session.")
    ] = False,
) -> None:
    """Run a study live: pages for operator, phone and questionnaire, a steady display, and logs that replay."""
    from pipeline.commands import record as command

    options = command.Options(host, port, demo, goes_on, lan, plain, operator_lan, certificate, key)
    command.record(study, options, out, participants if bots else None)


def marker(
    number: Annotated[int, typer.Option("--id", min=0, max=49, help="Which of the 50 markers.")] = 7,
    size_mm: Annotated[float, typer.Option(min=10, max=120, help="How wide its black square is.")] = 50.0,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Where to write. Default: marker-7.pdf.")] = None,
) -> None:
    """Write a marker to print as a PDF, true to size: with it a webcam is a tracker."""
    from pipeline.commands import marker as command

    command.marker(number, size_mm, out)
