"""The mapper: order, merging, refusal, degenerate views, and every feature accounted for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dense_grid import rounding_of_mean
from groundmap import (
    CellState,
    ConfidenceGrid,
    Features,
    GroundMapper,
    GroundPlane,
    StereoRig,
    View,
)
from groundmap.arrays import Floats
from groundmap.errors import GroundmapError, InputError, NoGroundPlaneError, SettingsError
from groundmap.evidence.ground_plane.height_classes import flatten
from groundmap.evidence.ground_plane.ray_smoothing import smooth_features
from groundmap.grid.fusion import Average, Capped
from groundmap.view.frames import T_REP103_OPTICAL, invert

HEIGHT = 1.5
GROUND = GroundPlane(normal=np.array([0.0, 0.0, 1.0]), offset=0.0)
FUSIONS = ["average", "capped", "exponential", "log_odds", "absolute"]


def rig(*, pitch: float = 0.0, yaw: float = 0.0) -> StereoRig:
    """Return a rig 1.5 m above the base's origin; pitch (downwards) and yaw (left) [deg]."""
    mounting = np.eye(4)
    mounting[:3, :3] = Rotation.from_euler("zy", (yaw, pitch), degrees=True).as_matrix()
    mounting[2, 3] = HEIGHT
    T_base_camera = mounting @ T_REP103_OPTICAL
    return StereoRig(
        fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5, T_base_camera=T_base_camera
    )


def pose_at(x: float, y: float, yaw: float) -> Floats:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw).as_matrix()
    pose[:2, 3] = x, y
    return pose


def spread(shape: tuple[int, ...], sigma: float) -> Floats:
    return np.broadcast_to(sigma**2 * np.eye(3), (*shape, 3, 3)).copy()


def view_of(
    points: Floats,
    segments: Floats,
    *,
    pose: Floats | None = None,
    seen_by: StereoRig | None = None,
    sigma: float = 0.02,
) -> View:
    """Return the view of points (n, 3) and segments (m, 2, 3) given in the base [m]."""
    seen_by = seen_by or rig()
    T_camera_base = invert(seen_by.T_base_camera)

    def in_camera(xyz: Floats) -> Floats:
        turned: Floats = xyz @ T_camera_base[:3, :3].T + T_camera_base[:3, 3]
        return turned

    return View(
        T_map_base=np.eye(4) if pose is None else pose,
        rig=seen_by,
        points=Features.points(in_camera(points), spread((len(points),), sigma)),
        segments=Features.segments(in_camera(segments), spread((len(segments), 2), sigma)),
        plane=GROUND,
    )


def room_view(rng: np.random.Generator) -> View:
    """Return a view from somewhere in a 16 m room: ground, walls, a box, a hole, and noise."""
    pose = pose_at(rng.uniform(-6, 6), rng.uniform(-6, 6), rng.uniform(-np.pi, np.pi))
    along, heights = rng.uniform(-8, 8, 60), rng.uniform(0, 2.5, 60)
    wall = rng.integers(0, 4, 60)
    walls = np.stack([np.where(wall % 2, 8.0, -8.0), along], axis=1)
    walls[wall > 1] = walls[wall > 1, ::-1]
    ground = np.column_stack([rng.uniform(-8, 8, (60, 2)), rng.normal(0, 0.02, 60)])
    hole = np.column_stack([rng.uniform(1, 2, (4, 2)), np.full(4, -0.8)])
    edges = rng.uniform((-8, -8, 0), (8, 8, 2.5), (12, 1, 3))
    segments = edges + rng.uniform(-1, 1, (12, 2, 3)) * rng.choice([0.0, 1.0], (12, 1, 3))
    T_base_map = invert(pose)
    points = np.concatenate([np.column_stack([walls, heights]), ground, hole])
    points = points @ T_base_map[:3, :3].T + T_base_map[:3, 3] + rng.normal(0, 0.02, points.shape)
    return view_of(points, segments @ T_base_map[:3, :3].T + T_base_map[:3, 3], pose=pose)


def mapped(views: list[View], **options: Any) -> GroundMapper:
    mapper = GroundMapper(**options)
    for view in views:
        mapper.integrate(view)
    return mapper


