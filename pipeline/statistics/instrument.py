"""Scales of questionnaires: their items, and how ratings become a score. Plain data, no arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Reading = Literal["mean", "sum", "centred", "percent", "points"]
"""How a score is computed from ratings r of items, from `low` to `high`; a reversed item counts low + high − r.

mean: their mean. sum: their sum. centred: their mean less the middle of the range, −3 to 3 where 1 to 7 are rated.
percent: 100 · (mean − low) / (high − low). points: the sum of r − low.
"""


@dataclass(frozen=True)
class Scale:
    """A score: its name, its items, how their ratings are read, and a factor on that.

    An item listed twice counts twice. In a `weighted` score each item counts by the participant's own weight: how
    often it was chosen when every two items were compared (15 comparisons of six items).
    """

    name: str
    items: tuple[str, ...]
    reading: Reading
    factor: float = 1.0
    weighted: bool = False
