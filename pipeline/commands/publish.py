"""From the cache to the user's folder: a study's report, and where it came from."""

from __future__ import annotations

import json
import os
import platform
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipeline.cache import code_digest, file_digest, versions
from pipeline.errors import PipelineError
from pipeline.provenance import LIBRARIES, PROVENANCE
from pipeline.runner.result import Result
from pipeline.stage import Stage
from pipeline.stages import COMPARE, INGEST, REPLAY
from pipeline.study import SETTINGS_FILE, Study

_RESULTS = "results.json"


def publish(result: Result, folder: Path, command: Sequence[str]) -> None:
    """Bring the report's files into `folder`; what an earlier report left there and this one lacks goes."""
    entry = result.entry("report")
    files = {path.relative_to(entry).as_posix(): path for path in sorted(entry.rglob("*")) if path.is_file()}
    files.pop("entry.json")
    files[_RESULTS] = result.entry("compare") / _RESULTS
    refuse_inputs(result, folder, [*files, PROVENANCE])
    for stale in set(_published(folder)) - set(files):
        (folder / stale).unlink(missing_ok=True)
    for name, source in files.items():
        copy(source, folder / name)
    _publish_provenance(result, folder, command, files)


def _publish_provenance(result: Result, folder: Path, command: Sequence[str], files: Iterable[str]) -> None:
    _write_provenance(
        {"study": result.name, **_program(command, COMPARE), **_read(result), "files": sorted(files)}, folder
    )


def publish_provenance(results: Iterable[Result], folder: Path, command: Sequence[str]) -> None:
    """provenance.json of a replay of several studies."""
    studies = {result.name: _read(result) for result in results}
    _write_provenance({**_program(command, (*INGEST, REPLAY)), "studies": studies}, folder)


def publish_exploration(study: Study, folder: Path, command: Sequence[str]) -> None:
    """provenance.json of an exploration, which reads study.yaml alone."""
    settings = json.loads(study.model_dump_json(exclude_defaults=True))
    program = _program(command, ())
    program["code_sha256"] = {"explore": code_digest("pipeline.exploration")}
    _write_provenance({**program, "settings": settings}, folder)


def _program(command: Sequence[str], stages: Iterable[Stage]) -> dict[str, Any]:
    """What ran; the digest of a stage's code is one of the libraries it uses too."""
    return {
        "command": [Path(command[0]).name, *command[1:]],
        "python": platform.python_version(),
        "versions": versions(["steadyhand", *LIBRARIES]),
        "code_sha256": {stage.name: code_digest(stage.module) for stage in stages},
    }


def _read(result: Result) -> dict[str, Any]:
    """What it read."""
    settings = json.loads(result.study.model_dump_json(exclude_defaults=True))
    return {"settings": settings, "inputs_sha256": result.inputs}


def _write_provenance(provenance: dict[str, Any], folder: Path) -> None:
    provenance["results_sha256"] = file_digest(folder / _RESULTS)
    text = json.dumps(provenance, indent=1, ensure_ascii=False) + "\n"
    with _whole(folder / PROVENANCE) as beside:
        beside.write_text(text, encoding="utf-8")


def refuse_study(folder: Path) -> None:
    """A report never goes into a study's own folder; asked before anything is computed."""
    if (folder / SETTINGS_FILE).exists():
        raise PipelineError(f"--out {folder}: is a study, and its files are not changed; name a folder for the report")


def refuse_inputs(result: Result, folder: Path, files: Iterable[str]) -> None:
    """Nor over the files it was made from."""
    inputs = {(result.folder / name).resolve() for name in result.inputs}
    for name in files:
        if (folder / name).resolve() in inputs:
            raise PipelineError(f"--out {folder}: {name} there is the study's own; name a folder for the report alone")


def publish_results(result: Result, folder: Path, command: Sequence[str]) -> None:
    """results.json and where it came from; what a report left there is still listed, for the next one to clear."""
    refuse_inputs(result, folder, [_RESULTS, PROVENANCE])
    copy(result.entry("compare") / _RESULTS, folder / _RESULTS)
    _publish_provenance(result, folder, command, {*_published(folder), _RESULTS})


def _published(folder: Path) -> list[str]:
    """The files an earlier report put there, inside the folder only."""
    try:
        listed = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    root = folder.resolve()
    ours = [name for name in listed if isinstance(name, str) and Path(name).parent.name in ("tables", "figures")]
    return [name for name in ours if (root / name).resolve().is_relative_to(root)]


def copy(source: Path, target: Path) -> None:
    """Bring a file to its place, whole or not at all; one that is the same already stays."""
    if target.is_file() and target.read_bytes() == source.read_bytes():
        return
    with _whole(target) as beside:
        shutil.copyfile(source, beside)


@contextmanager
def _whole(target: Path) -> Iterator[Path]:
    """A file to fill, which then takes the target's place at once: who is interrupted leaves what was there before."""
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        yield beside
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)