def assert_same_map(one: ConfidenceGrid, other: ConfidenceGrid) -> None:
    """Compare counts exactly, confidence to the rounding of two running averages."""
    ours, theirs = one.window(), other.window()
    npt.assert_array_equal(ours.origin, theirs.origin)
    npt.assert_array_equal(ours.count, theirs.count)
    error = np.abs(ours.confidence - theirs.confidence)
    assert (error <= 2 * rounding_of_mean(ours.count)).all()


class Snapshot(NamedTuple):
    tiles: dict[tuple[int, ...], tuple[bytes, ...]]
    trajectory: list[list[float]]
    stats: dict[str, Any]


def snapshot(mapper: GroundMapper) -> Snapshot:
    """Return the complete state of a mapper, bit for bit."""
    tiles: dict[tuple[int, ...], tuple[bytes, ...]] = {
        index: (tile.confidence.tobytes(), tile.count.tobytes())
        for index, tile in mapper.grid.tiles()
    }
    tiles |= {
        (layer, *index): (tile.confidence.tobytes(), tile.count.tobytes())
        for layer in range(len(mapper.grid.heights))
        for index, tile in mapper.grid.layer_tiles(layer)
    }
    return Snapshot(tiles, mapper.grid.trajectory.tolist(), asdict(mapper.stats))


@given(st.integers(0, 2**32 - 1), st.permutations(range(6)))
@settings(max_examples=20)
def test_the_order_of_the_views_changes_nothing(seed: int, order: list[int]) -> None:
    rng = np.random.default_rng(seed)
    views = [room_view(rng) for _ in range(6)]
    one, other = mapped(views), mapped([views[i] for i in order])
    assert_same_map(one.grid, other.grid)
    assert one.stats == other.stats
    npt.assert_array_equal(one.grid.trajectory[order], other.grid.trajectory)


@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=6, max_size=6))
@settings(max_examples=20)
def test_maps_of_split_views_merge_into_the_map_of_all(seed: int, side: list[bool]) -> None:
    rng = np.random.default_rng(seed)
    views = [room_view(rng) for _ in range(6)]
    one = mapped([view for view, left in zip(views, side, strict=True) if left])
    two = mapped([view for view, left in zip(views, side, strict=True) if not left])
    merged, whole = one.grid.merge(two.grid), mapped(views).grid
    assert_same_map(merged, whole)
    assert len(merged.trajectory) == 6


def test_a_room_has_free_ground_walls_and_a_hole() -> None:
    # The claims above would also hold for a mapper that does nothing.
    rng = np.random.default_rng(1)
    mapper = mapped([room_view(rng) for _ in range(40)])
    window = mapper.grid.window()
    assert (window.confidence < -0.5).sum() > 2000
    assert (window.confidence > 0.1).sum() > 500
    assert mapper.stats.features_dropped["below_ground"] > 20
    assert mapper.stats.features_dropped["overhead"] > 20


def test_one_view_says_at_most_one_thing_of_a_cell() -> None:
    view = room_view(np.random.default_rng(2))
    mapper = mapped([view])
    window = mapper.grid.window()
    assert window.count.max() == 1
    assert (window.confidence[window.count == 1] != 0).all()
    twice = mapped([view, view]).grid.window()
    npt.assert_array_equal(twice.count, 2 * window.count)
    npt.assert_array_equal(twice.confidence, window.confidence)


def without_plane(view: View) -> View:
    return replace(view, plane=None)


def at_the_sky(view: View) -> View:
    tilt = np.eye(4)
    tilt[:3, :3] = Rotation.from_euler("y", -80, degrees=True).as_matrix()
    return replace(view, T_map_base=view.T_map_base @ tilt)


def on_its_side(view: View) -> View:
    tilt = np.eye(4)
    tilt[:3, :3] = Rotation.from_euler("x", 80, degrees=True).as_matrix()
    return replace(view, T_map_base=view.T_map_base @ tilt)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (without_plane, "^view 3 has no ground plane: expected views from groundmap.fit_ground"),
        (at_the_sky, "looks at the sky"),
        (on_its_side, "degrees off z of the map"),
    ],
)
@pytest.mark.parametrize("fusion", FUSIONS)
def test_a_refused_view_leaves_grid_and_figures_as_they_were(
    spoil: Callable[[View], View], message: str, fusion: str
) -> None:
    rng = np.random.default_rng(3)
    mapper = mapped([room_view(rng) for _ in range(3)], fusion=fusion)
    before = snapshot(mapper)
    with pytest.raises(NoGroundPlaneError, match=message):
        mapper.integrate(spoil(room_view(rng)))
    assert snapshot(mapper) == before
    mapper.integrate(room_view(rng))
    assert mapper.stats.views == 4


