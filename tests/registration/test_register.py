"""Registration: the motion is found, its covariance is honest, and what is unsure is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from groundmap import (
    Features,
    GroundPlane,
    RegistrationError,
    StereoRig,
    View,
    read_views,
    register,
)
from groundmap.arrays import Floats
from groundmap.errors import CameraError, SettingsError
from groundmap.view.frames import invert
from registration_scenes import RIG, seen_from, street, transform

DATA = Path(__file__).parents[3] / "shared" / "data"
MOTION = transform((0.1, -0.05, 0.9), (0.01, 0.05, -0.02))


def off(found: Floats, true: Floats) -> tuple[float, float]:
    """Return how far a pose is from the true one [m], [degrees]."""
    error = invert(true) @ found
    turned = float(np.degrees(Rotation.from_matrix(error[:3, :3]).magnitude()))
    return float(np.linalg.norm(error[:3, 3])), turned


def two_views(seed: int = 0, motion: Floats = MOTION, count: int = 400) -> tuple[View, View]:
    rng = np.random.default_rng(seed)
    points = street(rng, count)
    return seen_from(points, np.eye(4), rng, ids=True), seen_from(points, motion, rng, ids=True)


def without_ids(view: View) -> View:
    points = view.points
    return replace(view, points=Features.points(points.xyz, points.covariance))


@pytest.mark.parametrize("seed", range(4))
def test_the_motion_of_a_street_is_found_without_ids(seed: int) -> None:
    a, b = (without_ids(view) for view in two_views(seed))
    found = register(a, b)
    metres, degrees = off(found.T_a_b, MOTION)
    assert metres < 0.02
    assert degrees < 0.05


def test_inliers_are_the_same_landmarks() -> None:
    a, b = two_views()
    found = register(a, b, use_ids=False)
    same = a.points.ids[found.inliers[:, 0]] == b.points.ids[found.inliers[:, 1]]
    assert len(same) > 150
    assert same.mean() > 0.97


def test_ids_restrict_the_correspondences_and_false_ids_are_outvoted() -> None:
    a, b = two_views()
    ids = b.points.ids.copy()
    rng = np.random.default_rng(5)
    ids[: len(ids) // 3] = rng.permutation(ids[: len(ids) // 3])
    b = replace(b, points=Features.points(b.points.xyz, b.points.covariance, ids))
    found = register(a, b)
    assert off(found.T_a_b, MOTION)[0] < 0.02
    first, second = found.inliers.T
    assert (a.points.ids[first] == b.points.ids[second]).all()


def test_the_poses_of_the_views_are_not_used() -> None:
    a, b = (without_ids(view) for view in two_views())
    moved = replace(b, T_map_base=transform((50.0, 3.0, 9.0), (0.0, 1.0, 0.0)))
    np.testing.assert_array_equal(register(a, b).T_a_b, register(a, moved).T_a_b)


def test_the_other_direction_gives_the_inverse_motion() -> None:
    a, b = (without_ids(view) for view in two_views())
    there, back = register(a, b).T_a_b, register(b, a).T_a_b
    metres, degrees = off(there @ back, np.eye(4))
    assert metres < 0.01
    assert degrees < 0.03


def test_a_guess_moves_the_bounds() -> None:
    motion = transform((0.2, 0.0, 6.0), (0.0, 0.4, 0.0))
    rng = np.random.default_rng(0)
    points = street(rng, 900)
    a, b = seen_from(points, np.eye(4), rng), seen_from(points, motion, rng)
    guess = transform((0.0, 0.0, 5.0), (0.0, 0.3, 0.0))
    assert off(register(a, b, guess=guess).T_a_b, motion)[0] < 0.05
    with pytest.raises(RegistrationError, match="agree") as refused:
        register(a, b)
    assert refused.value.reason in ("too_few", "ambiguous")


def test_the_covariance_is_that_of_the_error() -> None:
    errors = []
    for seed in range(12):
        a, b = two_views(seed)
        found = register(a, b)
        error = invert(MOTION) @ found.T_a_b
        small = np.concatenate([error[:3, 3], Rotation.from_matrix(error[:3, :3]).as_rotvec()])
        errors.append(small @ np.linalg.solve(found.covariance, small) / 6)
    assert 0.3 < np.mean(errors) < 3.0


def test_a_mounted_camera_gives_the_motion_of_the_base() -> None:
    T_base_camera = transform((0.4, 0.1, 1.2))
    T_base_camera[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    rig = replace(RIG, T_base_camera=T_base_camera)
    rng = np.random.default_rng(1)
    points = street(rng) @ T_base_camera[:3, :3].T + T_base_camera[:3, 3]
    motion = transform((0.8, 0.1, 0.0), (0.0, 0.0, 0.08))
    a = seen_from(points, T_base_camera, rng, rig=rig)
    b = seen_from(points, motion @ T_base_camera, rng, rig=rig)
    for planar in (False, True):
        metres, degrees = off(register(a, b, planar=planar).T_a_b, motion)
        assert metres < 0.03
        assert degrees < 0.1


def test_a_planar_motion_keeps_height_and_tilt() -> None:
    motion = transform((0.1, 0.0, 0.9), (0.0, 0.05, 0.0))
    a, b = two_views(motion=motion)
    planes = [GroundPlane.below_camera(RIG, 1.6)] * 2
    a, b = (view.with_plane(plane) for view, plane in zip((a, b), planes, strict=True))
    found = register(a, b, planar=True)
    assert off(found.T_a_b, motion)[0] < 0.01
    assert found.T_a_b[1, 3] == pytest.approx(0.0, abs=1e-9)
    assert found.T_a_b[1, 1] == pytest.approx(1.0, abs=1e-9)
    assert np.linalg.matrix_rank(found.covariance, tol=1e-12) == 3


def test_false_features_do_not_change_the_motion() -> None:
    rng = np.random.default_rng(2)
    a, b = (without_ids(view) for view in two_views(2))
    views = []
    for view in (a, b):
        count = len(view.points)
        pixels = rng.uniform((0, 0, 0), (1200, 1, 400), (count, 3))
        pixels[:, 1] = pixels[:, 0] - 350.0 / rng.uniform(5, 30, count)
        false = View.from_pixels(np.eye(4), RIG, points_px=pixels).points
        views.append(
            replace(
                view,
                points=Features.points(
                    np.concatenate([view.points.xyz, false.xyz]),
                    np.concatenate([view.points.covariance, false.covariance]),
                ),
            )
        )
    assert off(register(*views).T_a_b, MOTION)[0] < 0.03


def test_unrelated_views_are_refused() -> None:
    a, b = two_views(0)[0], two_views(7)[1]
    with pytest.raises(RegistrationError, match="agree") as refused:
        register(without_ids(a), without_ids(b))
    assert refused.value.reason in ("too_few", "ambiguous")


def test_too_few_features_are_refused() -> None:
    a, b = two_views()
    few = replace(b, points=b.points.select(np.arange(5)))
    with pytest.raises(RegistrationError, match=r"5 point features are too few.*20") as refused:
        register(a, few)
    assert refused.value.reason == "too_few"


def test_a_fence_that_repeats_is_ambiguous() -> None:
    rng = np.random.default_rng(3)
    posts = np.arange(6.0, 18.0, 1.0)
    shape = rng.uniform((2, -1, -0.2), (4, 1.5, 0.2), (25, 3))
    points = np.concatenate([shape + np.array([0.0, 0.0, z]) for z in posts])
    motion = transform((0.0, 0.0, 0.5))
    a, b = seen_from(points, np.eye(4), rng), seen_from(points, motion, rng)
    with pytest.raises(RegistrationError, match=r"two motions.* [123] m apart.*alike") as refused:
        register(a, b)
    assert refused.value.reason == "ambiguous"


def test_features_on_a_line_leave_the_rotation_about_it_open() -> None:
    rng = np.random.default_rng(4)
    along = np.sort(rng.uniform(-4, 4, 60))
    points = np.stack([along, 0.1 * along, 8.0 + 0.2 * along], axis=1)
    noise = np.tile(1e-6 * np.eye(3), (60, 1, 1))
    a, b = (
        View(T_map_base=np.eye(4), rig=RIG, points=Features.points(points - shift, noise))
        for shift in (np.zeros(3), np.array([0.0, 0.0, 0.3]))
    )
    with pytest.raises(RegistrationError) as refused:
        register(a, b)
    assert refused.value.reason in ("undetermined", "too_few")


def test_refused_settings_and_guesses_are_named() -> None:
    a, b = two_views()
    with pytest.raises(SettingsError, match=r"Did you mean 'max_translation'"):
        register(a, b, max_translatoin=1.0)
    with pytest.raises(CameraError, match="guess: expected a rotation"):
        register(a, b, guess=2.0 * np.eye(4))


def test_consecutive_views_of_a_recorded_drive_agree_with_its_poses() -> None:
    source = DATA / "kitti00_vo"
    if not source.is_dir():
        pytest.skip(f"no recorded drive in {source}")
    views = [without_ids(view) for view in read_views(source)]
    errors = []
    for a, b in zip(views[::4], views[1::4], strict=False):
        true = invert(a.T_map_base) @ b.T_map_base
        errors.append(off(register(a, b).T_a_b, true))
    metres, degrees = np.array(errors).T
    assert np.median(metres) <= 0.003
    assert np.median(degrees) <= 0.01
    assert metres.max() <= 0.02


def test_a_rig_with_covariances_from_elsewhere_is_enough() -> None:
    rng = np.random.default_rng(6)
    points = rng.uniform((-6, -2, 4), (6, 2, 20), (150, 3))
    rig = StereoRig(fx=400, fy=400, cx=300, cy=200, baseline=0.1)
    noise = np.tile(0.02**2 * np.eye(3), (150, 1, 1))
    a = View(T_map_base=np.eye(4), rig=rig, points=Features.points(points, noise))
    local = (points - MOTION[:3, 3]) @ MOTION[:3, :3] + rng.normal(0, 0.02, points.shape)
    b = View(T_map_base=np.eye(4), rig=rig, points=Features.points(local, noise))
    assert off(register(a, b).T_a_b, MOTION)[0] < 0.03
