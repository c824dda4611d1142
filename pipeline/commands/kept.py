"""The options of `cache`, the commands for what earlier runs kept.

It imports nothing heavy, so that --help stays fast.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.commands.options import CacheFolder

app = typer.Typer(help="Show, prune and verify what earlier runs computed and kept.", no_args_is_help=True)


@app.command("show")
def show(cache: CacheFolder = None) -> None:
    """Show what the cache holds: entries, size and last use, stage by stage."""
    from pipeline.commands import cache as command

    command.show(cache)


@app.command("prune")
def prune(
    older_than: Annotated[
        float | None, typer.Option(min=0, metavar="DAYS", help="Remove what has not been used for this many days.")
    ] = None,
    keep_current: Annotated[
        list[Path] | None,
        typer.Option(metavar="STUDY", help="Remove what this study, as it is now, does not use; may be repeated."),
    ] = None,
    cache: CacheFolder = None,
) -> None:
    """Remove entries; with both options, those to which both apply. What is needed again will be computed again."""
    from pipeline.commands import cache as command

    command.prune_cache(cache, older_than, keep_current or [])


@app.command("verify")
def verify(cache: CacheFolder = None) -> None:
    """Compare every entry with the SHA-256 of what was written, and remove the damaged. Exit code 1: some were."""
    from pipeline.commands import cache as command

    command.verify_cache(cache)
