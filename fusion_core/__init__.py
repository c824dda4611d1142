"""Steadyhand's estimators: given late, noisy positions and prompt accelerations, where is the hand now, and how sure?

NumPy, SciPy and Numba only: no files, sockets, clocks or DataFrames. The README has the notation table.
"""

from fusion_core.adaptive.fusion import FusionAdaptive
from fusion_core.estimator import Estimator, replay_loop
from fusion_core.filters import Holt, OneEuro, Raw
from fusion_core.kalman.fusion import FusionKalman
from fusion_core.kalman.position import PositionKalman
from fusion_core.kalman.smoothing import fixed_lag, smooth
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import OPERATORS, Sensor, Term
from fusion_core.window.gp import WindowGP

ESTIMATORS: dict[str, type[Raw | OneEuro | Holt | PositionKalman | WindowGP | FusionKalman | FusionAdaptive]] = {
    "raw": Raw,
    "one_euro": OneEuro,
    "holt": Holt,
    "position_kalman": PositionKalman,
    "window_gp": WindowGP,
    "fusion_kalman": FusionKalman,
    "fusion_adaptive": FusionAdaptive,
}
"""Every estimator by the name study.yaml gives as `type`."""

__all__ = [
    "ESTIMATORS",
    "OPERATORS",
    "Estimator",
    "FloatArray",
    "FusionAdaptive",
    "FusionKalman",
    "Holt",
    "OneEuro",
    "PositionKalman",
    "Raw",
    "Sample",
    "Samples",
    "Sensor",
    "Term",
    "Track",
    "WindowGP",
    "fixed_lag",
    "replay_loop",
    "smooth",
]
