"""The check of orientations that jump says it of the jumps that the adaptive filter leaves out, and of no others."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fusion_core import FusionAdaptive
from fusion_core.adaptive.layout import ROWS
from fusion_core.samples import Samples
from pipeline.sessions.checks.lost_orientation import orientation_jumps
from pipeline.sessions.checks.recorded import Imu, Recorded, Times
from tests.benchmarks.departures import SENSORS

RATE_HZ = 100
BOUND_DEG = np.degrees(0.1 + 35.0 / RATE_HZ)  # what stamps may be off by, and 2000° a second


@pytest.mark.parametrize("jump_deg", [BOUND_DEG - 1.5, BOUND_DEG + 1.5, 80.0])
def test_check_and_filter_mean_the_same_jumps(jump_deg: float) -> None:
    time = np.arange(0, 3, 1 / RATE_HZ)
    away = (time > 1.495) & (time < 1.7)
    turned = Rotation.from_rotvec(np.outer(0.05 * time + np.radians(jump_deg) * away, [0.0, 0.0, 1.0]))
    force = turned.inv().apply([0.0, 0.0, 9806.65])

    stamp_ns = np.round(time * 1e9).astype(np.int64)
    nowhere = np.zeros(len(time), bool)
    imu = Imu(
        "imu",
        Times(stamp_ns, stamp_ns, 0),
        force / 1000,
        0 * force,
        turned.as_quat(),
        np.ones(len(time)),
        nowhere,
        nowhere,
    )
    (finding,) = orientation_jumps(Recorded(positions=(), imus=(imu,)))

    frames = np.arange(0, 3, 1 / 30)
    samples = {
        "tracker": Samples(frames, frames + 0.1, np.zeros((len(frames), 3))),
        "imu": Samples(time, time, 0 * force, turned.as_matrix(), force),
    }
    estimator = FusionAdaptive(SENSORS, history_s=2.0)
    _, state = estimator.resume(estimator.start(), samples, np.empty(0))
    kept = state.phone.time[: state.state["count"][0, ROWS]]
    left_out = set(time[time > kept[0]]) - set(kept)

    assert (finding.status != "green") == bool(left_out) == (jump_deg > BOUND_DEG)
