"""What parameters must be, each with the message that names the one that is not."""

from __future__ import annotations

import numpy as np


def require_positive(**values: float) -> None:
    """ValueError that names the parameter unless every value is finite and above zero."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a number above 0, got {value}")


def require_not_negative(**values: float) -> None:
    """ValueError that names the parameter unless every value is finite and zero or more."""
    for name, value in values.items():
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be a number, 0 or more, got {value}")


def require_one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    """ValueError that names the parameter unless its value is one of those known."""
    if value not in known:
        raise ValueError(f"{name} must be {' or '.join(known)}, got {value!r}")
