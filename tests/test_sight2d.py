"""The sight fan: equal to the visibility region, ordered, without overlap or gap at the seam."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.heights import FlatView
from groundmap.settings import MapperSettings
from groundmap.sight2d import NO_SURFACE, SightFan, seen_through, visible_freespace
from groundmap.surfaces import Surfaces, find_surfaces
from groundmap.triangulation import triangulate
from oracles import (
    inverse_ranges,
    support_chords,
    symmetric_difference,
    triangles_of,
    visible_region,
)
from strategies import Cloud, flat_view, rngs, rooms

EXACT = MapperSettings(uncertainty="none")
UNLINKED = MapperSettings(uncertainty="none", link_length=0.0, link_angle=0.0)
SPREAD = MapperSettings(uncertainty="ellipsoid")
AREA = 1e-7  # [m²]


def seen(flat: FlatView, options: MapperSettings = EXACT) -> tuple[SightFan, Surfaces]:
    surfaces = find_surfaces(flat, triangulate(flat.points, flat.segments), options)
    return visible_freespace(flat, surfaces, options), surfaces


def region(flat: FlatView, surfaces: Surfaces, options: MapperSettings = EXACT) -> shapely.Geometry:
    chords = support_chords(flat.supports, options.support_width, options.support_angle)
    return visible_region(surfaces.ends, chords)


def ground(rng: np.random.Generator) -> Floats:
    """Ground features on all sides."""
    supports = rng.uniform(-12.0, 12.0, size=(rng.integers(0, 20), 2))
    beyond: Floats = supports[np.hypot(*supports.T) > 0.3]
    return beyond


@settings(max_examples=150)
@given(rooms(), rngs())
def test_the_fan_is_the_visible_region(room: Cloud, rng: np.random.Generator) -> None:
    flat = flat_view(room.points, room.segments, supports=ground(rng))
    fan, surfaces = seen(flat)
    visible = region(flat, surfaces)
    assert symmetric_difference(shapely.union_all(triangles_of(fan)), visible) < AREA
    assert fan.area == pytest.approx(visible.area, abs=AREA)


@settings(max_examples=60)
@given(rngs())
def test_the_fan_of_links_and_discs_is_the_visible_region(rng: np.random.Generator) -> None:
    points = rng.uniform(-4.0, 4.0, size=(rng.integers(1, 60), 2))
    points = points[np.hypot(*points.T) > 0.4]
    flat = flat_view(points, supports=ground(rng))
    fan, surfaces = seen(flat)
    visible = region(flat, surfaces)
    assert symmetric_difference(shapely.union_all(triangles_of(fan)), visible) < AREA


@settings(max_examples=100)
@given(rngs())
def test_ground_alone_is_seen_as_far_as_it_was_seen(rng: np.random.Generator) -> None:
    flat = flat_view(supports=ground(rng))
    fan, surfaces = seen(flat)
    visible = region(flat, surfaces)
    assert symmetric_difference(shapely.union_all(triangles_of(fan)), visible) < AREA
    assert (fan.surface == NO_SURFACE).all()


@settings(max_examples=100)
@given(rooms(), rngs())
def test_triangles_do_not_overlap(room: Cloud, rng: np.random.Generator) -> None:
    fan, _ = seen(flat_view(room.points, room.segments, supports=ground(rng)))
    triangles = triangles_of(fan)
    alone = sum(triangle.area for triangle in triangles)
    assert alone == pytest.approx(shapely.union_all(triangles).area, abs=AREA)
    assert alone == pytest.approx(fan.area, abs=AREA)


@settings(max_examples=100)
@given(rooms(), rngs())
def test_triangles_are_in_the_order_of_bearings(room: Cloud, rng: np.random.Generator) -> None:
    fan, _ = seen(flat_view(room.points, room.segments, supports=ground(rng)))
    low, high = fan.bearings.T
    assert (low < high).all()
    assert (high[:-1] <= low[1:]).all()
    assert ((low >= -np.pi) & (high <= np.pi)).all()
    bearings = np.arctan2(fan.ends[..., 1], fan.ends[..., 0])
    off = np.abs(np.angle(np.exp(1j * (bearings - fan.bearings))))
    assert off.max(initial=0.0) < 1e-12


@settings(max_examples=100)
@given(rooms(), rngs())
def test_joined_triangles_meet_and_the_others_leave_a_gap(
    room: Cloud, rng: np.random.Generator
) -> None:
    fan, _ = seen(flat_view(room.points, room.segments, supports=ground(rng)))
    following = np.roll(fan.bearings[:, 0], -1)
    following[-1:] += 2 * np.pi
    gap = following - fan.bearings[:, 1]
    assert fan.joined[gap <= 4e-16].all()
    assert not fan.joined[gap > 1e-12].any()


@settings(max_examples=100)
@given(rngs(), st.booleans())
def test_walls_all_around_leave_no_gap_at_the_seam(
    rng: np.random.Generator, corner_on_seam: bool
) -> None:
    bearing = np.sort(np.append(rng.uniform(-np.pi, np.pi, size=8), (-2.0, 0.0, 2.0)))
    corners = rng.uniform(1.0, 9.0, size=(len(bearing), 1)) * np.stack(
        [np.cos(bearing), np.sin(bearing)], axis=1
    )
    if corner_on_seam:
        corners = np.concatenate([corners, [(-5.0, 0.0)]])
    row = np.arange(len(corners))
    flat = flat_view(corners, np.stack([row, np.roll(row, -1)], axis=1), supports=ground(rng))
    fan, _ = seen(flat, UNLINKED)
    assert fan.joined.all()
    assert (fan.surface != NO_SURFACE).all()
    assert fan.bearings[0, 0] == -np.pi
    assert fan.bearings[-1, 1] == np.pi
    np.testing.assert_array_equal(fan.ends[0, 0], fan.ends[-1, 1])
    assert fan.area == pytest.approx(shapely.Polygon(corners).area)


@settings(max_examples=100)
@given(rooms(), rngs(), st.floats(-np.pi, np.pi))
def test_where_the_seam_lies_changes_nothing(
    room: Cloud, rng: np.random.Generator, yaw: float
) -> None:
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    supports = ground(rng)
    mesh = triangulate(room.points, room.segments)
    here = flat_view(room.points, room.segments, supports=supports)
    there = flat_view(room.points @ turn, room.segments, supports=supports @ turn)
    turned = mesh._replace(points=mesh.points @ turn)
    areas = [
        visible_freespace(flat, find_surfaces(flat, twin, EXACT), EXACT).area
        for flat, twin in ((here, mesh), (there, turned))
    ]
    assert areas[0] == pytest.approx(areas[1], abs=1e-6)


def test_an_edge_across_the_seam_is_seen_whole() -> None:
    fan, _ = seen(flat_view([(-2, 1), (-4, -3)], [(0, 1)]))
    assert fan.bearings[[0, -1], [0, 1]].tolist() == [-np.pi, np.pi]
    assert fan.area == pytest.approx(shapely.Polygon([(0, 0), (-2, 1), (-4, -3)]).area)
    assert fan.joined.tolist() == [False, True]


def test_a_disc_hides_what_is_behind_it() -> None:
    flat = flat_view([(2, 0), (6, -4), (6, 4)], [(1, 2)])
    fan, surfaces = seen(flat)
    cell = EXACT.resolution
    assert fan.area == pytest.approx(24.0 - (6.0**2 - 2.0**2) / 2.0 * (cell / 2.0))
    assert sorted(surfaces.kind[fan.surface].tolist()) == [0, 0, 2]


def test_an_edge_seen_end_on_counts_by_its_nearer_end() -> None:
    fan, surfaces = seen(flat_view([(5, 0), (2, 0)], [(0, 1)]))
    assert len(fan.ends) == 1
    np.testing.assert_allclose(fan.ends[0].mean(axis=0), (2.0, 0.0))
    assert surfaces.discs[fan.surface[0]] == pytest.approx(EXACT.resolution / 2.0)


def test_an_edge_through_the_viewpoint_is_seen_where_it_leaves_the_near_range() -> None:
    fan, surfaces = seen(flat_view([(-3, 0), (5, 0)], [(0, 1)]))
    middles = np.sort(fan.ends.mean(axis=1)[:, 0])
    assert np.abs(middles[[0, -1]]) == pytest.approx([EXACT.min_range, EXACT.min_range], abs=0.01)
    assert surfaces.through_viewpoint == 0


def test_nothing_seen_says_nothing() -> None:
    fan, surfaces = seen(flat_view())
    assert len(fan.bearings) == len(fan.joined) == len(surfaces.ends) == 0
    assert fan.area == 0.0


@pytest.mark.parametrize(("radius", "half"), [(3.0, 0.05), (12.0, 0.3 / 12.0)])
def test_a_ground_feature_supports_its_bearings_out_to_its_range(
    radius: float, half: float
) -> None:
    fan, _ = seen(flat_view(supports=[(radius, 0.0)]))
    np.testing.assert_allclose(fan.bearings, [(-half, half)])
    np.testing.assert_allclose(np.hypot(*fan.ends[0].T), radius)


def test_support_ends_at_a_nearer_surface_and_does_not_reach_beyond() -> None:
    fan, _ = seen(flat_view([(4, -1), (4, 1)], [(0, 1)], supports=[(8.0, 0.0), (0.0, 5.0)]))
    assert fan.surface.tolist() == [0, NO_SURFACE]
    assert fan.ends[0, :, 0].max() == pytest.approx(4.0)


def test_frontiers_grant_nothing_and_bound_nothing() -> None:
    fan, surfaces = seen(flat_view([(6, -2), (6, 2)]))
    assert len(surfaces.frontiers) == 1
    assert fan.joined.tolist() == [False, False]
    assert fan.area < 2.0 * 0.5 * np.hypot(6.0, 2.0) * EXACT.resolution * 1.001


def uncertain(room: Cloud, rng: np.random.Generator) -> FlatView:
    """A room with variances that grow with range, as a stereo rig's do, and some of 0."""
    square_range = (room.points**2).sum(axis=1)
    sigma = 0.005 * square_range * rng.uniform(0.0, 2.0, size=len(room.points))
    return flat_view(room.points, room.segments, covariance=sigma**2, supports=ground(rng))


