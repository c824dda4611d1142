"""Which single mistake makes gyroscope and orientation describe different turnings: each is undone in turn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.turns import rotation_vector
from pipeline.statistics.arrays import FloatArray

_ALIKE = 0.6
_DEGREES = (25.0, 130.0)


def turning_cause(before: FloatArray, after: FloatArray, span_s: FloatArray, measured: FloatArray) -> str:
    """The mistake without which both turn alike, in words; "" if none does.

    `before` and `after` (k, 4) are the orientations at the ends of spans (k,), `measured` (k, 3) the gyroscope's mean.
    """
    best, likely = _ALIKE, ""
    for words, (begin, end), rate in _tried(before, after, measured):
        turned = rotation_vector(begin, end) / span_s[:, None]
        power = float(np.sqrt(np.sum(turned**2) * np.sum(rate**2)))
        alike = float(np.sum(turned * rate)) / power if power > 0 else 0.0
        if alike > best:
            ratio = float(np.sum(turned * rate) / np.sum(turned**2))
            degrees = _DEGREES[0] < ratio < _DEGREES[1]
            best, likely = alike, words + ("; and it is in degrees per second, multiply by π/180" if degrees else "")
    return likely


def _tried(
    before: FloatArray, after: FloatArray, measured: FloatArray
) -> Iterator[tuple[str, tuple[FloatArray, FloatArray], FloatArray]]:
    """Each mistake undone: words, orientations and angular velocities."""
    given = before, after
    yield "the gyroscope's sign is flipped; change the sign of all three axes when logging", given, -measured
    first_is_w = before[:, [1, 2, 3, 0]], after[:, [1, 2, 3, 0]]
    yield "the orientation is in another order (w first); log x, y, z, w", first_is_w, measured
    conjugate = np.array([-1.0, -1.0, -1.0, 1.0])
    yield (
        "the orientation is inverted (the conjugate, from tracker to body); log it from body to tracker frame",
        (before * conjugate, after * conjugate),
        measured,
    )
    for order in ((2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0), (2, 0, 1)):
        names = ", ".join("xyz"[axis] for axis in order)
        yield (
            f"the gyroscope's axes are exchanged, in the order {names} instead of x, y, z; reorder them",
            given,
            measured[:, np.argsort(order)],
        )
    for signs in ((-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)):
        wrong = " and ".join(name for name, sign in zip("xyz", signs, strict=True) if sign < 0)
        yield (
            f"the gyroscope's {wrong} has the other sign (a left-handed frame or another mounting); change it",
            given,
            measured * np.array(signs),
        )
