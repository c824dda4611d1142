"""The width of each trial's target, from the task of study.yaml."""

from __future__ import annotations

import numpy as np

from pipeline.sessions.target_widths import widths_mm
from pipeline.simulation.layout import targets
from pipeline.study.simulation import Task

SAME_CIRCLE = Task.model_validate(
    {
        "rings": [
            {"centre_mm": [0, 500], "diameter_mm": 200, "targets": 7, "target_diameter_mm": width} for width in (40, 10)
        ]
    }
)


def in_space(places: np.ndarray) -> np.ndarray:
    return np.column_stack([places, np.zeros(len(places))])


def test_rings_of_one_circle_are_told_apart_by_the_order_of_the_task() -> None:
    found = widths_mm(SAME_CIRCLE, in_space(targets(SAME_CIRCLE)))
    assert found.tolist() == [40.0] * 8 + [10.0] * 8


def test_a_session_cut_short_does_not_tell_which_of_them_it_was() -> None:
    assert np.isnan(widths_mm(SAME_CIRCLE, in_space(targets(SAME_CIRCLE)[:-1]))).all()


def test_a_circle_of_its_own_tells_its_width_in_any_order() -> None:
    rings = [
        {"centre_mm": [0, 500], "diameter_mm": diameter, "targets": 5, "target_diameter_mm": width}
        for diameter, width in ((100, 30), (300, 12))
    ]
    task = Task.model_validate({"rings": rings})
    places = in_space(targets(task))[::-1]
    assert widths_mm(task, places).tolist() == [12.0] * 6 + [30.0] * 6
    assert np.isnan(widths_mm(task, 1.2 * places)).all()  # on no circle of the task


def test_single_targets_have_the_width_of_the_task() -> None:
    task = Task.model_validate({"targets_mm": [[0, 100], [300, 200]], "target_diameter_mm": 8})
    assert widths_mm(task, np.array([[300.0, 200.2, 0.0], [300.0, 210.0, 0.0]])).tolist()[0] == 8
    assert np.isnan(widths_mm(task, np.array([[300.0, 210.0, 0.0]]))).all()
    assert np.isnan(widths_mm(None, np.zeros((2, 3)))).all()
