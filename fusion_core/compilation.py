"""Where compiled code is kept: apart for each state of the package's sources.

Numba looks only at the file of the function it compiled, and would go on with code in which a function of another
file, since changed, is still as it was.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
from pathlib import Path

_PACKAGE = Path(__file__).parent


def keep_apart(package: Path = _PACKAGE) -> None:
    """Set Numba's cache folder to one of the sources' own, and remove those of earlier sources.

    Must come before any function of `package`, a folder, is compiled; its sources and those of this package count. A
    folder that the user set (NUMBA_CACHE_DIR) is left alone.
    """
    import numba

    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    sources = sorted({*_PACKAGE.glob("*.py"), *package.glob("*.py")})
    stamps = [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in sources]
    digest = hashlib.sha256(repr((numba.__version__, stamps)).encode()).hexdigest()[:16]
    folder = package / "__pycache__"
    for earlier in folder.glob("compiled-*"):
        if earlier.name != f"compiled-{digest}":
            shutil.rmtree(earlier, ignore_errors=True)
    with contextlib.suppress(OSError):  # a package that cannot be written to is compiled anew each time
        (folder / f"compiled-{digest}").mkdir(parents=True, exist_ok=True)
        numba.config.CACHE_DIR = str(folder / f"compiled-{digest}")  # type: ignore[attr-defined]
