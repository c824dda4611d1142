"""The records of measures and questionnaires: label, unit, scale, which direction is better, and source.

One record per measure. Labels, the order of tables, which section of the report shows a measure, whether a percentage
may be stated for it and which direction is better all follow from its record.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Literal

Scale = Literal["ratio", "interval", "ordinal", "binary", "unknown"]
Better = Literal["lower", "higher", "unknown"]
Section = Literal["selection", "time", "ratings", "others"]

_LAST = 1000
_TOTAL = "total"


@dataclass(frozen=True)
class Measure:
    """A dependent variable.

    `unit` is as shown, such as "mm". A percentage of change is meaningful only on a ratio scale, whose zero means
    "none" (Stevens 1946). `headline` ranks the measures that the first page may show, 0 first; None for the others.
    `cite` are keys of references.bib.
    """

    name: str
    label: str
    unit: str = ""
    scale: Scale = "unknown"
    better: Better = "unknown"
    section: Section = "others"
    source: str = "measures"
    cite: tuple[str, ...] = ()
    headline: int | None = None
    questionnaire: str = ""
    order: int = 0

    @property
    def full_label(self) -> str:
        """Its name for people, with its unit: `Completion time (s)`."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True)
class Questionnaire:
    """A standard instrument: its label, its scales or items in their own order, and the publications to cite."""

    name: str
    label: str
    scales: tuple[str, ...] = ()
    better: Better = "unknown"
    cite: tuple[str, ...] = ()
    has_total: bool = False
    score_labels: Mapping[str, str] = field(default_factory=dict)
    score_limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)


_FITTS = ("soukoreff2004", "iso9241411")

MEASURES: Mapping[str, Measure] = {
    measure.name: measure
    for measure in (
        Measure(
            "selection_mse_px2",
            "Selection error, MSE",
            "px²",
            "ratio",
            "lower",
            "selection",
            "the trials",
            headline=0,
        ),
        Measure(
            "selection_mse_mm2",
            "Selection error, MSE",
            "mm²",
            "ratio",
            "lower",
            "selection",
            "the trials",
            headline=1,
        ),
        Measure("selection_rmse_px", "Selection error, RMSE", "px", "ratio", "lower", "selection", "descriptives"),
        Measure("selection_rmse_mm", "Selection error, RMSE", "mm", "ratio", "lower", "selection", "descriptives"),
        Measure("completion_time_s", "Completion time", "s", "ratio", "lower", "time", "the events", headline=2),
        Measure("trial_time_s", "Time per trial", "s", "ratio", "lower", "time", "the trials", headline=3),
        Measure("throughput_bits_s", "Throughput", "bit/s", "ratio", "higher", source="the trials", cite=_FITTS),
        Measure(
            "path_efficiency", "Path efficiency", "", "ratio", "higher", source="the trials", cite=("williams2008",)
        ),
        Measure("overshoot_mm", "Overshoot", "mm", "ratio", "lower", source="the trials", cite=("williams2008",)),
        Measure("corrections", "Corrections per trial", "", "ratio", "lower", source="the trials", cite=("meyer1988",)),
    )
}
"""The measures that Steadyhand computes itself."""

QUESTIONNAIRES: Mapping[str, Questionnaire] = {
    questionnaire.name: questionnaire
    for questionnaire in (
        Questionnaire(
            "nasa_tlx",
            "NASA-TLX",
            ("mental", "physical", "temporal", "performance", "effort", "frustration"),
            "lower",
            ("hart1988",),
            has_total=True,
            score_labels={
                "total": "total (plain sum)",
                "raw_tlx": "raw score (0–100)",
                "weighted_tlx": "weighted score (0–100)",
            },
            score_limits={"raw_tlx": (0, 100), "weighted_tlx": (0, 100)},
        ),
        Questionnaire(
            "sus",
            "SUS",
            better="higher",
            cite=("brooke1996",),
            score_labels={"score": "score (0–100)"},
            score_limits={"score": (0, 100)},
        ),
        Questionnaire(
            "ueq",
            "UEQ",
            ("attractiveness", "perspicuity", "efficiency", "dependability", "stimulation", "novelty"),
            "higher",
            ("laugwitz2008",),
        ),
        Questionnaire("ueq_s", "UEQ-S", ("pragmatic", "hedonic", "overall"), "higher", ("schrepp2017",)),
        Questionnaire("ssq", "SSQ", ("nausea", "oculomotor", "disorientation"), "lower", ("kennedy1993",)),
        Questionnaire(
            "ipq",
            "IPQ",
            ("general_presence", "spatial_presence", "involvement", "realism"),
            "higher",
            ("schubert2001",),
        ),
    )
}

