"""The matrices of the Kalman filters as textbooks print them, beside which the compiled steps are held."""

from __future__ import annotations

import numpy as np


def wiener_acceleration(step_s: float, jerk_psd_mm2_s5: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition F (3, 3) of position, velocity and acceleration over a step, and its process noise Q (3, 3).

    Bar-Shalom, Li and Kirubarajan (2001), section 6.2.3.
    """
    dt = step_s
    transition = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    noise = jerk_psd_mm2_s5 * np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    return transition, noise