def test_a_resolution_in_the_wrong_unit_is_refused_before_memory_runs_out() -> None:
    mapper = GroundMapper(resolution=1e-3)
    before = snapshot(mapper)
    with pytest.raises(
        InputError, match=r"^resolution: expected one that cuts a view into \d+ cel"
    ):
        mapper.integrate(room_view(np.random.default_rng(4)))
    assert snapshot(mapper) == before


def test_explaining_a_view_changes_nothing() -> None:
    rng = np.random.default_rng(5)
    mapper = mapped([room_view(rng)])
    before, view = snapshot(mapper), room_view(rng)
    parts = mapper.explain(view)
    assert snapshot(mapper) == before
    mapper.integrate(view)
    assert mapper.stats.features_used == before.stats["features_used"] + parts.ground_view.used


def test_changed_holds_the_cells_that_the_last_view_changed() -> None:
    rng = np.random.default_rng(9)
    mapper = mapped([room_view(rng)])
    window = mapper.grid.window()
    mapper.integrate(room_view(rng))
    again = mapper.grid.window()
    assert again.count.shape == window.count.shape
    expected = np.argwhere(again.count != window.count) + mapper.grid.cell_bounds()[0]
    assert {*map(tuple, mapper.changed.tolist())} == {*map(tuple, expected.tolist())}


def test_features_are_smoothed_before_they_are_linked() -> None:
    rng = np.random.default_rng(7)
    wall = np.column_stack([np.full(60, 6.0), np.linspace(-1.5, 1.5, 60), np.full(60, 0.7)])
    view = view_of(
        wall + rng.normal(0, 0.1, wall.shape) * (1, 0, 0), np.empty((0, 2, 3)), sigma=0.1
    )
    raw, ground_view = (
        GroundMapper(smoothing=width).explain(view).ground_view.points[:, 0]
        for width in (0.0, 0.25)
    )
    assert np.std(raw) > 0.08
    assert np.std(ground_view) < np.std(raw) / 2
    chosen = GroundMapper()
    npt.assert_array_equal(
        chosen.explain(view).ground_view.points,
        smooth_features(flatten(view, chosen.settings), chosen.settings).points,
    )


def test_an_empty_view_adds_only_a_pose() -> None:
    rng = np.random.default_rng(6)
    mapper = mapped([room_view(rng)])
    before = snapshot(mapper)
    nothing = view_of(np.empty((0, 3)), np.empty((0, 2, 3)), pose=pose_at(90.0, 3.0, 0.5))
    mapper.integrate(nothing)
    after = snapshot(mapper)
    assert after.tiles == before.tiles
    npt.assert_allclose(after.trajectory, [*before.trajectory, [90.0, 3.0, 0.5]])
    assert after.stats == {**before.stats, "views": 2}


# Degenerate views: coordinates on a lattice, so that duplicates, collinear points, zero-length and
# vertical segments, and features right below the camera are all common.

lattice = st.integers(-2, 12).map(lambda i: i / 2)
heights = st.sampled_from([-2.0, -0.5, -0.1, 0.0, 0.05, 0.15, 0.5, 1.0, 1.5, 2.0, 2.5, 4.0])
places = st.tuples(lattice, st.integers(-6, 6).map(lambda i: i / 2), heights)
segment_places = st.one_of(
    st.tuples(places, places),
    places.map(lambda p: (p, p)),  # no length
    st.tuples(places, heights).map(lambda p: (p[0], (*p[0][:2], p[1]))),  # vertical
)
sigmas = st.sampled_from([0.0, 1e-6, 0.05, 3.0])
A = (2.0, 0.0, 0.5)


