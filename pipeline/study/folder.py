"""A study's folder: reads and checks its settings, and refuses paths outside the folder."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import PipelineError
from pipeline.study.settings import Study
from pipeline.study.table_parts import files_of, is_split
from pipeline.study.yaml_text import parse, read_yaml

SETTINGS_FILE = "study.yaml"
PREREGISTERED = "preregistered.yaml"
FIXED_NAMES = (PREREGISTERED,)  # files that a study may have, and that no key of study.yaml names


def load_study(folder: Path, *, to_be_made: bool = False) -> Study:
    """The settings of a study folder. Raises PipelineError, naming the file, the field, the fault and the remedy.

    With `to_be_made` its tables need not exist yet.
    """
    if not folder.is_dir():
        raise PipelineError(f"{folder}: there is no such folder; a study is a folder with a {SETTINGS_FILE} in it")
    path = folder / SETTINGS_FILE
    if not path.is_file():
        raise PipelineError(f"{folder}: holds no {SETTINGS_FILE}; studies/README.md shows what goes into one")
    inside(folder, SETTINGS_FILE, str(folder))
    content = read_yaml(path)
    content.setdefault("title", folder.resolve().name)
    study = parse(Study, content, path)
    for field, name in study.files.items():
        file = inside(folder, name, f"{path}: {field}", must_exist=False)
        if is_split(name) and not to_be_made and not files_of(folder, name):
            raise PipelineError(f'{path}: {field}: no file in the study folder fits "{name}"')
        if not is_split(name) and not file.is_file() and not to_be_made:
            made = f"; it is made by: steadyhand simulate {folder}" if study.simulation is not None else ""
            raise PipelineError(f'{path}: {field}: there is no file "{name}" in the study folder{made}')
    if study.sessions is not None:
        inside(folder, study.sessions, f"{path}: sessions", must_exist=False)
    return study


def files_by_fixed_name(folder: Path) -> list[str]:
    """Those that the study has. PipelineError for one that is a link out of its folder."""
    return [name for name in FIXED_NAMES if inside(folder, name, str(folder / name), must_exist=False).is_file()]


def inside(folder: Path, name: str, field: str, must_exist: bool = True) -> Path:
    """The path of a file of the study. Raises PipelineError if `..`, a root or a link makes it outside the folder."""
    root = folder.resolve()
    path = root / name
    try:
        leads_out = Path(name).is_absolute() or ".." in Path(name).parts or not path.resolve().is_relative_to(root)
        exists = path.is_file()
    except (OSError, ValueError, RuntimeError) as error:
        raise PipelineError(f"{field}: {name!r} cannot be a path: {error}") from None
    if leads_out:
        raise PipelineError(f'{field}: "{name}" is outside the study folder; put the file into it')
    if must_exist and not exists:
        raise PipelineError(f'{field}: there is no file "{name}" in the study folder')
    return path
