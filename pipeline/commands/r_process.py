"""Runs a script in R: files in, one file out, with a time limit."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class RunInR:
    """What the script wrote, completely or up to where it stopped, and why it stopped if it did."""

    written: str
    failure: str | None = None


def executable() -> str | None:
    """The path of Rscript; None where R is not installed."""
    return shutil.which("Rscript")


def version(rscript: str) -> str:
    """`R 4.2.2`."""
    done = subprocess.run([rscript, "--version"], capture_output=True, text=True, check=False, timeout=60)
    words = (done.stdout + done.stderr).split()
    return next((f"R {word}" for word in words if word[:1].isdigit()), "R")


def run(rscript: str, script: Path, files: Mapping[str, str], answers: str, timeout_s: float) -> RunInR:
    """Run a script in a temporary folder that holds `files`, and read the file `answers` that it writes there."""
    with tempfile.TemporaryDirectory(prefix="steadyhand-r-") as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        command = [rscript, "--no-save", "--no-restore", "--no-init-file", str(script.resolve())]
        failure = None
        try:
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=timeout_s)
            if done.returncode:
                lines = done.stderr.strip().splitlines()
                failure = f"R stopped with exit code {done.returncode}" + (f": {lines[-1]}" if lines else "")
        except subprocess.TimeoutExpired:
            failure = f"R took longer than {timeout_s:g} s"
        written = Path(folder) / answers
        return RunInR(written.read_text(encoding="utf-8") if written.is_file() else "", failure)
