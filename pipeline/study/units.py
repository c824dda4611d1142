"""What one of a unit is in SI: the constants behind every table of units."""

from __future__ import annotations

import math

G_M_S2 = 9.80665
"""Standard gravity, by definition."""
G_MM_S2 = 9806.65

RAD_PER_DEG = math.pi / 180
M_PER_INCH = 0.0254
