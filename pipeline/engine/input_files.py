"""Whether a study's own files stayed as they were while a stage read them.

A key names the digests of the files that its stage reads, and these were computed before the stage began. A file that
is written in between, such as a log that is still being recorded, would give an entry under the key of other bytes. It
would be taken for theirs as soon as the file is back to what it was. So the files are compared once more after the
stage has read them, and an entry of files that changed is not kept.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.engine.cache import file_digest
from pipeline.engine.input_digests import Stamp, stamp
from pipeline.engine.stage import Stage, Work
from pipeline.errors import PipelineError

CHANGED = "changed while it was read; wait until nothing writes to it any more, and run the command again"
"""What is said of a file, or of a session's log, that changed while it was read."""


class InputChangedError(PipelineError):
    """A file of the study changed while it was read, so that the result belongs to no digest."""


class InputFiles:
    """The files of the study that a stage is about to read, as they are now."""

    def __init__(self, stage: Stage, work: Work) -> None:
        # A stage that only lists the digests of all files reads none of them.
        self._digests = {} if stage.names_inputs else dict(work.inputs)
        absent = [name for name in stage.fixed_files if name not in self._digests]
        self._folder = work.folder
        self._stamps = {name: _stamp(work.folder / name) for name in (*self._digests, *absent)}

    def changed(self) -> Path | None:
        """The first file that has changed since, or that does not hold the bytes of its digest; None if there is none.

        The time of the last change is compared too: a file may have been another for a moment.
        """
        for name, before in self._stamps.items():
            path, digest = self._folder / name, self._digests.get(name)
            if _stamp(path) != before or (before is None) != (digest is None):
                return path
            if digest is not None and file_digest(path) != digest:
                return path
        return None


def _stamp(path: Path) -> Stamp | None:
    """The file's size, times and inode; None where there is no such file."""
    try:
        return stamp(path)
    except FileNotFoundError:
        return None
