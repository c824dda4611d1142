"""The digest of a stage's code: its module, all modules it imports, data files beside them, and libraries' versions.

It is part of every key of the cache (pipeline.engine.cache), so an edit makes exactly those stages compute again whose
code can reach it. Imports are found by parsing a module, wherever they are in it, without running it; so are modules
named in a string, such as a stage's function. Which files a module opens cannot be found that way. So every file counts
that is not Python and is beside a module that is reached, or in a folder below that has no modules: templates, scripts,
styles. They are found rather than listed, so that none can be forgotten.
"""

from __future__ import annotations

import ast
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

from pipeline.engine.cache import digest_of, file_digest

_ROOT = Path(__file__).resolve().parents[2]
_OURS = ("pipeline", "fusion_core")
_MODULE_TEXT = re.compile(rf"(?:{'|'.join(_OURS)})(?:\.\w+)+")
_DISTRIBUTIONS = {
    "yaml": "PyYAML",
    "mcap_protobuf": "mcap-protobuf-support",
    "google": "protobuf",
}


@cache
def code_digest(module: str) -> str:
    """The digest of a module of the running Steadyhand."""
    return code_digest_in(_ROOT, module)


def code_digest_in(root: Path, module: str) -> str:
    """The digest of a module, of all our modules it reaches, the files beside them, and the libraries they import.

    `root` is the folder that holds our packages: a clone, or where Python keeps installed packages.
    """
    sources: dict[str, str] = {}
    libraries: set[str] = set()
    followed: set[Path] = set()
    pending = [module]
    while pending:
        reached_module = pending.pop()
        # Importing a module runs the __init__ of its packages; what else these import is not used by the module.
        for package in _parents(reached_module):
            path = _source(root, package)
            if path is not None:
                sources[path.relative_to(root).as_posix()] = file_digest(path)
        path = _source(root, reached_module)
        if path is None or path in followed:
            continue
        followed.add(path)
        source = path.read_bytes()
        sources[path.relative_to(root).as_posix()] = hashlib.sha256(source).hexdigest()
        for reached in _imports(root, source):
            if reached.split(".")[0] in _OURS:
                pending.append(reached)
            else:
                libraries.add(reached.split(".")[0])
    for folder in {path.parent for path in followed}:
        sources |= {path.relative_to(root).as_posix(): file_digest(path) for path in _data_files(folder)}
    return digest_of([sources, versions(libraries), sys.version_info[:2]])


def _data_files(folder: Path) -> Iterator[Path]:
    """The files in a folder of modules that are no Python, and all files in folders below that hold no modules."""
    for path in folder.iterdir():
        if _is_dropping(path.name):
            continue
        if path.is_file():
            if path.suffix != ".py":
                yield path
        elif path.is_dir() and not any(path.rglob("*.py")):
            yield from _data_files(path)


def _is_dropping(name: str) -> bool:
    """Whether Python, an editor or a desktop left a file or folder of this name: it belongs to no version of the code.

    A name that is not known here counts as data. That costs a computation; to pass over data would cost a right result.
    """
    return name == "__pycache__" or name.startswith((".", "#")) or name.endswith(("~", ".pyc"))


def _source(root: Path, module: str) -> Path | None:
    path = root.joinpath(*module.split("."))
    if path.with_suffix(".py").is_file():
        return path.with_suffix(".py")
    return path / "__init__.py" if (path / "__init__.py").is_file() else None


def _parents(module: str) -> list[str]:
    parts = module.split(".")
    return [".".join(parts[:size]) for size in range(1, len(parts))]


@cache
def _imports(root: Path, source: bytes) -> tuple[str, ...]:
    """The modules that a source imports anywhere, and those that it names in strings, to be imported when needed."""
    reached: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            reached += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            imported = [f"{node.module}.{alias.name}" for alias in node.names]
            modules = [name for name in imported if _source(root, name) is not None]
            reached += modules if len(modules) == len(imported) else [node.module, *modules]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = _MODULE_TEXT.match(node.value)
            if named:
                reached.append(named.group())
    return tuple(reached)


def versions(libraries: Iterable[str]) -> dict[str, str]:
    """The installed version of each library; the standard library's modules have none and are left out."""
    found = {name: _version(name) for name in sorted(set(libraries) - sys.stdlib_module_names)}
    return {_DISTRIBUTIONS.get(name, name): version for name, version in found.items() if version is not None}


@cache
def _version(library: str) -> str | None:
    """It is looked up in the folders of installed packages, a millisecond each time; while a program runs it stays."""
    try:
        return metadata.version(_DISTRIBUTIONS.get(library, library))
    except metadata.PackageNotFoundError:
        return None
