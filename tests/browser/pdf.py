"""`make test-pdf`: the PDFs held against PDF/UA-1 and PDF/A-2a by veraPDF."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from tests.browser.studies import written
from tests.conftest import CLONE


def main() -> int:
    """What the checker says, and its exit code."""
    with tempfile.TemporaryDirectory() as folder:
        return subprocess.call([CLONE / "tools" / "check-pdf", *written(Path(folder), "pdf")])


if __name__ == "__main__":
    sys.exit(main())
