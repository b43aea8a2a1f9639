"""Rigid transforms: inverses, quaternions, and matrices that are not rigid."""

from __future__ import annotations

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import CameraError, InputError
from groundmap.view.frames import (
    T_REP103_OPTICAL,
    check_transform,
    from_quaternion,
    invert,
    map_from_world,
    to_quaternion,
)


@st.composite
def quaternions(draw: st.DrawFn) -> Floats:
    """Unit quaternions, those of quarter and half turns among them."""
    parts = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([0.0, 1.0, -1.0]))
    values = np.array([draw(parts) for _ in range(4)])
    length = np.linalg.norm(values)
    return values / length if length > 1e-3 else np.array([0.0, 0.0, 0.0, 1.0])


@st.composite
def transforms(draw: st.DrawFn) -> Floats:
    translation = np.array([draw(st.floats(-1e3, 1e3)) for _ in range(3)])
    return from_quaternion(translation, draw(quaternions()))


def multiply(first: Floats, second: Floats) -> Floats:
    """Hamilton's product of two quaternions (x, y, z, w)."""
    u, v = first[:3], second[:3]
    vector = first[3] * v + second[3] * u + np.cross(u, v)
    return np.array([*vector, first[3] * second[3] - u @ v])


@given(quaternions(), st.tuples(*[st.floats(-10.0, 10.0)] * 3))
def test_a_quaternion_rotates_as_its_conjugation_does(
    quaternion: Floats, point: tuple[float, float, float]
) -> None:
    conjugate = quaternion * (-1.0, -1.0, -1.0, 1.0)
    expected = multiply(multiply(quaternion, np.array([*point, 0.0])), conjugate)[:3]
    npt.assert_allclose(
        from_quaternion(np.zeros(3), quaternion)[:3, :3] @ point, expected, atol=1e-13
    )


@given(quaternions())
def test_quaternions_come_back_up_to_their_sign(quaternion: Floats) -> None:
    back = to_quaternion(from_quaternion(np.zeros(3), quaternion))
    assert back[3] >= 0
    assert abs(back @ quaternion) == pytest.approx(1.0, abs=1e-12)


@given(transforms())
def test_rotations_come_back_from_their_quaternion(transform: Floats) -> None:
    back = from_quaternion(transform[:3, 3], to_quaternion(transform))
    npt.assert_allclose(back, transform, atol=1e-12)


@given(st.floats(0.0, 5.0).filter(lambda length: abs(length - 1.0) > 1e-2), quaternions())
def test_a_quaternion_of_another_length_is_refused(length: float, quaternion: Floats) -> None:
    with pytest.raises(CameraError, match=r"length 1 \(order x y z w\), got length"):
        from_quaternion(np.zeros(3), length * quaternion)


def test_a_quaternion_with_nan_is_refused() -> None:
    with pytest.raises(CameraError, match="got length nan"):
        from_quaternion(np.zeros(3), np.array([0.0, np.nan, 0.0, 1.0]))


@given(transforms())
def test_a_transform_and_its_inverse_cancel(transform: Floats) -> None:
    npt.assert_allclose(invert(transform) @ transform, np.eye(4), atol=1e-10)
    npt.assert_allclose(invert(transform), np.linalg.inv(transform), atol=1e-9)


@given(transforms())
def test_optical_worlds_are_turned_x_to_z_and_rep103_worlds_stay(transform: Floats) -> None:
    right, down, forward = transform[:3, 3]
    turned = map_from_world(transform, "optical")
    npt.assert_array_equal(turned[:3, 3], (forward, -right, -down))
    npt.assert_array_equal(map_from_world(transform, "rep103"), transform)
    check_transform("turned", turned)


def test_the_optical_axes_are_right_down_forward() -> None:
    right, down, forward = T_REP103_OPTICAL[:3, :3].T
    npt.assert_array_equal(right, (0, -1, 0))
    npt.assert_array_equal(down, (0, 0, -1))
    npt.assert_array_equal(forward, (1, 0, 0))


@given(transforms())
def test_rigid_transforms_pass_the_check_unchanged(transform: Floats) -> None:
    npt.assert_array_equal(check_transform("T", transform.tolist()), transform)


@given(transforms(), st.integers(0, 15), st.sampled_from([np.nan, np.inf, -np.inf]))
def test_no_entry_of_a_transform_may_be_nan_or_infinite(
    transform: Floats, place: int, bad: float
) -> None:
    transform.flat[place] = bad
    with pytest.raises(InputError, match=r"^T: expected finite numbers"):
        check_transform("T", transform)


@given(transforms(), st.floats(1.01, 10.0))
def test_scaled_rotations_are_refused(transform: Floats, scale: float) -> None:
    transform[:3, :3] *= scale
    with pytest.raises(CameraError, match=r"^T: expected a rotation with orthonormal rows"):
        check_transform("T", transform)


@given(transforms(), st.integers(0, 2))
def test_mirrored_transforms_are_refused(transform: Floats, axis: int) -> None:
    transform[:3, axis] *= -1.0
    with pytest.raises(CameraError, match=r"^T: expected a rotation, got a reflection"):
        check_transform("T", transform)


@given(transforms(), st.integers(0, 3), st.floats(0.01, 10.0))
def test_another_last_row_is_refused(transform: Floats, col: int, off: float) -> None:
    transform[3, col] += off
    with pytest.raises(CameraError, match=r"^T: expected a last row of 0 0 0 1"):
        check_transform("T", transform)


@pytest.mark.parametrize("shape", [(3, 4), (4, 3), (16,), (1, 4, 4)])
def test_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match=r"^T: expected shape \(4, 4\)"):
        check_transform("T", np.ones(shape))
