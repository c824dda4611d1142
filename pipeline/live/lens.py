"""How a camera's lens maps directions to pixels: from a calibration's file, or from a stated field of view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.statistics.arrays import FloatArray

USUAL_FIELD_OF_VIEW_DEG = 65.0
"""Of webcams; they have 55 to 80 across."""
_DISTORTIONS = (4, 5, 8, 12, 14)  # as many coefficients as OpenCV's models have
_SAME_SHAPE = 0.01
_HOW = "calibrate at the size that is recorded, or state field_of_view_deg instead"


@dataclass(frozen=True)
class Lens:
    """A pinhole with distortion as OpenCV has it: focal lengths and principal point in pixels."""

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> FloatArray:
        """The camera matrix (3, 3)."""
        (across, down), (x, y) = self.focal_px, self.centre_px
        return np.array([[across, 0.0, x], [0.0, down, y], [0.0, 0.0, 1.0]])


def of_field_of_view(degrees: float, size: tuple[int, int]) -> Lens:
    """A lens without distortion that sees so much from the left edge to the right edge of a picture of that size.

    A wrong angle makes distances from the camera (z) wrong by the factor of its half's tangent. Movements along the
    picture (x, y) are measured by the marker's own width, so they stay right.
    """
    width, height = size
    focal = width / 2 / math.tan(math.radians(degrees) / 2)
    return Lens((focal, focal), ((width - 1) / 2, (height - 1) / 2))


def of_calibration(path: Path, size: tuple[int, int]) -> Lens:
    """A calibration as OpenCV's samples and ROS's camera_calibration write it, for pictures of that size.

    Raises PipelineError where the file is none, or of pictures of another shape.
    """
    content = _read(path)
    width, height = (_whole(path, content, key) for key in ("image_width", "image_height"))
    matrix = _numbers(path, content, "camera_matrix")
    if len(matrix) != 9 or not (matrix[0] > 0 and matrix[4] > 0):
        raise PipelineError(f"{path}: camera_matrix: should be 3 × 3 with positive focal lengths; {_HOW}")
    distortion = _numbers(path, content, "distortion_coefficients")
    if len(distortion) not in _DISTORTIONS:
        known = ", ".join(map(str, _DISTORTIONS))
        raise PipelineError(f"{path}: distortion_coefficients: has {len(distortion)}; a lens has {known}")
    scale = size[0] / width
    if abs(size[1] / height / scale - 1) > _SAME_SHAPE:
        raise PipelineError(
            f"{path}: is of pictures of {width} × {height}, and the camera gives {size[0]} × {size[1]}, another shape;"
            f" {_HOW}"
        )
    centre = (scale * (matrix[2] + 0.5) - 0.5, scale * (matrix[5] + 0.5) - 0.5)  # the corner pixel's middle is 0, 0
    return Lens((scale * matrix[0], scale * matrix[4]), centre, distortion)


def _read(path: Path) -> dict[str, Any]:
    import yaml

    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise PipelineError(f"{path}: the camera's calibration cannot be read: {reason}; {_HOW}") from None
    # OpenCV's own head and tags, which YAML does not know.
    lines = [line.replace("!!opencv-matrix", "") for line in text.splitlines() if not line.startswith("%YAML")]
    try:
        content = yaml.safe_load("\n".join(lines))
    except yaml.YAMLError:
        content = None
    if not isinstance(content, dict):
        raise PipelineError(f"{path}: is no calibration in YAML, as OpenCV's samples and ROS write it; {_HOW}")
    return content


def _whole(path: Path, content: dict[str, Any], key: str) -> int:
    found = content.get(key)
    if not isinstance(found, int) or isinstance(found, bool) or found <= 0:
        raise PipelineError(f"{path}: {key}: should be a number of pixels, found {found!r}; {_HOW}")
    return found


def _numbers(path: Path, content: dict[str, Any], key: str) -> tuple[float, ...]:
    found = content.get(key)
    data = found.get("data") if isinstance(found, dict) else None
    if not isinstance(data, list) or not all(_is_number(one) for one in data):
        raise PipelineError(f"{path}: {key}: should have `data`, a list of finite numbers; {_HOW}")
    return tuple(map(float, data))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
