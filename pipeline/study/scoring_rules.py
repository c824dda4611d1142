"""How questionnaires are scored: an instrument's items, answers, reversed items and scales, and whose rule it is.

One record per rule. `scoring:` in study.yaml names one, or states a rule of its own. Items stand in the instrument's
own order; data may name them, or number them in that order.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from pipeline.statistics.instrument import Scale

Limits = tuple[float, float]


@dataclass(frozen=True)
class ScoringRule:
    """A published way to score an instrument.

    `limits` are the lowest and the highest answer; None where sheets differ, so that study.yaml must state them. `cite`
    are keys of references.bib. `assumes` says in a sentence what the rule assumes about the sheet.
    """

    name: str
    label: str
    items: tuple[str, ...]
    scales: tuple[Scale, ...]
    cite: tuple[str, ...]
    better: Literal["lower", "higher"]
    limits: Limits | None = None
    reversed: frozenset[str] = frozenset()
    aliases: Mapping[str, str] | None = None
    assumes: str = ""

    @property
    def weighted(self) -> bool:
        """Whether one of its scores needs the participants' own weights."""
        return any(scale.weighted for scale in self.scales)

    def item(self, given: str) -> str | None:
        """The item that a name in the data means: its name, an alias, or its number as in `7`, `q7`, `Item 07`."""
        spelled = _plain(given)
        by_name = {_plain(name): name for name in self.items} | {
            _plain(alias): name for alias, name in (self.aliases or {}).items()
        }
        if spelled in by_name:
            return by_name[spelled]
        number = re.fullmatch(rf"(?:q|question|item|i|{re.escape(_plain(self.name))})?0*(\d+)", spelled)
        place = int(number.group(1)) if number else 0
        return self.items[place - 1] if 1 <= place <= len(self.items) else None


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


_WEIGHT = re.compile(r"(?:weight|w)_(?P<first>.+)|(?P<last>.+)_(?:weight|w)", re.IGNORECASE)


def is_weight(name: str) -> bool:
    """`weight_mental`, `w_mental` and `mental_weight` are a participant's weights, not ratings."""
    return _WEIGHT.fullmatch(name) is not None


def weighed_item(name: str) -> str:
    """The item that a weight is of, as the data call it; the name itself where it is no weight's."""
    weight = _WEIGHT.fullmatch(name)
    return weight["first"] or weight["last"] if weight else name


def own_rule(
    items: Iterable[str],
    reading: Literal["mean", "sum"],
    limits: Limits,
    reversed_items: Iterable[str] = (),
    better: Literal["lower", "higher"] = "higher",
) -> ScoringRule:
    """A rule that study.yaml states itself: the mean or the sum of all items, as a scale named `score`."""
    named = tuple(items)
    return ScoringRule(
        "own", "", named, (Scale("score", named, reading),), (), better, limits, frozenset(reversed_items)
    )


def _numbered(count: int) -> tuple[str, ...]:
    return tuple(f"q{number}" for number in range(1, count + 1))


def _of(*numbers: int) -> tuple[str, ...]:
    return tuple(f"q{number}" for number in numbers)


_TLX = ("mental", "physical", "temporal", "performance", "effort", "frustration")
_TLX_ALIASES = {
    **{f"{name}_demand": name for name in ("mental", "physical", "temporal")},
    **dict(zip(("md", "pd", "td", "op", "ef", "fr"), _TLX, strict=True)),
    "own_performance": "performance",
    "frustration_level": "frustration",
}
_TLX_ASSUMES = "Performance runs from perfect (low) to failure (high), as on the original sheet."
_SSQ = (
    "general_discomfort",
    "fatigue",
    "headache",
    "eyestrain",
    "difficulty_focusing",
    "increased_salivation",
    "sweating",
    "nausea",
    "difficulty_concentrating",
    "fullness_of_head",
    "blurred_vision",
    "dizzy_eyes_open",
    "dizzy_eyes_closed",
    "vertigo",
    "stomach_awareness",
    "burping",
)


def _symptoms(*numbers: int) -> tuple[str, ...]:
    return tuple(_SSQ[number - 1] for number in numbers)


_NAUSEA = _symptoms(1, 6, 7, 8, 9, 15, 16)
_OCULOMOTOR = _symptoms(1, 2, 3, 4, 5, 9, 11)
_DISORIENTATION = _symptoms(5, 8, 10, 11, 12, 13, 14)
_IPQ = ("g1", *(f"sp{i}" for i in range(1, 6)), *(f"inv{i}" for i in range(1, 5)), *(f"real{i}" for i in range(1, 5)))

