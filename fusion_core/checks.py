"""Checks of parameters, whose messages name the parameter that is wrong."""

from __future__ import annotations

import numpy as np


def require_positive(**values: float) -> None:
    """Raise ValueError, naming the parameter, unless every value is finite and above zero."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a number above 0, got {value}")


def require_not_negative(**values: float) -> None:
    """Raise ValueError, naming the parameter, unless every value is finite and zero or more."""
    for name, value in values.items():
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be a number, 0 or more, got {value}")


def require_one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    """Raise ValueError, naming the parameter, unless its value is one of `known`."""
    if value not in known:
        raise ValueError(f"{name} must be {' or '.join(known)}, got {value!r}")
