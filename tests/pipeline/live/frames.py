"""Pictures of a printed marker as a camera would take them: rendered, then blurred, dimmed and noisy."""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.live.lens import Lens
from pipeline.statistics.arrays import FloatArray

DRAWN_PX, BORDER_PX = 480, 80  # of the marker's picture, and of the white around it
FACING = Rotation.from_rotvec([np.pi, 0.0, 0.0])
"""The attitude of a marker that faces the camera upright."""
_FINE = 3  # as many rays across a pixel
_WALL = 120
_DIM = np.arange(256, dtype=np.float32) * 0.7 + 20
_NOISE = np.tile(np.random.default_rng(0).standard_normal(1280 * 720, dtype=np.float32), 2)  # from anywhere in it


def drawn(number: int) -> np.ndarray:
    """The marker's picture with its white border."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    picture = cv2.aruco.generateImageMarker(dictionary, number, DRAWN_PX)
    return cv2.copyMakeBorder(picture, *(BORDER_PX,) * 4, cv2.BORDER_CONSTANT, value=(255,))


def corners_px(place_mm: FloatArray, attitude: Rotation, lens: Lens, size_mm: float) -> FloatArray:
    """Where the marker's corners (4, 2) are in the picture."""
    square = size_mm / 2 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]], dtype=float)
    seen, _ = cv2.projectPoints(
        attitude.apply(square) + place_mm, np.zeros(3), np.zeros(3), lens.matrix, np.array(lens.distortion)
    )
    return cast(FloatArray, seen.reshape(4, 2).astype(np.float64))


def frame(
    size: tuple[int, int],
    lens: Lens,
    markers: dict[int, tuple[FloatArray, Rotation]],
    random: np.random.Generator,
    size_mm: float = 50.0,
    blur_px: float = 0.8,
    noise: float = 4.0,
) -> np.ndarray:
    """A grey picture of markers, by number, each at a place (3,) in mm in an attitude; the lens has no distortion."""
    width, height = size
    picture = np.full((height, width), _WALL, np.uint8)
    for number, (place_mm, attitude) in markers.items():
        _paint(picture, number, place_mm, attitude, lens, size_mm)
    dim = np.asarray(cv2.LUT(cv2.GaussianBlur(picture, (0, 0), blur_px), _DIM), dtype=np.float32)
    along = len(_NOISE) // 2 - random.integers(len(_NOISE) // 2)  # noise takes longest, so it is drawn once and shifted
    dim += noise * _NOISE[along : along + picture.size].reshape(picture.shape)
    return np.clip(dim, 0, 255, out=dim).astype(np.uint8)


def _paint(
    picture: np.ndarray, number: int, place_mm: FloatArray, attitude: Rotation, lens: Lens, size_mm: float
) -> None:
    height, width = picture.shape
    seen = corners_px(place_mm, attitude, lens, size_mm * (DRAWN_PX + 2 * BORDER_PX) / DRAWN_PX)
    left, top = np.maximum(np.floor(seen.min(axis=0)).astype(int) - 4, 0)
    right, bottom = np.minimum(np.ceil(seen.max(axis=0)).astype(int) + 4, (width, height))
    if right <= left or bottom <= top:
        return
    whole = DRAWN_PX + 2 * BORDER_PX
    outline = np.array([[0, 0], [whole, 0], [whole, whole], [0, whole]]) - 0.5  # a pixel's middle is a whole number
    fine = (seen - (left, top) + 0.5) * _FINE - 0.5
    turn = cv2.getPerspectiveTransform(outline.astype(np.float32), fine.astype(np.float32))
    part = picture[top:bottom, left:right]
    large = cv2.resize(part, None, fx=_FINE, fy=_FINE, interpolation=cv2.INTER_NEAREST)
    cv2.warpPerspective(
        drawn(number), turn, large.shape[::-1], large, cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT
    )
    picture[top:bottom, left:right] = cv2.resize(large, part.shape[::-1], interpolation=cv2.INTER_AREA)
