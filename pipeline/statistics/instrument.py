"""What a score is made of: the items of a scale, and what is made of their ratings. Plain data, no arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Reading = Literal["mean", "sum", "centred", "percent", "points"]
"""What becomes of the ratings r of a scale's items, rated from `low` to `high`; a reversed item counts low + high − r.

mean: their mean. sum: their sum. centred: their mean less the middle of the range, −3 to 3 where 1 to 7 are rated.
percent: 100 · (mean − low) / (high − low). points: the sum of r − low.
"""


@dataclass(frozen=True)
class Scale:
    """A score: its name, its items, how their ratings are read, and a factor on that.

    An item that stands there twice counts twice. Of a `weighted` score each item counts by the participant's own
    weight, and the weights stand for comparisons of every two items (15 of six).
    """

    name: str
    items: tuple[str, ...]
    reading: Reading
    factor: float = 1.0
    weighted: bool = False
