"""A disk of which one operation fails: the n-th open, read, write, rename, new folder or removal below a folder."""

from __future__ import annotations

import builtins
import io
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest


class FailingDisk:
    """Counts what is done below `root`, and fails the operation number `fails_at` with the errno `error`.

    Files that a library opens in its own machine code are not seen, but for those of Arrow.
    """

    def __init__(self, root: Path) -> None:
        self.root = str(root)
        self.done: list[str] = []
        self.fails_at: int | None = None
        self.error = 0

    def begin(self, fails_at: int | None, error: int = 0) -> None:
        """Count anew."""
        self.done, self.fails_at, self.error = [], fails_at, error

    def step(self, what: str, path: object) -> None:
        """An operation is about to be done."""
        name = os.fspath(path) if isinstance(path, str | os.PathLike) else ""
        if not str(name).startswith(self.root):
            return
        operation = f"{what} {str(name).removeprefix(self.root)}"
        if what in ("read", "write") and self.done and self.done[-1] == operation:
            return  # the first of many
        self.done.append(operation)
        if len(self.done) - 1 == self.fails_at:
            raise OSError(self.error, os.strerror(self.error), str(name))

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Have Python's ways to files go through here."""
        for module in (io, builtins):
            monkeypatch.setattr(module, "open", self._opening(open))
        for name in ("mkdir", "rename", "replace", "utime", "unlink", "rmdir"):
            monkeypatch.setattr(os, name, self._noted(name, getattr(os, name)))
        monkeypatch.setattr(pa, "OSFile", self._noted("write", pa.OSFile))
        monkeypatch.setattr("shutil._USE_CP_SENDFILE", False)  # else the kernel copies, unseen

    def _noted(self, what: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def noted(path: Any, *arguments: Any, **options: Any) -> Any:
            self.step(what, path)
            return function(path, *arguments, **options)

        return noted

    def _opening(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def opened(path: Any, *arguments: Any, **options: Any) -> Any:
            self.step("open", path)
            file = function(path, *arguments, **options)
            return _File(file, self, path) if str(path).startswith(self.root) else file

        return opened


class _File:
    """A file of which reading and writing are noted."""

    def __init__(self, file: Any, disk: FailingDisk, path: object) -> None:
        self._file, self._disk, self._path = file, disk, path

    def read(self, *size: int) -> Any:
        self._disk.step("read", self._path)
        return self._file.read(*size)

    def write(self, content: Any) -> Any:
        self._disk.step("write", self._path)
        return self._file.write(content)

    def __enter__(self) -> _File:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """What was written may fail here only: until now it may have been in memory."""
        writable = not self._file.closed and self._file.writable()
        self._file.close()
        if writable:
            self._disk.step("close", self._path)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._file)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)