@given(
    st.lists(places, max_size=8),
    st.lists(segment_places, max_size=5),
    st.sampled_from([0.0, 30.0, 45.0, -30.0]),
    sigmas,
    st.sampled_from(["ellipsoid", "gaussian", "radius", "none"]),
)
@settings(max_examples=300)
@example([], [], 0.0, 0.05, "ellipsoid")
@example([A], [], 0.0, 0.05, "ellipsoid")
@example([A, (3.0, 1.0, 0.5)], [], 0.0, 0.05, "ellipsoid")
@example([(2.0, y / 2, 0.5) for y in range(-4, 5)], [], 0.0, 0.05, "ellipsoid")  # across
@example([(x / 2, 0.0, 0.5) for x in range(2, 9)], [], 0.0, 0.05, "ellipsoid")  # along the axis
@example([A] * 6, [(A, (3.0, 1.0, 0.5))] * 3, 0.0, 0.05, "ellipsoid")  # duplicates
@example([], [(A, A)], 0.0, 0.05, "ellipsoid")  # no length
@example([], [((2.0, 0.0, 0.0), (2.0, 0.0, 4.0))], 0.0, 0.05, "ellipsoid")  # vertical
@example([], [((-0.5, 0.0, 0.0), (0.5, 0.0, 0.0))], 45.0, 0.05, "ellipsoid")  # below the camera
# Ends right below the camera, as ground, as an obstacle, and beside another surface.
@example([], [((0.0, 0.0, -2.0), (0.0, 0.0, -2.0))], 30.0, 3.0, "ellipsoid")
@example([], [((0.0, 0.0, -0.1), (0.0, 0.0, 0.5))], 30.0, 0.0, "ellipsoid")
@example([], [((0.0, 0.0, -2.0), (0.0, 0.0, 0.5))], 30.0, 0.0, "ellipsoid")
@example(
    [],
    [((0.0, 0.0, -2.0), (0.5, 0.0, 0.5)), ((0.0, 0.0, 0.0), (0.0, 0.5, -2.0))],
    30.0,
    0.0,
    "ellipsoid",
)
@example([(0.5, 0.0, 2.5)], [], 0.0, 3.0, "ellipsoid")  # overhead, and as uncertain as high
# Many that may be one surface, each of them so unsure that it may be anywhere.
@example([(x / 2, y / 8, 1.0) for x in (2, 6, 12) for y in range(-3, 4)], [], 0.0, 3.0, "ellipsoid")
def test_no_view_is_too_degenerate_to_be_mapped_and_accounted_for(
    points: list[tuple[float, float, float]],
    segments: list[tuple[tuple[float, float, float], tuple[float, float, float]]],
    pitch: float,
    sigma: float,
    uncertainty: str,
) -> None:
    view = view_of(
        np.array(points).reshape(-1, 3),
        np.array(segments).reshape(-1, 2, 3),
        seen_by=rig(pitch=pitch),
        sigma=sigma,
    )
    mapper = mapped([view], uncertainty=uncertainty, resolution=0.25)
    stats = mapper.stats
    assert stats.features_used + stats.features_dropped.total() == len(points) + len(segments)
    window = mapper.grid.window()
    assert np.isfinite(window.confidence).all()
    assert (np.abs(window.confidence) <= 1.0).all()
    assert (window.count <= 1).all()
    npt.assert_array_equal(window.confidence != 0, window.count == 1)


@pytest.mark.parametrize("n", [1, 2])
def test_a_single_obstacle_or_two_make_nonfree_cells(n: int) -> None:
    points = np.array([(3.0, 0.05, 0.5), (3.0, 0.35, 0.5)])[:n]
    grid = mapped([view_of(points, np.empty((0, 2, 3)))], resolution=0.1).grid
    values = grid.confidence_at(points[:, :2])
    npt.assert_array_equal(values, np.ones(n))
    # Before it, sight passes over the ground at 0.5 m or more: the least sure.
    assert grid.confidence_at((2.45, 0.1 * n - 0.05)) == pytest.approx(-0.25)
    assert grid.count_at((4.5, 0.05)) == 0


def test_features_seen_through_a_surface_are_counted_once_each() -> None:
    # A beam just below the camera's height; a kerb and two stones behind it are seen below it.
    wall = np.array([[(3.0, -2.0, 1.4), (3.0, 2.0, 1.4)]])
    kerb = np.array([[(6.0, -1.0, 0.0), (6.0, 1.0, 0.0)]])
    stones = np.array([(7.0, 0.2, 0.0), (8.0, -0.2, 0.0), (2.0, 0.0, 0.0)])
    mapper = mapped([view_of(stones, np.concatenate([wall, kerb]))])
    assert mapper.stats.seen_through == 3