@settings(max_examples=100)
@given(rooms(), rngs())
def test_freespace_ends_a_reach_before_the_surface(room: Cloud, rng: np.random.Generator) -> None:
    fan, surfaces = seen(uncertain(room, rng), SPREAD)
    for ends, free, row in zip(fan.ends, fan.free, fan.surface, strict=True):
        if row == NO_SURFACE:
            np.testing.assert_array_equal(free, ends)
            continue
        first, last = surfaces.ends[row]
        share = np.hypot(*(ends - first).T) / np.hypot(*(last - first))
        reach = surfaces.reach[row] @ np.stack([1.0 - share, share])
        radius = np.hypot(*ends.T)
        expected = ends * (np.maximum(radius - reach, 0.0) / radius)[:, None]
        np.testing.assert_allclose(free, expected, rtol=0, atol=1e-8)


@settings(max_examples=100)
@given(rooms(), rngs())
def test_freespace_is_never_behind_a_surface(room: Cloud, rng: np.random.Generator) -> None:
    fan, surfaces = seen(uncertain(room, rng), SPREAD)
    assume(len(surfaces.ends) > 0)
    share = rng.uniform(size=(len(fan.free), 5, 1))
    places = fan.free[:, None, 0] * (1.0 - share) + fan.free[:, None, 1] * share
    places = places.reshape(-1, 2)
    radius = np.hypot(*places.T)
    places, radius = places[radius > 1e-6], radius[radius > 1e-6]
    inverse = inverse_ranges(surfaces.ends, np.arctan2(places[:, 1], places[:, 0])).max(axis=0)
    with np.errstate(divide="ignore"):
        nearest = np.where(inverse > 0, 1.0 / np.maximum(inverse, 0.0), np.inf)
    assert (radius <= nearest * (1 + 1e-9)).all()


