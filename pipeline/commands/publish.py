"""Copies a study's report from the cache to the user's folder, with its provenance."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipeline.engine.cache import file_digest
from pipeline.engine.code_digest import code_digest, versions
from pipeline.engine.provenance import LIBRARIES, OF_STATISTICS, PROVENANCE
from pipeline.engine.result import Result
from pipeline.engine.stage import Stage
from pipeline.errors import PipelineError
from pipeline.stages import COMPARE, INGEST, REPLAY
from pipeline.study.folder import SETTINGS_FILE
from pipeline.study.settings import Study

_RESULTS = "results.json"
_ARCHIVE = "report.zip"
_NOT_PORTABLE = re.compile(r'[\\/:*?"<>|\x00-\x1f]')
FORMATS: Mapping[str, tuple[str, ...]] = {
    "html": ("report.html", "traces.html", "participants/"),
    "pdf": ("report.pdf",),
    "json": (_RESULTS,),
    "csv": ("tables/",),
    "svg": ("figures/",),
    "bib": ("references.bib",),
    "zip": (_ARCHIVE,),
}
"""What `--format` takes: each format's files and folders. The ZIP holds the files of the other formats asked for."""


def publish(result: Result, folder: Path, command: Sequence[str], formats: Iterable[str] = FORMATS) -> None:
    """Copy the report's files into `folder`, and remove those of an earlier report that this one does not have."""
    available = {}
    if "report" in result.entries:
        entry = result.entry("report")
        available = {path.relative_to(entry).as_posix(): path for path in sorted(entry.rglob("*")) if path.is_file()}
    available[_RESULTS] = result.entry("compare") / _RESULTS
    wanted = [file for name in formats for file in FORMATS[name]]
    files = {name: path for name, path in available.items() if _is_of(name, wanted)}
    archive = [_ARCHIVE] if _ARCHIVE in wanted else []
    refuse_inputs(result, folder, [*files, *archive, PROVENANCE])
    for stale in set(_published(folder)) - {*files, *archive}:
        (folder / stale).unlink(missing_ok=True)
    changed = [copy(source, folder / name) for name, source in files.items()]
    changed.append(_publish_provenance(result, folder, command, [*files, *archive]))
    if archive and (any(changed) or not (folder / _ARCHIVE).is_file()):
        _write_archive({**files, PROVENANCE: folder / PROVENANCE}, result.name, folder / _ARCHIVE)


def _is_of(name: str, wanted: Iterable[str]) -> bool:
    """Whether it is one of these files, or in one of these folders, which end in a slash."""
    return any(name == entry or (entry.endswith("/") and name.startswith(entry)) for entry in wanted)


def _write_archive(files: Mapping[str, Path], study: str, path: Path) -> None:
    """Everything in one file to send, in a folder of the study's name; the same files give the same bytes.

    A folder's name may hold what separates folders elsewhere, such as `..\\`; whoever unpacks the ZIP there is not to
    find the files in another place.
    """
    root = _NOT_PORTABLE.sub("_", study).strip(". ") or "study"
    with _replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, source in sorted(files.items()):
            archive.writestr(zipfile.ZipInfo(f"{root}/{name}"), source.read_bytes(), zipfile.ZIP_DEFLATED)


def _publish_provenance(result: Result, folder: Path, command: Sequence[str], files: Iterable[str]) -> bool:
    content = {
        "study": result.name,
        **_program(command, COMPARE),
        **_settings_and_inputs(result),
        "files": sorted(files),
    }
    return _write_provenance(content, result.entry("compare") / _RESULTS, folder)


def publish_provenance(results: Iterable[Result], folder: Path, command: Sequence[str]) -> None:
    """provenance.json of a replay of several studies."""
    studies = {result.name: _settings_and_inputs(result) for result in results}
    _write_provenance({**_program(command, (*INGEST, REPLAY)), "studies": studies}, folder / _RESULTS, folder)


def publish_exploration(study: Study, folder: Path, command: Sequence[str]) -> None:
    """provenance.json of an exploration, which reads study.yaml alone."""
    settings = json.loads(study.model_dump_json(exclude_defaults=True))
    program = _program(command, ())
    program["code_sha256"] = {"explore": code_digest("pipeline.simulation.exploration")}
    _write_provenance({**program, "settings": settings}, folder / _RESULTS, folder)


def _program(command: Sequence[str], stages: Iterable[Stage]) -> dict[str, Any]:
    """What ran: the command, versions, and each stage's digest, which covers its code and the versions of libraries.

    `command` says what of it has a say in the results, studies by name. Folders, and how many processes computed, would
    tell of a person's machine and make the same report another file elsewhere.
    """
    return {
        "command": ["steadyhand", *command],
        "python": platform.python_version(),
        "versions": versions(["steadyhand", *LIBRARIES, *OF_STATISTICS]),
        "code_sha256": {stage.name: code_digest(stage.module) for stage in stages},
    }


def _settings_and_inputs(result: Result) -> dict[str, Any]:
    """What was read: the settings that study.yaml states, and the digests of the input files."""
    settings = json.loads(result.study.model_dump_json(exclude_defaults=True))
    return {"settings": settings, "inputs_sha256": result.named_inputs}


def _write_provenance(provenance: dict[str, Any], results: Path, folder: Path) -> bool:
    """Write provenance.json unless the same is there already; whether it was written."""
    provenance["results_sha256"] = file_digest(results)
    text = (json.dumps(provenance, indent=1, ensure_ascii=False) + "\n").encode()
    path = folder / PROVENANCE
    if path.is_file() and path.read_bytes() == text:
        return False
    with _replacing(path) as temporary:
        temporary.write_bytes(text)
    return True


def refuse_study(folder: Path) -> None:
    """Refuse to write a report into a study's own folder; called before anything is computed."""
    if (folder / SETTINGS_FILE).exists():
        raise PipelineError(f"--out {folder}: is the folder of a study; choose another folder for the report")


def refuse_inputs(result: Result, folder: Path, files: Iterable[str]) -> None:
    """Refuse to overwrite the study's own input files."""
    inputs = {(result.folder / name).resolve() for name in result.inputs}
    for name in files:
        if (folder / name).resolve() in inputs:
            raise PipelineError(f"--out {folder}: {name} there belongs to the study; choose another folder")


def publish_results(result: Result, folder: Path, command: Sequence[str]) -> None:
    """Write results.json and its provenance.

    The provenance keeps listing the files of an earlier report, so that the next report can remove them.
    """
    refuse_inputs(result, folder, [_RESULTS, PROVENANCE])
    copy(result.entry("compare") / _RESULTS, folder / _RESULTS)
    _publish_provenance(result, folder, command, {*_published(folder), _RESULTS})


def _published(folder: Path) -> list[str]:
    """The files that an earlier report wrote into the folder, as its provenance lists them.

    The list may have been edited: only names that a report writes, and only below the folder, are believed.
    """
    try:
        listed = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    root = folder.resolve()
    known = [file for files in FORMATS.values() for file in files]
    ours = [name for name in listed if isinstance(name, str) and _is_of(name, known) and ".." not in Path(name).parts]
    return [name for name in ours if (root / name).resolve().is_relative_to(root)]


def copy(source: Path, target: Path) -> bool:
    """Copy a file, completely or not at all, unless the target is the same already; whether it was copied."""
    if target.is_file() and target.read_bytes() == source.read_bytes():
        return False
    with _replacing(target) as temporary:
        shutil.copyfile(source, temporary)
    return True


@contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    """A temporary file to fill, which then replaces the target at once: a stopped run leaves the old one intact."""
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
