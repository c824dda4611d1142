"""How functions are compiled, and where the machine code is kept between runs.

Numba keeps machine code in a file and checks only the source file of the function that it compiled. But a compiled
function contains copies of all functions it calls and of the constants it uses. If one of these is in another file and
is edited, Numba would silently go on running the old code. So there is one folder of machine code for each state of the
sources: any edit, in any file, leads to another, empty folder, and everything is compiled again.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar, overload

import numba

Function = TypeVar("Function", bound=Callable[..., Any])
_FUSION_CORE = Path(__file__).parent
_numba_settings = Lock()


class Compiler:
    """A decorator: `@compiled`, `@compiled(inner=True)`, or with further options of `numba.njit`.

    It is for the functions of one package, which is a folder. They may call each other and those of fusion_core. They
    must not use functions or constants from anywhere else, since a change there would not be noticed.

    A function that is `inner`, or whose name begins with an underscore, is called by compiled functions alone: no entry
    from Python is made for it, and for none one from C. Entries take a quarter of the time that compiling takes.
    """

    def __init__(self, package: Path) -> None:
        self._package = package

    @overload
    def __call__(self, function: Function) -> Function: ...
    @overload
    def __call__(self, *, inner: bool = False, **options: Any) -> Callable[[Function], Function]: ...
    def __call__(self, function: Function | None = None, *, inner: bool = False, **options: Any) -> Any:
        if function is None:
            return lambda wanted: self._compile(wanted, inner, options)
        return self._compile(function, inner, options)

    def _compile(self, function: Callable[..., Any], inner: bool, options: dict[str, Any]) -> Any:
        inner = inner or function.__name__.startswith("_")
        options = {"no_cfunc_wrapper": True, "no_cpython_wrapper": inner, **options}
        folder = code_folder(self._package, numba.config.CACHE_DIR)  # type: ignore[attr-defined]
        if folder is None:
            return numba.njit(**options)(function)
        # Numba asks for the folder only while it decorates. Afterwards the setting is the user's again.
        with _numba_settings:
            before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
            numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
            try:
                return numba.njit(cache=True, **options)(function)
            finally:
                numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


compiled = Compiler(_FUSION_CORE)
"""For the functions of fusion_core."""


@cache
def code_folder(package: Path, users_folder: str = "") -> Path | None:
    """Where machine code of a package's sources as they are now is kept; None where nothing can be written.

    Beside the sources, where folders of earlier sources are removed, or in `users_folder` (NUMBA_CACHE_DIR) if there is
    one. Without a folder, as in an installation that is read-only, each process compiles for itself, in memory.
    """
    name = f"compiled-{sources_digest(package)}"
    if users_folder:
        folder = Path(users_folder) / name
    else:
        folder = package / "__pycache__" / name
        for earlier in folder.parent.glob("compiled-*"):
            if earlier.name != name:
                shutil.rmtree(earlier, ignore_errors=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):  # a folder may exist and still not be writable
            return folder
    except OSError:
        return None


def sources_digest(package: Path) -> str:
    """A digest of the contents of every .py file in the package and in fusion_core, and of Numba's version."""
    digest = hashlib.sha256(numba.__version__.encode())
    for root in dict.fromkeys((_FUSION_CORE, package)):
        for source in sorted(root.rglob("*.py")):
            contents = source.read_bytes()
            digest.update(f"\0{source.relative_to(root).as_posix()}\0{len(contents)}\0".encode())
            digest.update(contents)
    return digest.hexdigest()[:16]
