"""Variants of a study's estimators: each with its own settings, or with some of them changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from pipeline.errors import PipelineError, did_you_mean
from pipeline.sessions.estimators import build_estimator
from pipeline.study.fields import known
from pipeline.study.settings import Estimator, Estimators, Study
from pipeline.study.yaml_text import parse, read_values, read_yaml


@dataclass(frozen=True)
class Variant:
    """An estimator by name, its `label` (`fusion[window=3]`, None for its own settings), and a study of it alone."""

    estimator: str
    label: str | None
    study: Study


Changes = Mapping[str, Mapping[str, Sequence[Any]]]
"""Values to try, by estimator and key."""


def read_changes(texts: Sequence[str]) -> Changes:
    """The values that options such as `--set fusion.window=3,5` list. Raises PipelineError, naming the option."""
    changes: dict[str, dict[str, Sequence[Any]]] = {}
    for text in texts:
        target, equals, listed = text.partition("=")
        estimator, _, key = (part.strip() for part in target.rpartition("."))
        if not (estimator and key and equals):
            raise PipelineError(f'--set "{text}": needs an estimator, a key and values, such as fusion.window=3,5,10')
        try:
            values = read_values(listed)
        except ValueError as error:
            raise PipelineError(f'--set "{text}": {error}') from None
        if not values:
            raise PipelineError(f'--set "{text}": names no value, such as 3,5,10')
        if any(values.count(value) > 1 for value in values):
            raise PipelineError(f'--set "{text}": a value is listed twice')
        if key in changes.setdefault(estimator, {}):
            raise PipelineError(f'--set "{text}": {estimator}.{key} is set twice; list its values in one --set')
        changes[estimator][key] = values
    return changes


def read_estimators(path: Path | None) -> Mapping[str, Estimator]:
    """The further estimators of a file; empty without a file."""
    return {} if path is None else parse(Estimators, read_yaml(path), path).estimators


def variants(study: Study, changes: Changes, further: Mapping[str, Estimator], file: Path | None) -> list[Variant]:
    """Every estimator with its own settings, followed by all combinations of the values that `changes` lists for it.

    `further` are those of `file`. Raises PipelineError for settings that study.yaml could not have either.
    """
    for name in further:
        if name in study.estimators:
            raise PipelineError(f"{file}: estimators.{name}: study.yaml has an estimator of that name; rename this one")
    settings = {**study.estimators, **further}
    for name, keys in changes.items():
        if name not in settings:
            key, values = next(iter(keys.items()))
            option = f"{name}.{key}={','.join(map(_shown, values))}"
            raise PipelineError(f'--set "{option}": there is no estimator "{name}"{did_you_mean(name, settings)}')
    if not settings:
        raise PipelineError("study.yaml: estimators: there is none to replay; name some, or give --estimators FILE")
    listed = []
    for name, own in settings.items():
        where = f"{file}: estimators.{name}" if name in further else f"study.yaml: estimators.{name}"
        listed.append(_variant(study, name, own, None, where))
        for changed in _combinations(changes.get(name, {})):
            label = f"{name}[{','.join(f'{key}={_shown(value)}' for key, value in changed.items())}]"
            content = {**own.model_dump(exclude_unset=True), **changed}
            listed.append(_variant(study, name, parse(Estimator, content, f"--set: {label}"), label, f"--set: {label}"))
    return listed


def _combinations(keys: Mapping[str, Sequence[Any]]) -> Iterator[dict[str, Any]]:
    """All combinations of the values of several keys; none where there is no key."""
    if keys:
        yield from (dict(zip(keys, values, strict=True)) for values in product(*keys.values()))


def _variant(study: Study, name: str, settings: Estimator, label: str | None, where: str) -> Variant:
    """A variant, once it is certain that its estimator can be built."""
    alone = study.model_copy(update={"estimators": {name: settings}})
    try:
        for stream in settings.use or ():
            known("use", stream, study.sensor_streams)
    except ValueError as error:
        raise PipelineError(f"{where}: {error}") from None
    build_estimator(alone, name, where)
    return Variant(name, label, alone)


def _shown(value: Any) -> str:
    """A value as it stands on the command line."""
    return f"[{','.join(map(_shown, value))}]" if isinstance(value, list) else str(value)
