"""Ground planes: heights of points, and cameras that cannot have the ground below them."""

from __future__ import annotations

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from groundmap import GroundPlane, StereoRig, View
from groundmap.arrays import Floats
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.view.camera_check import check_camera
from groundmap.view.frames import T_REP103_OPTICAL, map_from_world

UP = np.array([0.0, 0.0, 1.0])
BARE = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)


def mounted(height: float = 1.5, *, pitch: float = 0.0) -> StereoRig:
    """Return a rig on a base, looking forward; pitch [deg], downwards above zero."""
    mounting = np.eye(4)
    mounting[:3, :3] = Rotation.from_euler("y", pitch, degrees=True).as_matrix()
    mounting[:3, 3] = 0.3, -0.1, height
    return StereoRig(
        fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5,
        T_base_camera=mounting @ T_REP103_OPTICAL,
    )  # fmt: skip


def turned(axis: str, degrees: float) -> Floats:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    return pose


def bare_view(pose_rep103: Floats) -> View:
    """Return the view of a bare camera whose base would have that pose."""
    return View(T_map_base=pose_rep103 @ T_REP103_OPTICAL, rig=BARE)


units = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 1)).map(
    lambda v: np.array(v) / np.linalg.norm(v)
)


@given(units, st.floats(-3, 3), st.integers(0, 2**32 - 1))
def test_height_is_the_signed_distance_to_the_plane(
    normal: Floats, offset: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    foot = -offset * normal  # the point of the plane below the origin
    across = np.linalg.svd(normal[None])[2][1:]
    on_plane = foot + rng.uniform(-20, 20, (4, 5, 2)) @ across
    heights = rng.uniform(-3, 3, (4, 5))
    plane = GroundPlane(normal=normal, offset=offset)
    npt.assert_allclose(plane.height(on_plane), 0.0, atol=1e-12)
    npt.assert_allclose(plane.height(on_plane + heights[..., None] * normal), heights, atol=1e-12)


@given(st.floats(0.1, 5.0))
def test_level_ground_lies_that_far_below_the_camera(height: float) -> None:
    for rig in (BARE, mounted(1.5), mounted(0.4, pitch=20.0)):
        plane = GroundPlane.below_camera(rig, height)
        assert plane.height(rig.T_base_camera[:3, 3]) == pytest.approx(height)
        npt.assert_allclose(plane.normal, rig.up)
        assert plane.support == 0


@pytest.mark.parametrize("height", [0.0, -1.0, np.nan, np.inf])
def test_a_camera_below_its_ground_is_refused(height: float) -> None:
    with pytest.raises(InputError, match=r"^camera_height: expected a number above 0 \[m\]"):
        GroundPlane.below_camera(BARE, height)


@pytest.mark.parametrize(
    ("normal", "message"),
    [
        ((0, 0, 2), "length 1, got length 2"),
        ((0, 0, 0), "length 1, got length 0"),
        ((0, np.nan, 1), "finite numbers, got nan at index 1"),
        ((0, 1), r"shape \(3,\)"),
    ],
)
def test_a_normal_that_is_not_a_unit_vector_is_refused(
    normal: tuple[float, ...], message: str
) -> None:
    with pytest.raises(InputError, match=f"^normal: expected .*{message}"):
        GroundPlane(normal=np.array(normal, dtype=np.float64), offset=0.0)


@pytest.mark.parametrize(
    ("offset", "sigma_tilt"), [(np.nan, 0.0), (np.inf, 0.0), (0.0, np.nan), (0.0, -0.1)]
)
def test_a_plane_with_nan_or_a_negative_tilt_is_refused(offset: float, sigma_tilt: float) -> None:
    with pytest.raises(
        InputError, match=r"^plane: expected a finite offset \[m\] and a sigma_tilt"
    ):
        GroundPlane(normal=UP, offset=offset, sigma_tilt=sigma_tilt)


@given(st.floats(-59.5, 59.5), st.floats(-180, 180))
def test_a_camera_within_60_degrees_of_level_is_accepted(pitch: float, yaw: float) -> None:
    check_camera(View(T_map_base=turned("z", yaw), rig=mounted(pitch=pitch)))


@given(st.floats(60.5, 90.0), st.floats(-180, 180))
def test_a_mounted_camera_that_looks_at_the_ground_is_refused(pitch: float, yaw: float) -> None:
    with pytest.raises(
        NoGroundPlaneError, match=r"^the view: the camera looks at the ground \(-[6-9]\d deg"
    ):
        check_camera(View(T_map_base=turned("z", yaw), rig=mounted(pitch=pitch)))


@given(st.floats(60.5, 90.0), st.floats(-180, 180))
def test_a_mounted_camera_that_looks_at_the_sky_is_refused(pitch: float, yaw: float) -> None:
    with pytest.raises(
        NoGroundPlaneError, match=r"^the view: the camera looks at the sky \(\+[6-9]\d deg"
    ):
        check_camera(View(T_map_base=turned("z", yaw), rig=mounted(pitch=-pitch)))


@given(st.floats(-44.5, 44.5), st.sampled_from(["x", "y"]))
def test_a_bare_camera_may_lean_up_to_45_degrees(angle: float, axis: str) -> None:
    check_camera(bare_view(turned(axis, angle)))


@given(st.floats(45.5, 180.0), st.sampled_from([-1.0, 1.0]))
def test_a_camera_on_its_side_or_upside_down_is_refused(angle: float, side: float) -> None:
    with pytest.raises(
        NoGroundPlaneError, match=r"^the view: up of the base is \d+ degrees off z of the map"
    ):
        check_camera(bare_view(turned("x", side * angle)))


def test_optical_poses_taken_for_rep103_are_refused_with_the_likely_cause() -> None:
    pose = map_from_world(np.eye(4), "rep103")
    with pytest.raises(NoGroundPlaneError, match=r"looks at the sky .* 'optical' or 'rep103'"):
        check_camera(View(T_map_base=pose, rig=BARE))


def test_rep103_poses_taken_for_optical_are_refused_with_the_likely_cause() -> None:
    pose = map_from_world(T_REP103_OPTICAL, "optical")
    with pytest.raises(NoGroundPlaneError, match=r"90 degrees off z .* 'optical' or 'rep103'"):
        check_camera(View(T_map_base=pose, rig=BARE))