# A hedge or a ghost 4 m ahead, a wall 8 m ahead; the camera is 1 m up.
AHEAD = [(4.0, -1.0), (4.0, 1.0), (8.0, -3.0), (8.0, 3.0)]
TWO_WALLS = [(0, 1), (2, 3)]


def count_seen_through(
    heights: list[float], extra: list[tuple[float, float]], extra_heights: list[float]
) -> int:
    """Count for two walls with those tops and points beside them."""
    flat = flat_view(AHEAD + extra, TWO_WALLS, heights=heights + extra_heights)
    fan, surfaces = seen(flat)
    return seen_through(flat, fan, surfaces)


def test_a_wall_seen_over_a_hedge_is_not_seen_through_it() -> None:
    # From 1.0 m up, over a hedge of 0.5 m, the ray at 8 m is at or above 0 m.
    assert count_seen_through([0.5, 0.5, 1.8, 1.8], [(8.0, 0.0)], [0.2]) == 0


def test_a_wall_seen_through_a_ghost_is_counted_once_per_feature() -> None:
    # The ray to a point 1.4 m up is at 1.2 m where the ghost is 1.8 m high.
    assert count_seen_through([1.8, 1.8, 1.8, 1.8], [(8.0, 0.0)], [1.4]) == 1
    through = [(8.0, -0.5), (8.0, 0.0), (8.0, 0.5)]
    assert count_seen_through([1.8, 1.8, 1.8, 1.8], through, [1.4, 1.4, 1.4]) == 3


