"""The names of measures and of ways to adjust p values, from their records."""

from __future__ import annotations

from pipeline.study.measures import MEASURES, measure
from pipeline.study.statistical_tests import ADJUSTMENTS, TUKEY


def measure_label(name: str) -> str:
    """`Selection error, MSE (px²)`, `NASA-TLX: mental`."""
    return measure(name).full_label


def short_label(name: str) -> str:
    """A measure's name without its unit or questionnaire: `Mental`."""
    label = measure(name).label
    return label.partition(": ")[2].capitalize() if measure(name).questionnaire else label


def measure_as_subject(name: str) -> str:
    """A measure as the subject of a sentence: `Selection error (MSE)`, `NASA-TLX mental`."""
    label = measure(name).label
    if measure(name).questionnaire:
        return label.replace(": ", " ", 1)
    head, comma, kind = label.partition(", ")
    return f"{head} ({kind})" if comma and name in MEASURES else label


def was(label: str) -> str:
    """The verb after a measure: `time was`, `errors were`."""
    last = label.partition(" per ")[0].rpartition(" ")[2].lower()
    return "were" if last.endswith("s") and not last.endswith(("ss", "us", "is", "bias")) else "was"


def unit_of(name: str) -> str:
    """A measure's unit; empty for a measure without one."""
    return measure(name).unit


def adjustment_label(method: str) -> str:
    """A way to adjust p values by its authors' names: `Holm`, `Benjamini-Hochberg`."""
    return "Tukey-Kramer" if method == TUKEY else ADJUSTMENTS[method].label
