"""Options that several commands have.

It imports nothing heavy, so that --help stays fast.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Studies = Annotated[list[Path], typer.Argument(metavar="STUDY...", help="A study folder, or several.")]
Out = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where to write; with several studies a folder each in it.")
]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes to compute in. Default: one a processor.")]
CacheFolder = Annotated[Path | None, typer.Option("--cache", metavar="DIR", help="Where computed tables are kept.")]

Anonymise = Annotated[
    bool,
    typer.Option(
        "--anonymise",
        help="Write P01, P02 … for participants' ids, everywhere, into a folder of its own; docs/privacy.md says what"
        " this does not hide.",
    ),
]

ExecutorName = Annotated[
    str,
    typer.Option(
        "--executor",
        metavar="WHERE",
        help="Where to compute: process (processes of this machine), inline (this process), dask (a Dask cluster of"
        " this machine), dask://host:port or tls://host:port (a Dask scheduler). The results are the same.",
    ),
]
