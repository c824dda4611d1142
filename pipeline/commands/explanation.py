"""What may explain why two results differ: settings, inputs, versions and code that are not the same."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.engine.cache import file_digest
from pipeline.engine.provenance import PROVENANCE
from pipeline.errors import PipelineError
from pipeline.tables import results
from pipeline.tables.differences import ABSENT, Change

Content = Mapping[str, Any]
_IDENTITY = {"comparisons": ("measure", "test"), "variants": ("estimator", "variant")}
_STATED = ("title", "data_origin", "conditions", "alpha", "variants")  # in results.json itself


@dataclass(frozen=True)
class ResultsFile:
    """A results.json and the provenance.json beside it; None, and the reason, where the latter cannot be used."""

    path: Path
    content: Content
    provenance: Content | None
    unused_because: str | None = None


@dataclass(frozen=True)
class Explanation:
    """What differs. `complete` is true if the provenance of both results is known."""

    complete: bool
    settings: Sequence[Change]
    inputs: Sequence[Change]
    versions: Sequence[Change]
    code: Sequence[Change]


def read_with_provenance(path: Path) -> ResultsFile:
    """A results.json with the provenance.json beside it, as far as that belongs to it.

    Raises PipelineError where the former cannot be used.
    """
    content = results.read_checked(path)
    beside = path.parent / PROVENANCE
    if not beside.is_file():
        return ResultsFile(path, content, None, f"{path}: there is no {PROVENANCE} beside it")
    try:
        provenance = results.read_object(beside)
    except (PipelineError, OSError) as error:
        return ResultsFile(path, content, None, f"{error}; it is not used")
    if provenance.get("results_sha256", digest := file_digest(path)) != digest:
        return ResultsFile(
            path,
            content,
            None,
            f"{beside}: describes another {path.name} than the one there (checksums differ); it is ignored",
        )
    return ResultsFile(path, content, provenance)


def explain(before: ResultsFile, now: ResultsFile) -> Explanation:
    """What differs in the provenance of two results, as far as it is known of both."""
    old, new = before.provenance, now.provenance
    stated = (_stated(before.content), _stated(now.content))
    if old is None or new is None:
        return Explanation(False, tuple(_changed((), *stated)), (), (), ())
    parts = [_parts_of(provenance) for provenance in (old, new)]
    settings = [_with_stated(known["settings"], own) for known, own in zip(parts, stated, strict=True)]
    return Explanation(
        True,
        tuple(_changed((), *settings)),
        *(tuple(_changed((), *(side[part] for side in parts))) for part in ("inputs", "versions", "code")),
    )


def _stated(content: Content) -> Content:
    """The settings that results.json holds itself; those of a replay by study."""
    if "study" in content:
        return {key: content["study"][key] for key in _STATED if key in content["study"]}
    return {study["name"]: {key: study[key] for key in _STATED if key in study} for study in content["studies"]}


def _parts_of(provenance: Content) -> dict[str, Content]:
    """Settings, digests of inputs, versions, and digests of code; those of several studies by their names."""
    studies = provenance.get("studies")
    if isinstance(studies, Mapping):
        settings: Content = {name: _mapping(study, "settings") for name, study in studies.items()}
        inputs: Content = {
            f"{name}/{file}": digest
            for name, study in studies.items()
            for file, digest in _mapping(study, "inputs_sha256").items()
        }
    else:
        settings, inputs = _mapping(provenance, "settings"), _mapping(provenance, "inputs_sha256")
    versions = {"Python": provenance.get("python"), **_mapping(provenance, "versions")}
    return {
        "settings": settings,
        "inputs": inputs,
        "versions": versions,
        "code": _mapping(provenance, "code_sha256"),
    }


def _mapping(content: Any, key: str) -> Content:
    value = content.get(key) if isinstance(content, Mapping) else None
    return value if isinstance(value, Mapping) else {}


def _with_stated(settings: Content, stated: Content) -> Content:
    """Settings, overridden by those that results.json states itself, which include defaults."""
    merged = dict(settings)
    for key, value in stated.items():
        below = settings.get(key)
        merged[key] = {**below, **value} if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return merged


def _changed(path: tuple[str, ...], before: Any, now: Any) -> Iterator[Change]:
    """Each setting that differs, by its path; of a list of objects, such as comparisons, each that came or went."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in dict.fromkeys([*before, *now]):
            yield from _changed((*path, str(key)), before.get(key, ABSENT), now.get(key, ABSENT))
        return
    if json_text(before) == json_text(now):
        return
    if not (_of_objects(before) and _of_objects(now)):
        yield Change(".".join(path), before, now)
        return
    olds, news = (_entries(_without(*pair), path[-1]) for pair in ((before, now), (now, before)))
    if not olds and not news:
        yield Change(".".join(path), before, now)  # in another order
    for name in dict.fromkeys([*olds, *news]):
        both = name in olds and name in news
        yield from _changed((*path, name) if both else path, olds.get(name, ABSENT), news.get(name, ABSENT))


def _of_objects(value: Any) -> bool:
    return value is ABSENT or (isinstance(value, list) and all(isinstance(entry, Mapping) for entry in value))


def _without(listed: Any, other: Any) -> list[Content]:
    """The objects of a list that another one does not have."""
    return [] if listed is ABSENT else [entry for entry in listed if other is ABSENT or entry not in other]


def _entries(listed: Sequence[Content], of: str) -> dict[str, Content]:
    """Objects by what identifies them in such a list; where that is not unique, by all they hold."""
    names = [", ".join(str(entry[key]) for key in _IDENTITY.get(of, ()) if entry.get(key)) for entry in listed]
    return {
        name if name and names.count(name) == 1 else f"{name} {json_text(entry)}": entry
        for name, entry in zip(names, listed, strict=True)
    }


def json_text(value: Any) -> str:
    """A setting in one line; nothing for one that is absent."""
    return "" if value is ABSENT else json.dumps(value, ensure_ascii=False)
