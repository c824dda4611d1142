"""Labels of marks: none touches another, every mark has one, and each stands beside its mark."""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.figures.label_places import Label, place_labels, spans

FRAME = np.array([0.0, 0.0, 220.0, 180.0])
RADIUS = 5.0


def size(text: str) -> tuple[float, float]:
    return 6.0 * len(text), 10.0


def labels(*marks: tuple[float, float]) -> list[Label]:
    return place_labels(np.array(marks), list(range(1, len(marks) + 1)), size, FRAME, 10, RADIUS)


def numbers_in(text: str) -> list[int]:
    """The slow way back."""
    found: list[int] = []
    for part in text.split(", "):
        ends = [int(number) for number in re.findall(r"\d+", part)]
        found += range(ends[0], ends[-1] + 1)
    return found


place = st.tuples(st.integers(10, 210), st.integers(10, 170)).map(lambda at: (float(at[0]), float(at[1])))


@given(st.lists(place, min_size=1, max_size=40))
def test_no_two_labels_touch_and_every_mark_has_one(marks: list[tuple[float, float]]) -> None:
    found = labels(*marks)
    for one, other in combinations((label.box for label in found), 2):
        assert one[2] < other[0] or other[2] < one[0] or one[3] < other[1] or other[3] < one[1]
    assert sorted(mark for label in found for mark in label.marks) == list(range(len(marks)))
    for label in found:
        assert sorted(mark + 1 for mark in label.marks) == numbers_in(label.text)
        first = np.array(marks[label.marks[0]])
        nearest = np.clip(first, label.box[:2], label.box[2:])
        assert RADIUS < np.hypot(*(nearest - first)) < 2 * RADIUS
    if len(found) > 1:
        boxes = np.array([label.box for label in found])
        assert (boxes[:, :2] >= FRAME[:2]).all()
        assert (boxes[:, 2:] <= FRAME[2:]).all()


def test_marks_that_all_but_touch_share_a_label_and_others_do_not() -> None:
    near = labels((50, 50), (53, 52), (51, 49), (150, 100))
    assert [label.text for label in near] == ["1–3", "4"]


def test_a_label_keeps_away_from_others_marks() -> None:
    """The liked place, above to the right, is where the second mark is."""
    first, _ = labels((100, 100), (110, 112))
    assert not (first.box[0] <= 110 <= first.box[2] and first.box[1] <= 112 <= first.box[3])
    assert first.box[2] < 100


def test_at_the_frames_edge_a_label_goes_inwards() -> None:
    (label,) = labels((217, 177))
    assert (label.box[2:] < (217, 177)).all()


@given(st.sets(st.integers(1, 60), min_size=1))
def test_spans_name_each_number_once(numbers: set[int]) -> None:
    assert numbers_in(spans(list(numbers))) == sorted(numbers)


def test_spans_read_as_people_write_them() -> None:
    assert spans([8, 1, 2, 3, 4, 7]) == "1–4, 7, 8"
