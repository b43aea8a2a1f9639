"""The container of sparse maps, and the covariance of its landmarks."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.sparse.cameras import Camera, equirectangular
from groundmap.sparse.covariance import landmark_covariance
from groundmap.sparse.sparse_map import SparseMap


def poses_at(*centres: tuple[float, float, float]) -> Floats:
    poses = np.tile(np.eye(4), (len(centres), 1, 1))
    poses[:, :3, 3] = centres
    return poses


def small(**changes: Any) -> SparseMap:
    values: dict[str, Any] = {
        "system": "test",
        "T_world_camera": poses_at((0, 0, 0), (1, 0, 0)),
        "landmarks": np.array([(0.0, 0.0, 10.0), (1.0, 0.0, 5.0)]),
        "view_of": np.array([0, 1, 0]),
        "landmark_of": np.array([0, 0, 1]),
    }
    return SparseMap(**(values | changes))


def test_repeated_sightings_count_once_and_keep_the_first_pixel() -> None:
    pixels = np.array([(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)])
    found = small(landmark_of=np.array([0, 0, 0]), pixels=pixels)
    assert found.sightings == 2
    assert dict(found.dropped) == {"repeated_sightings": 1}
    assert found.pixels is not None
    npt.assert_array_equal(found.pixels, [(1, 1), (2, 2)])


def test_landmarks_that_are_not_finite_are_dropped_and_counted() -> None:
    found = small(landmarks=np.array([(0.0, np.nan, 10.0), (1.0, 0.0, 5.0)]))
    assert list(zip(found.view_of, found.landmark_of, strict=True)) == [(0, 1)]
    expected = {"invalid_landmarks": 1, "sightings_of_invalid_landmarks": 2}
    assert dict(found.dropped) == expected


def test_rows_that_share_an_id_are_one_landmark() -> None:
    assert small(ids=np.array([4, 4])).landmark_count == 1
    assert small(ids=np.array([-1, -1])).landmark_count == 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"view_of": np.array([0, 2, 0])}, "view of a sighting: .* below 2, got 2 at row 1"),
        ({"landmark_of": np.array([0, -1, 0])}, "landmark of a sighting: .* got -1 at row 1"),
        ({"camera_of": np.array([0, 1])}, "camera of a view: expected an index below 1, got 1"),
        ({"T_world_camera": 2 * poses_at((0, 0, 0), (1, 0, 0))}, "orthonormal rows.* view 0"),
        ({"T_world_camera": poses_at((0, 0, 0), (np.nan, 0, 0))}, "finite pose .* view 1"),
        ({"T_world_camera": np.array([np.diag([1, 1, -1, 1])] * 2)}, "rotation, got a reflection"),
        ({"names": ("a",)}, "names: expected 2, one per view, got 1"),
    ],
)
def test_invalid_maps_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        small(**changes)


def test_two_bearings_leave_the_depth_that_their_baseline_leaves() -> None:
    camera = Camera(model="test", focal_px=500.0)
    covariance = landmark_covariance(small(cameras=(camera,)))[0]
    # A landmark 10 m away, seen from two places 1 m apart, with bearings certain to 2 mrad.
    sideways = 2e-3 * 10 / np.sqrt(2)
    along = 2e-3 * 10**2 / 1.0 * np.sqrt(2)
    npt.assert_allclose(np.sqrt(covariance[1, 1]), sideways, rtol=0.02)
    npt.assert_allclose(np.sqrt(covariance[2, 2]), along, rtol=0.05)


def test_a_single_bearing_leaves_the_depth_unknown() -> None:
    covariance = landmark_covariance(small())[1]
    assert np.sqrt(np.linalg.eigvalsh(covariance)[-1]) > 40
    assert np.sqrt(np.linalg.eigvalsh(covariance)[0]) < 0.02


def test_a_given_noise_is_the_same_in_all_directions() -> None:
    covariance = landmark_covariance(small(), point_noise=0.1)
    npt.assert_allclose(covariance, np.broadcast_to(0.01 * np.eye(3), (2, 3, 3)))
    with pytest.raises(InputError, match=r"point_noise: expected a number above 0, got -1"):
        landmark_covariance(small(), point_noise=-1.0)


def test_cameras_state_their_borders() -> None:
    assert Camera(model="a", focal_px=500, width=1000, cx=400).border == pytest.approx(0.8)
    assert Camera(model="a").border is None
    assert equirectangular("b", 1920, 960).border is None
    with pytest.raises(InputError, match=r"camera a: expected a focal length above 0"):
        Camera(model="a", focal_px=float("nan"))
