"""Single quaternions in plain numbers, against SciPy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusion_core.phone.quaternion import product, turn

PARTS = st.floats(-5, 5)
VECTORS = st.tuples(PARTS, PARTS, PARTS)


def same(found: tuple[float, ...], wanted: Rotation) -> None:
    assert abs(float(np.dot(found, wanted.as_quat()))) == pytest.approx(1.0, abs=1e-12)  # q and −q are one rotation


@given(VECTORS, VECTORS)
def test_a_product_is_one_rotation_after_the_other(one: tuple[float, ...], other: tuple[float, ...]) -> None:
    first, then = Rotation.from_rotvec(one), Rotation.from_rotvec(other)
    same(product(first.as_quat().tolist(), then.as_quat().tolist()), first * then)


@given(VECTORS, st.floats(0, 1))
def test_a_turn_is_that_of_an_angular_velocity(rate: tuple[float, ...], seconds: float) -> None:
    same(turn(rate, seconds), Rotation.from_rotvec(np.array(rate) * seconds))


def test_a_small_turn_and_none_are_exact() -> None:
    assert turn((0.0, 0.0, 0.0), 1.0) == (0.0, 0.0, 0.0, 1.0)
    for angle in (1e-12, 1e-6, 9.99e-4, 1.01e-3):
        assert turn((angle, 0.0, 0.0), 1.0)[0] == pytest.approx(np.sin(angle / 2), rel=1e-14)
