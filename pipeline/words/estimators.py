"""Estimators in words: what each is, and its settings as a reader of a paper would write them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

ESTIMATOR_WORDS: Mapping[str, str] = {
    "raw": "the newest position, held",
    "one_euro": "the 1 € filter",
    "holt": "double exponential smoothing",
    "position_kalman": "a Kalman filter of positions",
    "window_gp": "a Gaussian process over a window of readings",
    "fusion_kalman": "a Kalman filter of positions and accelerations",
    "fusion_adaptive": "an adaptive Kalman filter of positions and accelerations",
}
"""What an estimator is, by its `type` in study.yaml."""


def estimator_in_words(kind: str) -> str:
    """What an estimator of that type is: of one that nobody has found words for, the type's name."""
    return ESTIMATOR_WORDS.get(kind, kind.replace("_", " "))


_UNITS = (
    ("_mm_s2_per_sqrt_s", "mm/s²/√s"),
    ("_mm_per_sqrt_s", "mm/√s"),
    ("_mm2_s5", "mm²/s⁵"),
    ("_mm_s2", "mm/s²"),
    ("_s2", "s⁻²"),
    ("_mm_s", "mm/s"),
    ("_mm2", "mm²"),
    ("_hz", "Hz"),
    ("_deg", "°"),
    ("_mm", "mm"),
    ("_ms", "ms"),
    ("_s", "s"),
)


def setting_in_words(name: str, value: object) -> str:
    """`noise_sd_mm`, 8.0 as `noise SD 8 mm`: a paper's reader knows none of our names, and their ends are units."""
    end, unit = next(((end, unit) for end, unit in _UNITS if name.endswith(end)), ("", ""))
    words = name.removesuffix(end).replace("_", " ").replace(" sd", " SD").replace(" psd", " PSD")
    if value is None:
        return f"no {words}"
    shown = f"{value:g}".replace("e+0", "e") if isinstance(value, float) else str(value).replace("_", " ")
    return f"{words} {shown}{f' {unit}' if unit else ''}"


def settings_in_words(built: Any) -> dict[str, str]:
    """All settings of an estimator, a dataclass, by name, stated or not, in words."""
    return {
        field.name: setting_in_words(field.name, getattr(built, field.name))
        for field in fields(built)
        if field.name != "sensors"
    }
