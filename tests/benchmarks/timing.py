"""How long something takes."""

from __future__ import annotations

import time
from collections.abc import Callable

REPEATS = 3


def fastest(function: Callable[[], object], repeats: int = REPEATS) -> float:
    """Seconds of the fastest of some runs: the one the machine disturbed least."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return min(times)
