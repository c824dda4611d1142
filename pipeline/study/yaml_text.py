"""Reads YAML into values and models; errors name the file, the field and the remedy."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError

from pipeline.errors import PipelineError, did_you_mean

_Model = TypeVar("_Model", bound=BaseModel)


class _UniqueKeyLoader(yaml.SafeLoader):
    """A loader for which a key that is given twice in one mapping is an error; PyYAML silently takes the last.

    010, 1_000, 0x10, 1:30 and 2024-01-31 are text, as they are to YAML 1.2 or to whoever wrote them as a name; to YAML
    1.1, which PyYAML reads, they are 8, 1000, 16, 90 and a date.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Refuse aliases: a few lines of them can expand to gigabytes."""
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem="aliases (*name) are not understood; write it out", problem_mark=mark)
        return super().compose_node(parent, index)


def _mapping(loader: _UniqueKeyLoader, node: yaml.MappingNode) -> dict[object, object]:
    seen: set[str] = set()
    for key, _ in node.value:
        if isinstance(key, yaml.ScalarNode):
            if key.value in seen:
                raise yaml.MarkedYAMLError(problem=f'"{key.value}" is given twice', problem_mark=key.start_mark)
            seen.add(key.value)
    return dict(loader.construct_mapping(node, deep=True))


_UniqueKeyLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


_NUMBERS = {
    "tag:yaml.org,2002:int": r"[-+]?(?:0|[1-9][0-9]*)",
    "tag:yaml.org,2002:float": (
        r"[-+]?[0-9]+\.[0-9]*(?:[eE][-+][0-9]+)?|\.[0-9]+(?:[eE][-+][0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
    ),
}
_AS_TEXT = {*_NUMBERS, "tag:yaml.org,2002:timestamp"}
_UniqueKeyLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _AS_TEXT]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _tag, _pattern in _NUMBERS.items():
    _UniqueKeyLoader.add_implicit_resolver(_tag, re.compile(rf"^(?:{_pattern})$"), list("-+.0123456789"))


_PLAIN = re.compile(r"[^\W\d_/][\w /.()*-]*|/[\w/.-]*|[^\W\d][\w/.-]*")


class _TextLoader(_UniqueKeyLoader):
    """A loader that leaves numbers as text, so that 0.050 keeps its last digit."""


_TextLoader.yaml_implicit_resolvers = {}


def read_yaml(path: Path, as_text: bool = False) -> dict[str, Any]:
    """The mapping in a YAML file. Raises PipelineError, naming the file and line, where there is none.

    `as_text` leaves every value as it is written, numbers too.
    """
    loader = _TextLoader if as_text else _UniqueKeyLoader
    try:
        content = yaml.load(path.read_text(encoding="utf-8-sig"), Loader=loader)  # noqa: S506 - safe
    except FileNotFoundError:
        raise PipelineError(f"{path}: there is no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise PipelineError(f"{path}: cannot be read: {error}") from None
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise PipelineError(f"{path}{line}: not valid YAML: {error.problem}") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise PipelineError(f"{path}: not valid YAML: {error}") from None
    try:
        require_whole_characters(path, json.dumps(content, ensure_ascii=False, default=str))
    except TypeError as error:  # a tag such as !!timestamp makes a key of another kind
        raise PipelineError(f"{path}: a key that is no text: {error}") from None
    if not isinstance(content, dict) or not all(isinstance(key, str) for key in content):
        raise PipelineError(f"{path}: holds no settings; it needs lines like `title: My study`")
    return content


def require_whole_characters(path: Path, text: str) -> None:
    """Raise PipelineError where a text from a user's file cannot be written as UTF-8."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        raise PipelineError(
            f"{path}: holds half of a surrogate pair (\\ud800 and the like); write the character"
        ) from None


