"""`cache`: show, prune and verify the cached entries."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

from pipeline.commands import console
from pipeline.engine.cache import Cache
from pipeline.engine.folders import cache_in
from pipeline.engine.housekeeping import Item, items_in, prune, verify
from pipeline.engine.run import current_entries
from pipeline.errors import PipelineError
from pipeline.stages import STAGES

_DAY_S = 24 * 3600.0
_MB = 1e6
DAMAGED = 1  # the exit code


def show(folder: Path | None) -> None:
    """Print one line per stage: entries, size, and how long ago the first and the last of them were used."""
    cache = _existing(folder)
    items = list(items_in(cache))
    order = [stage.name for stage in STAGES]
    place = {name: at for at, name in enumerate(order)}  # replay and the unfinished have none: they come last
    stages = sorted({item.stage for item in items}, key=lambda name: (not name, place.get(name, len(order)), name))
    console.say(f"{cache.root}: {_amount(items)}")
    lines = []
    for stage in stages:
        of_stage = [item for item in items if item.stage == stage]
        oldest, newest = (_days_ago(pick(item.used_s for item in of_stage)) for pick in (min, max))
        lines.append((stage or "(unfinished)", str(len(of_stage)), _megabytes(of_stage), oldest, newest))
    if lines:
        console.table(("stage", "entries", "MB", "longest unused, days", "last used, days ago"), lines)


def prune_cache(folder: Path | None, older_than_days: float | None, studies: Sequence[Path]) -> None:
    """Remove entries not used for some days, and entries that the given studies, as they are now, do not use."""
    if older_than_days is None and not studies:
        raise PipelineError("cache prune: say what to remove: --older-than DAYS, --keep-current STUDY, or both")
    cache = _existing(folder)
    keep = set[Path]().union(*(current_entries(study, STAGES, cache) for study in studies)) if studies else None
    unused_s = None if older_than_days is None else older_than_days * _DAY_S
    pruned = prune(cache, time.time(), unused_s, keep)
    console.say(f"Removed {_amount(pruned.removed)}; {_amount(pruned.left)} left.")


def verify_cache(folder: Path | None) -> None:
    """Remove damaged entries, which are computed again when they are needed; exit with 1 if there were any."""
    cache = _existing(folder)

    def say(item: Item, damage: str) -> None:
        console.warn(f"{item.folder.relative_to(cache.root)}: damaged, removed: {damage}")

    verified = verify(cache, say)
    intact = [item for item in verified.left if item.stage]
    console.say(f"{_amount(intact)} intact, {len(verified.removed)} damaged and removed.")
    sys.exit(DAMAGED if verified.removed else 0)


def _existing(folder: Path | None) -> Cache:
    cache = cache_in(folder)
    if not cache.root.is_dir():
        raise PipelineError(f"{cache.root}: there is no cache here; name its folder with --cache")
    return cache


def _amount(entries: Sequence[Item]) -> str:
    return f"{len(entries)} {'entry' if len(entries) == 1 else 'entries'} ({_megabytes(entries)} MB)"


def _megabytes(entries: Sequence[Item]) -> str:
    return f"{sum(entry.size_bytes for entry in entries) / _MB:.1f}"


def _days_ago(used_s: float) -> str:
    return f"{max(time.time() - used_s, 0.0) / _DAY_S:.1f}"
