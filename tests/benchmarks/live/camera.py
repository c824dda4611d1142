"""How long a picture takes from grey values to the marker's position."""

from __future__ import annotations

from time import perf_counter

import cv2
import numpy as np

from pipeline.live.lens import of_field_of_view
from pipeline.live.marker import finder, markers, position_mm
from tests.pipeline.live.frames import FACING, frame

_PICTURES = 200
_LIMIT_MS = 15.0


def camera() -> None:
    """A line for pictures of 1280 × 720."""
    cv2.setNumThreads(1)  # as in the recorder
    size, random, finds = (1280, 720), np.random.default_rng(1), finder()
    lens, spent = of_field_of_view(65.0, size), []
    for _ in range(_PICTURES):
        place = np.array([random.uniform(-550, 550), random.uniform(-280, 280), 1500.0])
        grey = frame(size, lens, {7: (place, FACING)}, random)
        begun = perf_counter()
        for corners in markers(finds, grey).get(7, ()):
            position_mm(grey, corners, 50.0, lens)
        spent.append((perf_counter() - begun) * 1e3)
    middle, late = np.quantile(spent, [0.5, 0.99])
    print(f"Camera, 1280 × 720, a picture: p50 {middle:.1f} ms, p99 {late:.1f} ms (to be at most {_LIMIT_MS:.0f} ms)")
