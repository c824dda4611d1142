"""Empty studies with example tables to fill in: one folder here for each, copied as it is."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from pipeline.errors import PipelineError, did_you_mean

NAMES = ("peephole", "tlx", "fitts", "between")


def write_template(folder: Path, name: str) -> None:
    """Copy the files of a template into a folder, made if needed. Raises PipelineError if one is there already."""
    if name not in NAMES:
        raise PipelineError(f'--template: there is no "{name}"{did_you_mean(name, NAMES)}')
    sources = [one for one in files(__name__).joinpath(name).iterdir() if one.is_file()]
    for source in sources:
        if (folder / source.name).exists() or (folder / source.name).is_symlink():
            raise PipelineError(f"{folder / source.name}: already exists, and is never overwritten")
    folder.mkdir(parents=True, exist_ok=True)
    for source in sorted(sources, key=lambda one: one.name):
        with (folder / source.name).open("xb") as file:
            file.write(source.read_bytes())
