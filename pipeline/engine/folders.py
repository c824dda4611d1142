"""Where reports and the cache go unless the user names another place."""

from __future__ import annotations

from pathlib import Path

from pipeline.engine.cache import Cache

CACHE_FOLDER = ".steadyhand-cache"
"""The name of the cache's folder, which stands beside the folder of the reports."""
_CLONE = Path(__file__).resolve().parents[2]


def reports_folder() -> Path:
    """The clone's `reports`, or `./reports` where the program does not run from a clone."""
    return _CLONE / "reports" if (_CLONE / "reports" / "README.md").is_file() else Path.cwd() / "reports"


def cache_in(folder: Path | None) -> Cache:
    """The cache in a folder; without one, the cache beside the reports."""
    return Cache((folder if folder is not None else reports_folder().parent / CACHE_FOLDER).resolve())