RULES: Mapping[str, ScoringRule] = {
    rule.name: rule
    for rule in (
        ScoringRule(
            "sus",
            "System Usability Scale",
            _numbered(10),
            # Odd items count r − 1 and even ones 5 − r, times 2.5: the mean of the turned answers on 0 to 100.
            (Scale("score", _numbered(10), "percent"),),
            ("brooke1996",),
            "higher",
            (1, 5),
            frozenset(_of(2, 4, 6, 8, 10)),
            assumes="Items stand in Brooke's order, the even ones worded negatively.",
        ),
        ScoringRule(
            "raw_tlx",
            "NASA-TLX, raw",
            _TLX,
            (Scale("raw_tlx", _TLX, "percent"),),
            ("hart1988", "hart2006"),
            "lower",
            aliases=_TLX_ALIASES,
            assumes=_TLX_ASSUMES,
        ),
        ScoringRule(
            "weighted_tlx",
            "NASA-TLX, weighted",
            _TLX,
            (Scale("weighted_tlx", _TLX, "percent", weighted=True), Scale("raw_tlx", _TLX, "percent")),
            ("hart1988",),
            "lower",
            aliases=_TLX_ALIASES,
            assumes=_TLX_ASSUMES,
        ),
        ScoringRule(
            "ueq",
            "User Experience Questionnaire",
            _numbered(26),
            (
                Scale("attractiveness", _of(1, 12, 14, 16, 24, 25), "centred"),
                Scale("perspicuity", _of(2, 4, 13, 21), "centred"),
                Scale("efficiency", _of(9, 20, 22, 23), "centred"),
                Scale("dependability", _of(8, 11, 17, 19), "centred"),
                Scale("stimulation", _of(5, 6, 7, 18), "centred"),
                Scale("novelty", _of(3, 10, 15, 26), "centred"),
            ),
            ("laugwitz2008",),
            "higher",
            (1, 7),
            frozenset(_of(3, 4, 5, 9, 10, 12, 17, 18, 19, 21, 23, 24, 25)),
            assumes="Answers are as ticked from left to right, the positive word on the left of thirteen pairs.",
        ),
        ScoringRule(
            "ueq_s",
            "User Experience Questionnaire, short",
            _numbered(8),
            (
                Scale("pragmatic", _of(1, 2, 3, 4), "centred"),
                Scale("hedonic", _of(5, 6, 7, 8), "centred"),
                Scale("overall", _numbered(8), "centred"),
            ),
            ("schrepp2017",),
            "higher",
            (1, 7),
            assumes="Answers are as ticked from left to right, the negative word on the left.",
        ),
        ScoringRule(
            "ssq",
            "Simulator Sickness Questionnaire",
            _SSQ,
            (
                Scale("nausea", _NAUSEA, "points", 9.54),
                Scale("oculomotor", _OCULOMOTOR, "points", 7.58),
                Scale("disorientation", _DISORIENTATION, "points", 13.92),
                # Of the three unweighted sums: a symptom of two scales counts twice.
                Scale("total", (*_NAUSEA, *_OCULOMOTOR, *_DISORIENTATION), "points", 3.74),
            ),
            ("kennedy1993",),
            "lower",
            (0, 3),
            aliases={
                "eye_strain": "eyestrain",
                "salivation_increasing": "increased_salivation",
                "fullness_of_the_head": "fullness_of_head",
                "dizziness_eyes_open": "dizzy_eyes_open",
                "dizziness_with_eyes_open": "dizzy_eyes_open",
                "dizziness_eyes_closed": "dizzy_eyes_closed",
                "dizziness_with_eyes_closed": "dizzy_eyes_closed",
            },
            assumes="Symptoms stand in the order of Kennedy et al. where they are numbered.",
        ),
        ScoringRule(
            "ipq",
            "igroup Presence Questionnaire",
            _IPQ,
            (
                Scale("general_presence", _IPQ[:1], "mean"),
                Scale("spatial_presence", _IPQ[1:6], "mean"),
                Scale("involvement", _IPQ[6:10], "mean"),
                Scale("realism", _IPQ[10:], "mean"),
            ),
            ("schubert2001",),
            "higher",
            (0, 6),
            frozenset(("sp2", "inv3", "real1")),
            assumes="SP3 and INV1 have the printed anchors, so that a high answer means more presence.",
        ),
    )
}
"""Every built-in rule by its name under `scoring:`."""
