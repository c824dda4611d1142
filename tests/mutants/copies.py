"""Copies of the clone in which the tests run, so that its own files are never touched."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from tests.conftest import CLONE
from tests.mutants.mutant import Mutant, place

PACKAGES = ("fusion_core", "pipeline")
KILLED, TIMED_OUT, SURVIVED, BROKEN = "killed", "timed out", "survived", "broken"
_LONGEST_S = 900.0
_FAILED, _PASSED = 1, 0  # pytest's exit codes


@dataclass(frozen=True)
class Copy:
    """A folder with all files of the clone."""

    folder: Path

    def outcome_of(self, mutant: Mutant) -> str:
        """Put the mutant in, run its tests until one fails, and take it out again."""
        path = place(mutant, sources_in(self.folder))
        assert isinstance(path, Path)
        original, times = path.read_bytes(), path.stat()
        path.write_text(original.decode().replace(mutant.old, mutant.new), encoding="utf-8")
        try:
            code, _ = self._run(mutant.tests)
        finally:
            path.write_bytes(original)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        return {_FAILED: KILLED, _PASSED: SURVIVED, None: TIMED_OUT}.get(code, BROKEN)

    def failure_of(self, tests: Iterable[ModuleType]) -> str | None:
        """What pytest prints where the tests do not all pass; None where they do."""
        code, printed = self._run(tests, longest_s=None)
        return None if code == _PASSED else printed

    def _run(self, tests: Iterable[ModuleType], longest_s: float | None = _LONGEST_S) -> tuple[int | None, str]:
        """Pytest's exit code and output; None for a code where it takes too long, as an endless loop does."""
        paths = sorted(str(Path(str(test.__file__)).relative_to(CLONE)) for test in tests)
        words = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider"]
        # Compiled code goes into a folder from which that of the unchanged sources is not removed.
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.folder),
            "NUMBA_CACHE_DIR": str(self.folder / "compiled"),
        }
        try:
            ran = subprocess.run(
                [*words, "--hypothesis-seed=0", *paths],
                cwd=self.folder,
                env=environment,
                capture_output=True,
                text=True,
                timeout=longest_s,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return None, ""
        return ran.returncode, ran.stdout + ran.stderr


def copy_to(folder: Path) -> Copy:
    """Every file of the clone that Git tracks or would."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "-z"],  # noqa: S607
        cwd=CLONE,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in filter(None, listed.stdout.split("\0")):
        if (CLONE / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(CLONE / name, folder / name)
    return Copy(folder)


def sources_in(folder: Path) -> dict[Path, str]:
    """The text of every Python file in the packages."""
    paths = sorted(path for package in PACKAGES for path in (folder / package).rglob("*.py"))
    return {path: path.read_text(encoding="utf-8") for path in paths}