def test_a_vertical_segment_is_an_obstacle_where_it_stands() -> None:
    pole = np.array([[(3.0, 0.05, 0.0), (3.0, 0.05, 3.0)]])
    mapper = mapped([view_of(np.empty((0, 3)), pole)], resolution=0.1)
    assert mapper.grid.confidence_at((3.0, 0.05)) == 1.0
    assert mapper.stats.features_used == 1


def test_a_pole_nearer_than_min_range_is_no_obstacle() -> None:
    # As a point there is none: a disc at the viewpoint would hide half the view.
    pole = np.array([[(0.1, 0.0, 0.2), (0.1, 0.0, 0.6)]])
    grid = mapped([view_of(np.empty((0, 3)), pole, seen_by=rig(pitch=45.0))]).grid
    assert grid.area(CellState.NONFREE) == 0.0


def test_features_dropped_by_the_view_are_in_the_figures() -> None:
    seen_by = rig()
    view = View.from_pixels(
        np.eye(4),
        seen_by,
        points_px=[(320, 320, 240), (np.nan, 0, 0), (355, 320, 275), (355, 352, 20)],
        segments_px=[[(320, 320, 240), (355, 320, 275)]],
    ).with_plane(GROUND)
    stats = mapped([view], max_range=15.0).stats
    assert stats.features_dropped == {"no_disparity": 2, "not_finite": 1, "out_of_range": 1}
    assert stats.features_used == 1


def test_drop_offs_are_nonfree_and_counted_once_per_view() -> None:
    hole = np.array([(3.1, 0.1, -1.0), (3.12, 0.11, -1.0)])
    view = view_of(hole, np.empty((0, 2, 3)))
    mapper = mapped([view] * 3, resolution=0.5)
    assert mapper.stats.features_dropped == {"below_ground": 6}
    # From 1.5 m up, their lines of sight are below the ground's level from 1.86 m on.
    window = mapper.grid.window((1.0, -0.5, 3.5, 0.5))
    assert window.count.tolist() == [[0, 0, 0, 0, 0], [0, 3, 3, 3, 3]]
    npt.assert_array_equal(window.states() == CellState.NONFREE, window.count == 3)


@pytest.mark.parametrize("yaw", [0.0, 90.0, 180.0])
def test_the_trajectory_holds_poses_of_the_base_whatever_way_the_camera_looks(yaw: float) -> None:
    view = view_of(
        np.array([A]), np.empty((0, 2, 3)), pose=pose_at(3.0, -4.0, 0.7), seen_by=rig(yaw=yaw)
    )
    npt.assert_allclose(mapped([view]).grid.trajectory, [(3.0, -4.0, 0.7)])


def test_settings_reach_the_grid() -> None:
    mapper = GroundMapper(resolution=0.5, frame="odom", fusion="capped", cap=7)
    assert (mapper.grid.resolution, mapper.grid.frame) == (0.5, "odom")
    assert mapper.grid.rule == Capped(7)
    assert GroundMapper().grid.rule == Average()


def test_wrong_settings_are_refused_by_name() -> None:
    with pytest.raises(SettingsError, match=r"^fuson: .* Did you mean 'fusion'\?"):
        GroundMapper(fuson="capped")
    with pytest.raises(SettingsError, match=r"^resolution: expected greater than 0"):
        GroundMapper(resolution=0)
    assert issubclass(SettingsError, GroundmapError)


def test_capped_mapping_forgets_an_obstacle_that_has_gone() -> None:
    # Once it has gone, the ground is seen where it stood.
    there = view_of(np.array([(3.0, 0.05, 0.5), (6.0, 0.05, 0.0)]), np.empty((0, 2, 3)))
    gone = view_of(np.array([(3.1, 0.05, 0.0)]), np.empty((0, 2, 3)))
    views = [there] * 30 + [gone] * 8  # 0.7 cap = 7 views turn the sign
    forgets = mapped(views, fusion="capped", cap=10, resolution=0.1).grid
    keeps = mapped(views, resolution=0.1).grid
    assert forgets.confidence_at((3.0, 0.05)) < -0.01
    assert keeps.confidence_at((3.0, 0.05)) > 0.5