def read_values(text: str) -> list[Any]:
    """The values of a YAML list without its brackets, such as "3, 5". Raises ValueError where it is not a list."""
    try:
        values = yaml.load(f"[{text}]", Loader=_UniqueKeyLoader)  # noqa: S506 - safe
    except (yaml.YAMLError, RecursionError) as error:
        fault = error.problem if isinstance(error, yaml.MarkedYAMLError) else error
        raise ValueError(f"not a list of values: {fault}") from None
    if not isinstance(values, list) or any(value is None for value in values):
        raise ValueError("a value is missing")
    return values


def flow(value: object) -> str:
    """A value as it stands in study.yaml on one line: `{Teilnehmer: participant, "Ziel X": target_x_mm}`."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{flow(key)}: {flow(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(flow, value)) + "]"
    if isinstance(value, str):
        return value if _is_plain(value) else json.dumps(value, ensure_ascii=False)
    return json.dumps(value)


def _is_plain(text: str) -> bool:
    """Whether a text needs no quotes in YAML, on one line and among brackets."""
    return bool(_PLAIN.fullmatch(text)) and text == text.strip() and _loaded(text) == text


def _loaded(text: str) -> object:
    return yaml.load(text, Loader=_UniqueKeyLoader)  # noqa: S506 - safe


def parse(model: type[_Model], content: dict[str, Any], path: Path | str) -> _Model:
    """Content as a model. Raises one PipelineError with a line for every fault."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise PipelineError("\n".join(f"{path}: {_explained(fault, model)}" for fault in error.errors())) from None


def _explained(fault: Any, model: type[BaseModel]) -> str:
    """One of pydantic's faults in the words of study.yaml."""
    words, there = _followed(model, fault["loc"])
    field = ".".join(str(word) for word in words)
    if fault["type"] == "extra_forbidden":
        return f'unknown key "{field}"{did_you_mean(str(words[-1]), _keys_at(model, fault["loc"][:-1]))}'
    if fault["type"] == "missing":
        return f'"{field}" is missing'
    if fault["type"] in ("union_tag_invalid", "union_tag_not_found"):
        return f'"{field}" needs a kind: {", ".join(str(kind) for each in there for kind in _kinds(each))}'
    message = fault["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    given = fault.get("input")
    shown = f" (found {given!r})" if isinstance(given, str | int | float | bool) else ""
    return f'"{field}": {message}{shown}' if field else f"{message}{shown}"


def _followed(model: type[BaseModel], location: Sequence[object]) -> tuple[list[object], list[Any]]:
    """The keys of a location that the user wrote, and the types that are allowed there.

    Where one of several models is chosen by its `kind`, pydantic adds the kind to the location, after the key. Only the
    model tells a kind from a key, since a key may be any word: a stream can be called "display".
    """
    words: list[object] = []
    there: list[Any] = [model]
    for part in location:
        of_kind = [each for each in there if part in _kinds(each)]
        if of_kind and sum(bool(_kinds(each)) for each in there) > 1:
            there = of_kind
        else:
            words.append(part)
            there = [inner for each in there for inner in _inside(each, part)]
    return words, there


def _keys_at(model: type[BaseModel], location: Sequence[object]) -> list[str]:
    """The known keys at the place of an unknown one."""
    _, there = _followed(model, location)
    models = [each for each in there if _is_model(each)]
    return [field.alias or name for each in models for name, field in each.model_fields.items()]


def _inside(annotation: Any, key: object) -> list[Any]:
    """The types that are allowed under a key of a model or a mapping, or in a list."""
    if _is_model(annotation):
        fields = annotation.model_fields.items()
        return [each for name, field in fields if key in (name, field.alias) for each in _members(field.annotation)]
    return [each for held in get_args(annotation) for each in _members(held)]


def _members(annotation: Any) -> list[Any]:
    """The types of a union; any other type alone."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _members(parts[0])
    return [each for part in parts for each in _members(part)] if origin in (Union, UnionType) else [annotation]


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _kinds(annotation: Any) -> tuple[object, ...]:
    """The values of `kind` that choose this model from a union."""
    field = annotation.model_fields.get("kind") if _is_model(annotation) else None
    return get_args(field.annotation) if field else ()
