"""`cache`: show, prune and verify what is kept."""

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
    """Print a line a stage: entries, size, and how long ago the least and the most recent were last used."""
    cache = _existing(folder)
    kept = list(items_in(cache))
    order = [stage.name for stage in STAGES]
    stages = sorted({one.stage for one in kept}, key=lambda name: (not name, name not in order, order.index(name)))
    console.say(f"{cache.root}: {_amount(kept)}")
    lines = []
    for stage in stages:
        of_stage = [one for one in kept if one.stage == stage]
        oldest, newest = (_days_ago(pick(one.used_s for one in of_stage)) for pick in (min, max))
        lines.append((stage or "(unfinished)", str(len(of_stage)), _megabytes(of_stage), oldest, newest))
    if lines:
        console.table(("stage", "entries", "MB", "longest unused, days", "last used, days ago"), lines)


def prune_cache(folder: Path | None, older_than_days: float | None, studies: Sequence[Path]) -> None:
    """Remove what was not used for some days, or what the studies as they are now do not use."""
    if older_than_days is None and not studies:
        raise PipelineError("cache prune: say what to remove: --older-than DAYS, --keep-current STUDY, or both")
    cache = _existing(folder)
    keep = set[Path]().union(*(current_entries(study, STAGES, cache) for study in studies)) if studies else None
    unused_s = None if older_than_days is None else older_than_days * _DAY_S
    pruned = prune(cache, time.time(), unused_s, keep)
    console.say(f"Removed {_amount(pruned.removed)}; {_amount(pruned.left)} left.")


def verify_cache(folder: Path | None) -> None:
    """Remove damaged entries, which are computed again when they are needed; exit with 1 where there was one."""
    cache = _existing(folder)

    def say(one: Item, damage: str) -> None:
        console.warn(f"{one.folder.relative_to(cache.root)}: damaged, removed: {damage}")

    verified = verify(cache, say)
    intact = [one for one in verified.left if one.stage]
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
    return f"{sum(one.size_bytes for one in entries) / _MB:.1f}"


def _days_ago(used_s: float) -> str:
    return f"{max(time.time() - used_s, 0.0) / _DAY_S:.1f}"