def test_a_segment_seen_through_a_ghost_is_one_feature() -> None:
    flat = flat_view(
        [*AHEAD, (7.0, -0.5), (7.0, 0.5)], [*TWO_WALLS, (4, 5)], heights=[1.8] * 4 + [1.2] * 2
    )
    assert seen_through(flat, *seen(flat)) == 1


@pytest.mark.parametrize(("height", "count"), [(0.99, 1), (1.01, 0)])
def test_the_line_of_sight_is_compared_with_the_top_where_it_passes(
    height: float, count: int
) -> None:
    # A top that falls from 1.5 m to 0.5 m is 1.0 m high in the middle, where a ray to a point
    # of `height` at twice the range passes at the mean of 1.0 m and `height`.
    assert count_seen_through([1.5, 0.5, 1.8, 1.8], [(8.0, 0.0)], [height]) == count


def test_features_beside_or_in_front_of_a_surface_are_not_seen_through_it() -> None:
    assert count_seen_through([1.8] * 4, [(2.0, 0.0), (8.0, 2.5), (4.0, 0.0)], [0.5] * 3) == 0


def test_ground_seen_through_a_wall_is_counted() -> None:
    flat = flat_view(AHEAD[:2], TWO_WALLS[:1], heights=1.5, supports=[(6.0, 0.0), (3.0, 0.0)])
    fan, surfaces = seen(flat)
    assert seen_through(flat, fan, surfaces) == 1


def test_ground_seen_over_a_kerb_is_not_seen_through_it() -> None:
    flat = flat_view(AHEAD[:2], TWO_WALLS[:1], heights=0.2, supports=[(6.0, 0.0)])
    fan, surfaces = seen(flat)
    assert seen_through(flat, fan, surfaces) == 0


def test_nothing_is_seen_through_without_surfaces() -> None:
    flat = flat_view(supports=[(6.0, 0.0), (3.0, 0.0)])
    fan, surfaces = seen(flat)
    assert seen_through(flat, fan, surfaces) == 0
    empty = flat_view()
    assert seen_through(empty, *seen(empty)) == 0
