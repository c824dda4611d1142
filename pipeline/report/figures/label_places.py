"""Where the labels of a scatter plot's marks go, so that no two touch.

Theory of operation. Marks that lie close together share one label, which lists their numbers. Labels are placed one
after the other, those of the largest groups first, since a long text fits in the fewest places. A label tries the eight
places around its mark in a fixed order of preference; it must not touch a label that is already placed, and keeps
away from other marks if it can. If no place is free, its group is merged with the nearest other group and all labels
are placed anew, so that the search ends after at most as many rounds as there are groups.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import numpy.typing as npt

from pipeline.statistics.arrays import FloatArray

# In which direction a label lies from its mark, the preferred ones first.
_SIDES = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(frozen=True)
class Label:
    """A text, the marks it stands for, nearest first, and its box: left, bottom, right, top (4,)."""

    marks: tuple[int, ...]
    text: str
    box: FloatArray


def place_labels(
    marks: FloatArray,
    numbers: Sequence[int],
    size: Callable[[str], tuple[float, float]],
    frame: FloatArray,
    apart: float,
    radius: float,
) -> list[Label]:
    """Place the numbers of marks (n, 2) beside them, inside the frame: left, bottom, right, top (4,).

    Marks closer than `apart` share a label, and so do those without room for two labels. `size` gives the width and
    height of a text, `radius` is that of a mark; all are in the same unit. The last label that is left may leave the
    frame.
    """
    groups = _close(marks, apart)
    labels: list[Label] = []
    while len(labels) < len(groups):
        group = groups[len(labels)]
        text = spans([numbers[mark] for mark in group])
        places = _places(marks[group[0]], size(text), radius)
        taken = np.array([label.box for label in labels]).reshape(-1, 4)
        free = _inside(places, frame) & ~_touching(places, taken)
        if not free.any() and len(groups) > 1:
            groups, labels = _merged(groups, len(labels), marks), []
            continue
        others = np.delete(marks, group, axis=0)
        clear = [free & ~_touching(places, _around(others, reach)) for reach in (2 * radius, radius)]
        best = next((places_left for places_left in clear if places_left.any()), free)
        labels.append(Label(tuple(group), text, places[int(np.argmax(best))]))
    return labels


def spans(numbers: Sequence[int]) -> str:
    """Numbers in order, three or more that follow each other as a span: `1–4, 7, 8`."""
    ordered = sorted(numbers)
    parts: list[str] = []
    for _, run in groupby(enumerate(ordered), lambda pair: pair[1] - pair[0]):
        texts = [str(number) for _, number in run]
        parts += [f"{texts[0]}–{texts[-1]}"] if len(texts) > 2 else texts
    return ", ".join(parts)


def _close(marks: FloatArray, apart: float) -> list[list[int]]:
    """Groups of marks: each mark joins the first group whose first mark is closer than `apart`."""
    groups: list[list[int]] = []
    for index, mark in enumerate(marks):
        near = (group for group in groups if np.hypot(*(marks[group[0]] - mark)) < apart)
        group = next(near, None)
        if group is None:
            groups.append([index])
        else:
            group.append(index)
    return _largest_first(groups)


def _largest_first(groups: Sequence[list[int]]) -> list[list[int]]:
    """Sort groups by size, since long labels have the fewest places to go to."""
    return sorted(groups, key=len, reverse=True)


def _merged(groups: Sequence[list[int]], which: int, marks: FloatArray) -> list[list[int]]:
    """Merge one group into the nearest other."""
    first = marks[[group[0] for group in groups]]
    distance = np.hypot(*(first - first[which]).T)
    distance[which] = np.inf
    one, other = sorted((which, int(np.argmin(distance))))
    rest = [*groups[:one], *groups[one + 1 : other], *groups[other + 1 :]]
    return _largest_first([groups[one] + groups[other], *rest])


def _places(mark: FloatArray, size: tuple[float, float], radius: float) -> FloatArray:
    """The boxes of a text on each side of a mark (sides, 4)."""
    extent = np.array(size)
    centre = mark + np.array(_SIDES) * (1.1 * radius + extent / 2)
    return np.hstack([centre - extent / 2, centre + extent / 2])


def _around(marks: FloatArray, reach: float) -> FloatArray:
    """A box about each mark (n, 4)."""
    return np.hstack([marks - reach, marks + reach])


def _inside(boxes: FloatArray, frame: FloatArray) -> npt.NDArray[np.bool_]:
    inside = np.hstack([boxes[:, :2] >= frame[:2], boxes[:, 2:] <= frame[2:]])
    return np.asarray(inside.all(axis=1))


def _touching(boxes: FloatArray, others: FloatArray) -> npt.NDArray[np.bool_]:
    """Which boxes (n, 4) have a point in common with one of the others (m, 4)."""
    one, other = boxes[:, None, :], others[None, :, :]
    common = np.concatenate([one[..., :2] <= other[..., 2:], other[..., :2] <= one[..., 2:]], axis=2).all(axis=2)
    touching: npt.NDArray[np.bool_] = np.any(common, axis=1)
    return touching
