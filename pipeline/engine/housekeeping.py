"""What a cache holds, what of it is damaged, and what may be removed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.engine.cache import Cache, damage_in, last_used_s

_REMNANT_S = 24 * 3600.0  # a folder that a run is still writing is younger than this


@dataclass(frozen=True)
class Item:
    """A folder of the cache: an entry, with the name of its stage, or a remnant of a killed run, with stage "".

    `size_bytes` is that of its files, `used_s` when it was last used, in seconds since 1970.
    """

    folder: Path
    stage: str
    size_bytes: int
    used_s: float


@dataclass(frozen=True)
class Cleanup:
    """Which folders were removed and which are left."""

    removed: tuple[Item, ...]
    left: tuple[Item, ...]


def items_in(cache: Cache) -> Iterator[Item]:
    """Every entry, then every remnant. A folder that another run removes at the same time is skipped."""
    for stage_of, folders in ((lambda f: f.parents[1].name, cache.entries()), (lambda _: "", cache.remnants())):
        for folder in folders:
            try:
                size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
                yield Item(folder, stage_of(folder), size, last_used_s(folder))
            except FileNotFoundError:
                continue


def prune(cache: Cache, now_s: float, unused_s: float | None, keep: Collection[Path] | None) -> Cleanup:
    """Remove entries that were not used for `unused_s` and are not in `keep`; None sets no such condition.

    Remnants of killed runs are removed after a day.
    """

    def may_go(item: Item) -> bool:
        age_s = now_s - item.used_s
        if not item.stage:
            return age_s >= _REMNANT_S
        return (unused_s is None or age_s >= unused_s) and (keep is None or item.folder not in keep)

    return _remove(cache, may_go)


def verify(cache: Cache, say: Callable[[Item, str], None]) -> Cleanup:
    """Compare every file of every entry with the digest of what was written; report damaged entries and remove them."""

    def damaged(item: Item) -> bool:
        damage = damage_in(item.folder) if item.stage else None
        if damage is not None:
            say(item, damage)
        return damage is not None

    return _remove(cache, damaged)


def _remove(cache: Cache, may_go: Callable[[Item], bool]) -> Cleanup:
    removed, left = [], []
    for item in items_in(cache):
        if may_go(item):
            cache.remove(item.folder)
            removed.append(item)
        else:
            left.append(item)
    return Cleanup(tuple(removed), tuple(left))
