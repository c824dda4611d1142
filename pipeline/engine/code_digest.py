"""The digest of a stage's code: of its module, of all it reaches, and of the libraries it imports."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable
from functools import cache
from importlib import metadata
from pathlib import Path

from pipeline.engine.cache import digest_of, file_digest

_ROOT = Path(__file__).resolve().parents[2]


_OURS = ("pipeline", "fusion_core")


_MODULE_TEXT = re.compile(rf"(?:{'|'.join(_OURS)})(?:\.\w+)+")


_DISTRIBUTIONS = {
    "yaml": "PyYAML",
    "mcap_ros2": "mcap-ros2-support",
    "mcap_protobuf": "mcap-protobuf-support",
    "google": "protobuf",
}


_DATA_FILES = (".bib", ".css", ".jinja", ".typ")


@cache
def code_digest(module: str) -> str:
    """Digest of a module, of all our modules it reaches, their data files, and the libraries they import."""
    sources: dict[str, str] = {}
    libraries: set[str] = set()
    followed: set[Path] = set()
    pending = [module]
    while pending:
        reached_module = pending.pop()
        # A package is run on the way to its modules, but what else it imports for its users is not used here.
        for package in map(_source, _parents(reached_module)):
            if package is not None:
                sources[package.relative_to(_ROOT).as_posix()] = file_digest(package)
        path = _source(reached_module)
        if path is None or path in followed:
            continue
        followed.add(path)
        sources[path.relative_to(_ROOT).as_posix()] = file_digest(path)
        for beside in sorted(path.parent.iterdir()):
            if beside.is_file() and beside.suffix in _DATA_FILES:
                sources[beside.relative_to(_ROOT).as_posix()] = file_digest(beside)
        for reached in _imports(path):
            if reached.split(".")[0] in _OURS:
                pending.append(reached)
            else:
                libraries.add(reached.split(".")[0])
    return digest_of([sources, versions(libraries), sys.version_info[:2]])


def _source(module: str) -> Path | None:
    path = _ROOT.joinpath(*module.split("."))
    if path.with_suffix(".py").is_file():
        return path.with_suffix(".py")
    return path / "__init__.py" if (path / "__init__.py").is_file() else None


def _parents(module: str) -> list[str]:
    parts = module.split(".")
    return [".".join(parts[:size]) for size in range(1, len(parts))]


@cache
def _imports(path: Path) -> tuple[str, ...]:
    """The modules a source imports, wherever it does, and those it names as text to import when needed."""
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            found += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules = [name for alias in node.names if _source(name := f"{node.module}.{alias.name}") is not None]
            found += modules if len(modules) == len(node.names) else [node.module, *modules]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = _MODULE_TEXT.match(node.value)
            if named:
                found.append(named.group())
    return tuple(found)


def versions(libraries: Iterable[str]) -> dict[str, str]:
    """The installed version of each library that has one (those of Python itself have none)."""
    found = {}
    for library in sorted(set(libraries) - sys.stdlib_module_names):
        try:
            name = _DISTRIBUTIONS.get(library, library)
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
