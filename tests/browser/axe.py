"""axe-core, the accessibility checker: one pinned file of the npm registry, kept outside the repository."""

from __future__ import annotations

import base64
import hashlib
import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path

from tests.conftest import CLONE

_NAME = "axe-core-4.14.1"
_SHA512 = "FHfa+lmNjQZfJz1q8wKqIDwC6DExcHt/pkjNQb09a3NPjCKg2rhu5qb2S4r76ASyFNNtuFooJpZe37OgudVGtQ=="
_KEPT = CLONE / ".venv" / f"{_NAME}.js"


def source() -> str | None:
    """The script; None, and a line that says why, where it cannot be had."""
    if not _KEPT.is_file():
        fault = _fetch()
        if fault:
            print(f"  axe-core is left out: {fault}")
            return None
    return _KEPT.read_text(encoding="utf-8")


def _fetch() -> str | None:
    """Bring the file; what went wrong."""
    npm = shutil.which("npm")
    if npm is None:
        return "there is no npm here; on Debian and Ubuntu: sudo apt install npm"
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / f"{_NAME}.tgz"
        words = [npm, "pack", "--silent", "--ignore-scripts", "--pack-destination", folder, _NAME.replace("e-4", "e@4")]
        ran = subprocess.run(words, capture_output=True, text=True, cwd=folder, timeout=120, check=False)
        if ran.returncode or not package.is_file():
            return f"npm could not fetch it: {ran.stderr.strip().splitlines()[-1:] or ran.returncode}"
        if base64.b64encode(hashlib.sha512(package.read_bytes()).digest()).decode() != _SHA512:
            return "what npm fetched is not the pinned file"
        with tarfile.open(package) as archive:
            member = archive.extractfile("package/axe.min.js")
            assert member is not None
            _KEPT.write_bytes(member.read())
    return None
