"""Features and views: the features kept, the features dropped and counted, the input refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap import Features, GroundPlane, StereoRig, View
from groundmap.arrays import Floats
from groundmap.errors import CameraError, InputError
from groundmap.view.view import sigma_along, wrong_covariance

RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)

# Coordinates of one row, and what becomes of it.
ROWS = {
    "kept": [(0.0, 0.0, 1.0), (-5.0, 3.0, 1e-3)],
    "behind_camera": [(1.0, 1.0, -2.0), (0.0, 0.0, 0.0)],
    "not_finite": [(np.nan, 0.0, 1.0), (0.0, np.inf, 1.0), (0.0, 0.0, -np.inf)],
}
fates = st.lists(st.tuples(st.sampled_from(list(ROWS)), st.integers(0, 10)), max_size=12)


def rows_of(chosen: list[tuple[str, int]]) -> Floats:
    rows = [ROWS[fate][i % len(ROWS[fate])] for fate, i in chosen]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def spread(*shape: int) -> Floats:
    return np.broadcast_to(0.01 * np.eye(3), (*shape, 3, 3)).copy()


def bare_view(**parts: Any) -> View:
    return View(T_map_base=np.eye(4), rig=RIG, **parts)


@given(fates)
def test_points_behind_the_camera_or_not_finite_are_dropped_and_counted(
    chosen: list[tuple[str, int]],
) -> None:
    xyz = rows_of(chosen)
    ids = np.arange(len(xyz)) + 100
    view = bare_view(points=Features.points(xyz, spread(len(xyz)), ids))
    names = [fate for fate, _ in chosen]
    kept = np.array([name == "kept" for name in names], dtype=np.bool_)
    npt.assert_array_equal(view.points.xyz, xyz[kept])
    npt.assert_array_equal(view.points.ids, ids[kept])
    assert len(view.points.covariance) == len(view.points) == kept.sum()
    assert view.dropped == {n: names.count(n) for n in ROWS if n != "kept" and n in names}


@given(fates, fates)
def test_a_segment_is_kept_only_with_both_ends(
    first: list[tuple[str, int]], second: list[tuple[str, int]]
) -> None:
    pairs = list(zip(first, second, strict=False))
    ends = np.stack([rows_of([a for a, _ in pairs]), rows_of([b for _, b in pairs])], axis=1)
    view = bare_view(segments=Features.segments(ends, spread(len(ends), 2)))
    fate = [{a[0], b[0]} for a, b in pairs]
    assert len(view.segments) == sum(f == {"kept"} for f in fate)
    not_finite = sum("not_finite" in f for f in fate)
    assert view.dropped["not_finite"] == not_finite
    assert view.dropped.total() == len(pairs) - len(view.segments)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_point_whose_covariance_is_not_finite_is_dropped(bad: float) -> None:
    covariance = spread(3)
    covariance[1, 0, 2] = bad
    view = bare_view(points=Features.points(np.ones((3, 3)), covariance, [5, 6, 7]))
    assert view.points.ids.tolist() == [5, 7]
    assert view.dropped == {"not_finite": 1}


def test_from_pixels_counts_matches_without_disparity_too() -> None:
    view = View.from_pixels(
        np.eye(4),
        RIG,
        points_px=[(355, 320, 275), (320, 320, 240), (np.nan, 0, 0), (390, 320, 240)],
        segments_px=[[(355, 320, 275), (300, 320, 240)], [(355, 320, 275), (355, 320, 200)]],
        point_ids=[1, 2, 3, 4],
        segment_ids=[8, 9],
        timestamp=2.5,
    )
    assert view.points.ids.tolist() == [1, 4]
    assert view.segments.ids.tolist() == [9]
    assert view.dropped == {"no_disparity": 2, "not_finite": 1}
    assert view.timestamp == 2.5


def test_a_view_without_features_is_a_view() -> None:
    for view in (bare_view(), View.from_pixels(np.eye(4), RIG)):
        assert (len(view.points), len(view.segments)) == (0, 0)
        assert view.segments.xyz.shape == (0, 2, 3)
        assert not view.dropped


def test_features_without_ids_have_minus_one() -> None:
    assert Features.points(np.ones((2, 3)), spread(2)).ids.tolist() == [-1, -1]


@given(st.lists(st.integers(0, 5), max_size=8))
def test_select_takes_rows_by_index_from_all_columns_alike(rows: list[int]) -> None:
    xyz = np.arange(18.0).reshape(6, 3)
    covariance = np.arange(6.0)[:, None, None] * 9.0 * np.eye(3)
    features = Features.points(xyz, covariance, np.arange(6) * 10)
    picked = features.select(np.array(rows, dtype=np.int64))
    assert len(picked) == len(rows)
    npt.assert_array_equal(picked.xyz[:, 0], np.array(rows) * 3.0)
    npt.assert_array_equal(picked.covariance[:, 0, 0], np.array(rows) * 9.0)
    npt.assert_array_equal(picked.ids, np.array(rows, dtype=np.int64) * 10)


@given(st.lists(st.booleans(), min_size=6, max_size=6))
def test_select_takes_rows_by_mask(mask: list[bool]) -> None:
    features = Features.segments(np.ones((6, 2, 3)), spread(6, 2), np.arange(6))
    assert features.select(np.array(mask)).ids.tolist() == [i for i in range(6) if mask[i]]


@pytest.mark.parametrize("n_ids", [0, 1, 3])
def test_a_wrong_number_of_ids_is_refused(n_ids: int) -> None:
    with pytest.raises(InputError, match=f"of the 2 features, got 2 and {n_ids}"):
        Features.points(np.ones((2, 3)), spread(2), np.arange(n_ids))


def test_a_wrong_number_of_covariances_is_refused() -> None:
    with pytest.raises(InputError, match="of the 2 features, got 3 and 2"):
        Features.points(np.ones((2, 3)), spread(3))


def test_ids_in_a_table_are_refused() -> None:
    with pytest.raises(InputError, match="ids"):
        Features.points(np.ones((2, 3)), spread(2), [[1, 2], [3, 4]])


def test_ids_that_are_not_whole_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="ids"):
        Features.points(np.ones((2, 3)), spread(2), [1.5, 2.0])


@pytest.mark.parametrize("name", ["point_ids", "segment_ids"])
def test_ids_must_be_as_many_as_the_matches_given(name: str) -> None:
    # One match has no disparity, so there is one feature, but two matches were given.
    pixels: dict[str, Any] = {"points_px": [(355, 320, 275), (320, 320, 240)]}
    if name == "segment_ids":
        pixels = {"segments_px": [[(355, 320, 275)] * 2, [(320, 320, 240)] * 2]}
    with pytest.raises(InputError, match=rf"^{name}: expected shape \(2,\), got shape \(1,\)"):
        View.from_pixels(np.eye(4), RIG, **(pixels | {name: [7]}))


@pytest.mark.parametrize(
    ("kind", "shape"), [("points", (2, 2)), ("points", (2, 2, 3)), ("segments", (2, 3))]
)
def test_coordinates_of_another_shape_are_refused(kind: str, shape: tuple[int, ...]) -> None:
    make = Features.points if kind == "points" else Features.segments
    with pytest.raises(InputError, match=r"^xyz: expected shape"):
        make(np.ones(shape), spread(2))


def test_a_covariance_of_another_shape_is_refused() -> None:
    with pytest.raises(InputError, match=r"^covariance: expected shape \(n, 3, 3\)"):
        Features.points(np.ones((2, 3)), np.ones((2, 3)))


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.full((4, 4), np.nan), "finite numbers"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "a rotation, got a reflection"),
        (np.diag([2.0, 2.0, 2.0, 1.0]), "orthonormal"),
        (np.eye(3), r"shape \(4, 4\)"),
    ],
)
def test_a_pose_that_is_not_a_rigid_transform_is_refused(pose: Floats, message: str) -> None:
    with pytest.raises(InputError, match=f"^T_map_base: expected .*{message}"):
        View(T_map_base=pose, rig=RIG)


def test_a_mirrored_pose_is_a_camera_error() -> None:
    with pytest.raises(CameraError, match="reflection"):
        View.from_pixels(np.diag([-1.0, 1.0, 1.0, 1.0]), RIG)


def test_the_pose_of_the_camera_is_that_of_base_and_mounting() -> None:
    mounting = np.array([[0, 0, 1, 0.2], [-1, 0, 0, 0.1], [0, -1, 0, 1.5], [0, 0, 0, 1.0]])
    pose = np.array([[0, -1, 0, 10.0], [1, 0, 0, 20.0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    rig = StereoRig(fx=1.0, fy=1.0, cx=0.0, cy=0.0, baseline=1.0, T_base_camera=mounting)
    camera = View(T_map_base=pose, rig=rig).T_map_camera
    npt.assert_allclose(camera[:3, 3], (9.9, 20.2, 1.5))
    npt.assert_allclose(camera[:3, 2], (0, 1, 0))


def test_with_plane_returns_a_copy() -> None:
    view = bare_view(points=Features.points([(0, 0, -1), (0, 0, 1)], spread(2)), timestamp=3.0)
    plane = GroundPlane(normal=(0.0, -1.0, 0.0), offset=1.5)  # type: ignore[arg-type] # a tuple will do here
    standing = view.with_plane(plane)
    assert view.plane is None
    assert standing.plane is plane
    assert standing.dropped == view.dropped == {"behind_camera": 1}
    npt.assert_array_equal(standing.points.xyz, view.points.xyz)
    assert standing.timestamp == 3.0


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.diag([1.0, 1.0, -0.25]), r"semi-definite matrix, got the eigenvalue -0\.25"),
        ([[1.0, 2.0, 0], [2.0, 1.0, 0], [0, 0, 1.0]], r"got the eigenvalue -1 at index 3"),
        ([[1.0, 0.5, 0], [0, 1.0, 0], [0, 0, 1.0]], r"symmetric matrix, .* differ by 0\.5"),
    ],
)
@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_the_first_matrix_that_is_not_a_covariance_is_named(
    matrix: Floats, message: str, scale: float
) -> None:
    given = spread(6)
    given[3] = np.asarray(matrix)
    given[5] = -np.eye(3)
    if scale != 1.0:
        message = "at index 3"
    with pytest.raises(InputError, match=rf"^covariance: expected a .*{message}"):
        Features.points(np.ones((6, 3)), given * scale)
    ends = np.stack([spread(6), given], axis=1)
    with pytest.raises(InputError, match=rf"^covariance: expected a .*{message}"):
        Features.segments(np.ones((6, 2, 3)), ends * scale)


def test_covariances_that_are_singular_rounded_or_not_finite_are_accepted() -> None:
    direction = np.array([0.6, 0.0, 0.8])
    given = np.stack([np.zeros((3, 3)), np.outer(direction, direction), np.full((3, 3), np.nan)])
    given[1] = np.round(given[1] * 1.23456789, 6)
    assert len(Features.points(np.ones((3, 3)), given)) == 3


@given(st.floats(0.5, 5000.0), st.floats(-600.0, 600.0), st.floats(0.05, 300.0))
def test_covariances_of_triangulated_pixels_are_positive_semi_definite(
    fx: float, u: float, disparity: float
) -> None:
    rig = StereoRig(fx=fx, fy=fx, cx=0.0, cy=0.0, baseline=0.1)
    assert wrong_covariance(rig.triangulate([(u, u - disparity, 0.3 * u)]).covariance) is None


def test_a_direction_known_exactly_has_no_negative_variance() -> None:
    direction = np.array([0.6, 0.0, 0.8])
    rounded = np.round(np.outer(direction, direction), 3) - 1e-6 * np.eye(3)
    assert sigma_along(np.array([0.8, 0.0, -0.6]), rounded[None])[0] == 0.0
