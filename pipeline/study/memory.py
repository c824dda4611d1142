"""Whether a file is too large for the memory at hand, said before the memory is gone: a process that takes it all is
ended by the system without a word."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

_MEMINFO = Path("/proc/meminfo")
_GROUP = Path("/sys/fs/cgroup")  # a container's own limit
_GB = 1e9
SMALL_BYTES = 20_000_000  # for these there is always room


def free_bytes(meminfo: Path = _MEMINFO, group: Path = _GROUP) -> int | None:
    """How much memory processes may still take; None where the system does not say."""
    return min(_stated(meminfo, group), default=None)


def _stated(meminfo: Path, group: Path) -> Iterator[int]:
    try:
        lines = meminfo.read_text(encoding="ascii").splitlines()
        yield from (int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
        most = (group / "memory.max").read_text(encoding="ascii").strip()
        if most != "max":
            yield max(int(most) - int((group / "memory.current").read_text(encoding="ascii")), 0)
    except (OSError, ValueError):
        return


def shortage(size_bytes: int, needed_per_byte: float, free: int | None, what: str = "it") -> str | None:
    """What is said of a file of this size that takes more memory than there is; None where it does not."""
    needed = size_bytes * needed_per_byte
    if size_bytes < SMALL_BYTES or free is None or needed <= free:
        return None
    return (
        f"refused: {what} is {size_bytes / 1e6:.0f} MB, for which a report needs about {needed / _GB:.1f} GB of memory,"
        f" and {free / _GB:.1f} GB are free; end other programs, take parts of it, or a computer with more memory"
    )
