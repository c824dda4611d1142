"""What a cache holds, what of it is whole, and what may go."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.engine.cache import Cache, fault_of, last_used_s

_REMNANT_S = 24 * 3600.0  # a run that still writes is younger


@dataclass(frozen=True)
class Held:
    """A folder of the cache: its stage ("" for what a killed run left), size in bytes, and last use (s since 1970)."""

    folder: Path
    stage: str
    size: int
    used_s: float


@dataclass(frozen=True)
class Gone:
    """How much was removed and how much is left."""

    removed: tuple[Held, ...]
    left: tuple[Held, ...]


def held(cache: Cache) -> Iterator[Held]:
    """Every entry, then every remnant. What another run removes meanwhile is left out."""
    for stage_of, folders in ((lambda f: f.parents[1].name, cache.entries()), (lambda _: "", cache.remnants())):
        for folder in folders:
            try:
                size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
                yield Held(folder, stage_of(folder), size, last_used_s(folder))
            except FileNotFoundError:
                continue


def prune(cache: Cache, now_s: float, unused_s: float | None, keep: Collection[Path] | None) -> Gone:
    """Remove entries that were not used for `unused_s`, and those not in `keep`; both must hold where both are given.

    What killed runs left behind goes after a day.
    """

    def may_go(one: Held) -> bool:
        age_s = now_s - one.used_s
        if not one.stage:
            return age_s >= _REMNANT_S
        return (unused_s is None or age_s >= unused_s) and (keep is None or one.folder not in keep)

    return _remove(cache, may_go)


def verify(cache: Cache, say: Callable[[Held, str], None]) -> Gone:
    """Compare every file of every entry with the digest of what was written; say and remove what is damaged."""

    def damaged(one: Held) -> bool:
        fault = fault_of(one.folder) if one.stage else None
        if fault is not None:
            say(one, fault)
        return fault is not None

    return _remove(cache, damaged)


def _remove(cache: Cache, may_go: Callable[[Held], bool]) -> Gone:
    removed, left = [], []
    for one in held(cache):
        if may_go(one):
            cache.remove(one.folder)
            removed.append(one)
        else:
            left.append(one)
    return Gone(tuple(removed), tuple(left))
