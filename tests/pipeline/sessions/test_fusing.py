"""Which estimators use accelerations: what is said of each must be what it does."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import ESTIMATORS, Samples
from pipeline.sessions.estimators import build_estimator, fusing
from pipeline.study.settings import Study

STREAMS = {
    "tracker": {"topic": "/t", "kind": "position", "noise_sd_mm": 8},
    "imu": {"topic": "/i", "kind": "acceleration", "gravity_mm_s2": [0, 0, -9806.65], "noise_sd_mm_s2": 100},
}


def study(kind: str, **settings: object) -> Study:
    return Study.model_validate(
        {
            "conditions": ["a"],
            "sessions": "{participant}_{condition}.mcap",
            "streams": STREAMS,
            "estimators": {"one": {"type": kind, **settings}},
        }
    )


@pytest.mark.parametrize("kind", ESTIMATORS)
def test_an_estimator_is_said_to_fuse_if_accelerations_change_what_it_shows(kind: str) -> None:
    frames, forces = np.arange(0, 3, 1 / 30), np.arange(0, 3, 1 / 90)
    way = 100 * np.sin(frames[:, None] * [3.0, 2.0, 1.0])
    pull = 4000 * np.cos(forces[:, None] * [5.0, 4.0, 3.0])
    tracker = Samples(frames, frames + 0.01, way)
    built = build_estimator(study(kind), "one")
    shown = [
        built.replay({"tracker": tracker, "imu": Samples(forces, forces, value)}, forces[100:]).mean
        for value in (pull, -pull)
    ]
    assert (fusing(study(kind)) == {"one": "imu"}) == (not np.allclose(shown[0], shown[1], equal_nan=True))


def test_one_that_is_given_the_tracker_alone_does_not_fuse() -> None:
    assert fusing(study("window_gp", use=["tracker"])) == {}