_UNITS: Mapping[str, str] = {
    "_px2": "px²",
    "_mm2": "mm²",
    "_mm_s2": "mm/s²",
    "_mm_s": "mm/s",
    "_px": "px",
    "_mm": "mm",
    "_ms": "ms",
    "_s": "s",
    "_percent": "%",
}
"""The unit by the ending of a measure's name. Longer endings come first: `_mm_s` is not a time in `_s`."""


@cache
def measure(name: str) -> Measure:
    """The record of a measure; for one that Steadyhand does not compute itself, made from its name."""
    if name in MEASURES:
        return MEASURES[name]
    questionnaire, slash, scale = name.partition("/")
    if slash:
        return _rating(name, questionnaire, scale)
    for suffix, unit in _UNITS.items():
        if name.endswith(suffix):
            return Measure(name, _spaced(name.removesuffix(suffix)), unit, "ratio")
    return Measure(name, _spaced(name))


def _rating(name: str, questionnaire: str, scale: str) -> Measure:
    """The record of a questionnaire's scale. Ratings count as interval: equal steps, but no zero that means none.

    Of a single item nothing is known to be better: half of those of the SUS, for one, are worded negatively.
    """
    known = QUESTIONNAIRES.get(questionnaire, Questionnaire(questionnaire, _spaced(questionnaire)))
    order = known.scales.index(scale) if scale in known.scales else len(known.scales)
    is_item = scale not in (*known.scales, *known.score_labels, _TOTAL)
    return Measure(
        name,
        f"{known.label}: {known.score_labels.get(scale, _spaced(scale).lower())}",
        scale="interval",
        better="unknown" if is_item else known.better,
        section="ratings",
        source="questionnaires",
        cite=known.cite,
        questionnaire=questionnaire,
        order=_LAST if scale == _TOTAL else order,
    )


def has_total(questionnaire: str) -> bool:
    """Whether the plain sum of its scales is customarily reported."""
    return questionnaire in QUESTIONNAIRES and QUESTIONNAIRES[questionnaire].has_total


def score_limits(name: str) -> tuple[float, float] | None:
    """The lowest and the highest value that a questionnaire's score can have; None where that is not known."""
    questionnaire, _, scale = name.partition("/")
    known = QUESTIONNAIRES.get(questionnaire)
    return known.score_limits.get(scale) if known else None


def reported_scales(questionnaire: str) -> tuple[str, ...]:
    """The scales of a known instrument that are reported beside its scores."""
    return QUESTIONNAIRES[questionnaire].scales if questionnaire in QUESTIONNAIRES else ()


def measure_order(name: str) -> tuple[str, int, str]:
    """A key to sort measures by: a questionnaire's scales come in their own order, its total last."""
    first, _, scale = name.partition("/")
    return first, measure(name).order, scale


def headlines(names: Iterable[str]) -> list[str]:
    """Those of the named measures that may be on the first page, in order of their rank."""
    ranked = [(rank, name) for name in names if (rank := measure(name).headline) is not None]
    return [name for _, name in sorted(ranked)]


def _spaced(name: str) -> str:
    """`hit_rate` as `Hit rate`."""
    words = name.replace("_", " ").strip()
    return words[:1].upper() + words[1:]
