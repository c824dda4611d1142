"""The digest of a stage's code: its module, all modules it imports, data files beside them, and libraries' versions.

It is part of every key of the cache (pipeline.engine.cache), so an edit makes exactly those stages compute again whose
code can reach it. Imports are found in a module's text, wherever they are in it, without running it; so are modules
named in a string, such as a stage's function. Which files a module opens cannot be found that way. So every file
counts that is not Python and is beside a module that is reached, or in a folder below that has no modules: templates,
scripts, styles. They are found rather than listed, so that none can be forgotten.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

from pipeline.engine.cache import digest_of, file_digest

_ROOT = Path(__file__).resolve().parents[2]
_OURS = ("pipeline", "fusion_core")
_IMPORT = re.compile(
    r"""
    (?: ^ | [;:] ) [ \t]* (?:
        from [\s\\]+ ([^\W\d][\w.]*) [\s\\]+ import\b \s* ( \( (?: [^)#] | \#.* )* | (?: [^\n\\;#] | \\\n )+ )
        | import\b ( (?: [^\n\\;#] | \\\n )+ )
    )
    | ["'}] ((?:OURS) (?:\.\w+)+)  # the beginning of a string, or of what follows a value in it
    """.replace("OURS", "|".join(_OURS)),
    re.MULTILINE | re.VERBOSE,
)
_NAME = re.compile(r"(?:^|,)[\s\\(]*([^\W\d][\w.]*|\*)")
_COMMENT = re.compile(r"#.*")
_DISTRIBUTIONS = {
    "yaml": "PyYAML",
    "mcap_protobuf": "mcap-protobuf-support",
    "google": "protobuf",
}


@cache
def code_digest(module: str) -> str:
    """The digest of a module of the running Steadyhand."""
    return _running().digest(module)


@cache
def _running() -> Code:
    return Code(_ROOT)


class Code:
    """Our packages as they are now, for the digests of several modules: listed once, and each file is read once.

    `root` is the folder that holds them: a clone, or where Python keeps installed packages.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        files = list(_files(root))
        self._modules = _modules(file for file in files if file.endswith(".py"))
        self._beside = _beside(files)
        self._digests: dict[str, str] = {}
        self._imports: dict[str, tuple[str, ...]] = {}

    def digest(self, module: str) -> str:
        """The digest of a module, all of ours that it reaches, the files beside them, and versions of libraries."""
        read: set[str] = set()
        libraries: set[str] = set()
        followed: set[str] = set()
        pending = [module]
        while pending:
            reached_module = pending.pop()
            # Importing a module runs the __init__ of its packages; what else these import is not used by the module.
            read.update(self._modules[package] for package in _parents(reached_module) if package in self._modules)
            file = self._modules.get(reached_module)
            if file is None or file in followed:
                continue
            followed.add(file)
            for reached in self._imports_of(file):
                if reached.split(".")[0] in _OURS:
                    pending.append(reached)
                else:
                    libraries.add(reached.split(".")[0])
        read |= followed
        for folder in {_folder(file) for file in followed}:
            read.update(self._beside.get(folder, ()))
        sources = {file: self._digest_of(file) for file in read}
        return digest_of([sources, versions(libraries), sys.version_info[:2]])

    def _digest_of(self, file: str) -> str:
        if file not in self._digests:
            self._digests[file] = file_digest(self._root / file)
        return self._digests[file]

    def _imports_of(self, file: str) -> tuple[str, ...]:
        """The modules that a file imports or names; the file's bytes are those of its digest."""
        if file not in self._imports:
            source = (self._root / file).read_bytes()
            self._digests[file] = hashlib.sha256(source).hexdigest()
            self._imports[file] = tuple(self._reached(source.decode("utf-8", "replace")))
        return self._imports[file]

    def _reached(self, source: str) -> Iterator[str]:
        for module, name in imports(source):
            whole = f"{module}.{name}"
            yield whole if whole in self._modules else module


def _files(root: Path) -> Iterator[str]:
    """The paths of all files of our packages, as written below the root; without what belongs to no version."""
    for package in _OURS:
        for folder, folders, files in os.walk(root / package):
            folders[:] = [name for name in folders if not _is_dropping(name)]
            below = Path(folder).relative_to(root).as_posix()
            yield from (f"{below}/{name}" for name in files if not _is_dropping(name))


def _is_dropping(name: str) -> bool:
    """Whether Python, an editor or a desktop left a file or folder of this name: it belongs to no version of the code.

    A name that is not known here counts as data. That costs a computation; to pass over data would cost a right result.
    """
    return name == "__pycache__" or name.startswith((".", "#")) or name.endswith(("~", ".pyc"))


def _modules(files: Iterable[str]) -> dict[str, str]:
    """The file of each module, by its dotted name."""
    return {file.removesuffix(".py").removesuffix("/__init__").replace("/", "."): file for file in files}


def _beside(files: Sequence[str]) -> dict[str, list[str]]:
    """The files that are no Python, by the nearest folder at or above them that has modules."""
    with_modules = {_folder(file) for file in files if file.endswith(".py")}
    beside: dict[str, list[str]] = {}
    for file in files:
        if not file.endswith(".py"):
            folder = _folder(file)
            while folder and folder not in with_modules:
                folder = _folder(folder)
            beside.setdefault(folder, []).append(file)
    return beside


def _folder(path: str) -> str:
    return path.rpartition("/")[0]


def _parents(module: str) -> list[str]:
    parts = module.split(".")
    return [".".join(parts[:size]) for size in range(1, len(parts))]


def imports(source: str) -> Iterator[tuple[str, str]]:
    """What a source imports anywhere, as (module, name), and modules named in strings, to be imported when needed.

    `import a.b` gives ("a.b", ""). Text that only reads like an import, such as an example in a docstring, is taken for
    one: that costs a computation, and Python's own parser would take ten times as long, each time a command starts.
    """
    for found in _IMPORT.finditer(source):
        module, names, plain, named = found.groups()
        if named:
            yield named, ""
        else:
            for name in _NAME.findall(_COMMENT.sub("", plain or names)):
                yield (name, "") if plain else (module, name)


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
