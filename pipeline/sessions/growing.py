"""Arrays that grow at their end, so that what has been read of a log is held once, at the size of its numbers."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

Array = np.ndarray[Any, Any]

SPILLED = 2**18  # rows that wait in memory to be written
_MORE = 16  # a full array grows by one in so many rows


class Growing:
    """Rows (n,) or (n, width) of one type. The system moves the memory's pages as it grows; nothing is held twice."""

    def __init__(self, kind: npt.DTypeLike, *width: int) -> None:
        self._rows: Array = np.empty((0, *width), kind)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, rows: Array) -> None:
        """Copy rows to the end."""
        begin, end = self._count, self._count + len(rows)
        if end > len(self._rows):
            self._resize(end if begin == 0 else max(end, begin + begin // _MORE))
        self._rows[begin:end] = rows
        self._count = end

    def whole(self) -> Array:
        """All rows so far. Nothing may be added to them any more."""
        self._resize(self._count)
        return self._rows

    def _resize(self, count: int) -> None:
        # Nobody else has seen the array yet, which is what the check of references would find out.
        self._rows.resize((count, *self._rows.shape[1:]), refcheck=False)


class Spilling(Growing):
    """The same in a file without a name in `folder`, once there are many; None: always in memory.

    `whole` then is mapped from the file, and takes memory where it is looked at, until `by_parts.let_go`.
    """

    def __init__(self, folder: Path | None, kind: npt.DTypeLike, *width: int) -> None:
        super().__init__(kind, *width)
        self._folder = folder
        self._file: IO[bytes] | None = None
        self._written = 0

    def __len__(self) -> int:
        return self._written + super().__len__()

    def add(self, rows: Array) -> None:
        """Copy rows to the end."""
        super().add(rows)
        if self._folder is not None and super().__len__() > SPILLED:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._folder)  # noqa: SIM115 - `whole` closes it
            self._file.write(self._rows[: self._count].data)
            self._written, self._count = len(self), 0

    def whole(self) -> Array:
        """All rows so far. Nothing may be added to them any more."""
        if self._file is None:
            return super().whole()
        count = len(self)
        with self._file as file:
            file.write(self._rows[: self._count].data)
            file.flush()
            shape = (count, *self._rows.shape[1:])
            self._rows = self._rows[:0]
            return np.memmap(file, self._rows.dtype, "r", shape=shape)


class MostlyAlike:
    """A column (n,) of which most often all values are the same, as the names of frames are: until then it is one."""

    def __init__(self, kind: npt.DTypeLike) -> None:
        self._kind = kind
        self._first: Array = np.zeros(0, kind)
        self._count = 0
        self._rows: Growing | None = None

    def add(self, values: Array) -> None:
        """Add values to the end."""
        if not self._count:
            self._first = values[:1].astype(self._kind)
        if self._rows is None and len(values) and (values != self._first[0]).any():
            self._rows = Growing(self._kind)
            self._rows.add(np.repeat(self._first, self._count))
        if self._rows is not None:
            self._rows.add(values)
        self._count += len(values)

    def whole(self) -> Array:
        """All values; read-only where they are alike, as all are one in memory."""
        if self._rows is not None:
            return self._rows.whole()
        return np.broadcast_to(self._first[0], (self._count,)) if self._count else self._first
