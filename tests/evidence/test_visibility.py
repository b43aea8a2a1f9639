"""The sight fan: equal to the visibility region, ordered, without overlap or gap at the seam."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, Surfaces, find_surfaces
from groundmap.evidence.ground_plane.visibility import NO_SURFACE, SightFan, visible_freespace
from groundmap.evidence.triangulation import triangulate
from groundmap.settings import MapperSettings
from oracles import (
    counted_against,
    farthest,
    gap_chords,
    inverse_ranges,
    sight_ranges,
    support_chords,
    symmetric_difference,
    triangles_of,
    usual_gap,
    visible_region,
)
from strategies import Cloud, flat_view, rngs, rooms

SHARP = MapperSettings(uncertainty="none")
EXACT = MapperSettings(uncertainty="none", doubt=1.0, halo=0.0)  # every surface is believed
UNLINKED = MapperSettings(uncertainty="none", link_length=0.0, link_angle=0.0, halo=0.0)
UNBRIDGED = MapperSettings(uncertainty="none", doubt=1.0, halo=0.0, sight_gap=0.0)
SPREAD = MapperSettings(uncertainty="ellipsoid")
AREA = 1e-7  # [m²]


def seen(ground_view: GroundView, options: MapperSettings = EXACT) -> tuple[SightFan, Surfaces]:
    surfaces = find_surfaces(
        ground_view, triangulate(ground_view.points, ground_view.segments), options
    )
    return visible_freespace(ground_view, surfaces, options), surfaces


def low_view(
    points: npt.ArrayLike = (), segments: npt.ArrayLike = (), supports: npt.ArrayLike = ()
) -> GroundView:
    """View of surfaces at ground level: all grant freespace, and nothing is seen through them."""
    return flat_view(points, segments, supports=supports, heights=0.0)


def chords_of(ground_view: GroundView, options: MapperSettings) -> Floats:
    """How far ground support reaches: single ground features, and gaps between lines of sight."""
    lines = np.concatenate([ground_view.supports, ground_view.points])
    ray = ground_view.points / np.hypot(*ground_view.points.T)[:, None]
    sigma = np.sqrt(((ray[:, None] @ ground_view.covariance)[:, 0] * ray).sum(axis=1))
    if options.uncertainty == "none":
        sigma[:] = 0.0
    ranges = np.hypot(*lines.T) - np.append(np.zeros(len(ground_view.supports)), 2.0 * sigma)
    low = np.append(
        np.full(len(ground_view.supports), True),
        ground_view.heights <= 0.5 * ground_view.camera_height,
    )
    low &= ranges > options.min_range
    bearings = np.arctan2(lines[low, 1], lines[low, 0])
    return np.concatenate(
        [
            support_chords(ground_view, options.support_width, options.support_angle),
            gap_chords(
                bearings,
                ranges[low],
                usual_gap(bearings, ranges[low], options.support_width, options.sight_gap),
            ),
        ]
    )


def region(
    ground_view: GroundView, surfaces: Surfaces, options: MapperSettings = EXACT
) -> shapely.Geometry:
    """What is seen if every surface hides, and grants."""
    return visible_region(surfaces.ends, chords_of(ground_view, options))


def ground(rng: np.random.Generator) -> Floats:
    """Ground features on all sides."""
    supports = rng.uniform(-12.0, 12.0, size=(rng.integers(0, 20), 2))
    beyond: Floats = supports[np.hypot(*supports.T) > 0.3]
    return beyond


def uncertain(room: Cloud, rng: np.random.Generator) -> GroundView:
    """A room with variances that grow with range, as a stereo rig's do, and low and high walls."""
    square_range = (room.points**2).sum(axis=1)
    sigma = 0.005 * square_range * rng.uniform(0.0, 2.0, size=len(room.points))
    return flat_view(
        room.points,
        room.segments,
        heights=rng.uniform(0.0, 1.5, size=len(room.points)),
        covariance=sigma**2,
        supports=ground(rng),
    )


@settings(max_examples=150)
@given(rooms(), rngs())
def test_the_fan_is_the_visible_region(room: Cloud, rng: np.random.Generator) -> None:
    ground_view = low_view(room.points, room.segments, ground(rng))
    fan, surfaces = seen(ground_view)
    visible = region(ground_view, surfaces)
    assert symmetric_difference(shapely.union_all(triangles_of(fan)), visible) < AREA
    assert fan.area == pytest.approx(visible.area, abs=AREA)


@settings(max_examples=60)
@given(rngs())
def test_the_fan_of_links_and_discs_is_the_visible_region(rng: np.random.Generator) -> None:
    points = rng.uniform(-4.0, 4.0, size=(rng.integers(1, 60), 2))
    points = points[np.hypot(*points.T) > 0.4]
    ground_view = low_view(points, supports=ground(rng))
    fan, surfaces = seen(ground_view)
    visible = region(ground_view, surfaces)
    assert symmetric_difference(shapely.union_all(triangles_of(fan)), visible) < AREA


MADE_OF = np.array([2.0, 2.0, 1.0, 1.0])  # features: segment, link, lone point, doubtful link


@settings(max_examples=100)
@given(rooms(), rngs(), st.sampled_from([SHARP, SPREAD]))
def test_freespace_is_seen_as_far_as_walls_and_lines_of_sight_let_it(
    room: Cloud, rng: np.random.Generator, options: MapperSettings
) -> None:
    ground_view = uncertain(room, rng)
    fan, surfaces = seen(ground_view, options)
    hides = fan.contradictions.hiding
    # A feature right behind the end of a surface may be counted or not.
    fewest, most = (counted_against(ground_view, surfaces, slack)[0] for slack in (-1e-9, 1e-9))
    assert (hides <= (fewest <= MADE_OF[surfaces.kind])).all()
    assert (hides >= (most <= MADE_OF[surfaces.kind])).all()
    assert hides[fan.surface[fan.surface != NO_SURFACE]].all()
    grants = (surfaces.bottoms.min(axis=1) <= 0.5) & (surfaces.kind != SurfaceKind.DOUBTFUL)
    bearings = rng.uniform(-np.pi, np.pi, size=500)
    expected = sight_ranges(
        surfaces.ends[hides], grants[hides], chords_of(ground_view, options), bearings
    )
    np.testing.assert_allclose(farthest(fan.ends, bearings), expected, rtol=1e-6)


@settings(max_examples=100)
@given(rngs())
def test_ground_alone_is_seen_as_far_as_it_was_seen(rng: np.random.Generator) -> None:
    ground_view = flat_view(supports=ground(rng))
    fan, surfaces = seen(ground_view)
    visible = region(ground_view, surfaces)
    assert symmetric_difference(shapely.union_all(triangles_of(fan)), visible) < AREA
    assert (fan.surface == NO_SURFACE).all()


@settings(max_examples=100)
@given(rooms(), rngs())
def test_triangles_do_not_overlap(room: Cloud, rng: np.random.Generator) -> None:
    fan, _ = seen(uncertain(room, rng))
    triangles = triangles_of(fan)
    alone = sum(triangle.area for triangle in triangles)
    assert alone == pytest.approx(shapely.union_all(triangles).area, abs=AREA)
    assert alone == pytest.approx(fan.area, abs=AREA)


@settings(max_examples=100)
@given(rooms(), rngs())
def test_triangles_are_in_the_order_of_bearings(room: Cloud, rng: np.random.Generator) -> None:
    fan, _ = seen(uncertain(room, rng))
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
    fan, _ = seen(uncertain(room, rng))
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
    ground_view = low_view(corners, np.stack([row, np.roll(row, -1)], axis=1), ground(rng))
    fan, _ = seen(ground_view, UNLINKED)
    assert fan.joined.all()
    assert (fan.surface != NO_SURFACE).all()
    assert fan.bearings[0, 0] == -np.pi
    assert fan.bearings[-1, 1] == np.pi
    np.testing.assert_array_equal(fan.ends[0, 0], fan.ends[-1, 1])
    assert fan.area == pytest.approx(shapely.Polygon(corners).area)


@settings(max_examples=100)
@given(rooms(), st.floats(-np.pi, np.pi))
def test_where_the_seam_lies_changes_nothing(room: Cloud, yaw: float) -> None:
    # Lines of sight know no neighbour beyond the seam, and images none behind the camera.
    here = low_view(room.points, room.segments)
    assert turned_area(here, yaw, UNBRIDGED) == pytest.approx(turned_area(here, 0.0, UNBRIDGED))


@settings(max_examples=100)
@given(rooms(), rngs(), st.floats(-1.0, 1.0))
def test_ahead_of_the_seam_the_way_the_camera_looks_changes_nothing(
    room: Cloud, rng: np.random.Generator, yaw: float
) -> None:
    ground_view = uncertain(room, rng)
    ahead = [abs_bearing(ground_view.points[pair]).max() < 1.5 for pair in ground_view.segments]
    lone = np.setdiff1d(np.arange(len(ground_view.points)), ground_view.segments)
    lone = lone[abs_bearing(ground_view.points[lone]) < 1.5]
    rows = np.concatenate([ground_view.segments[ahead].reshape(-1), lone])
    supports = ground_view.supports[abs_bearing(ground_view.supports) < 0.5]  # no border comes near
    here = flat_view(
        ground_view.points[rows],
        np.arange(2 * sum(ahead)).reshape(-1, 2),
        heights=ground_view.heights[rows],
        covariance=ground_view.covariance[rows],
        supports=supports,
    )
    assert turned_area(here, yaw, SPREAD) == pytest.approx(turned_area(here, 0.0, SPREAD))


def abs_bearing(xy: Floats) -> Floats:
    bearing: Floats = np.abs(np.arctan2(xy[:, 1], xy[:, 0]))
    return bearing


def turned_area(ground_view: GroundView, yaw: float, options: MapperSettings) -> float:
    """Area seen of the same mesh by a camera that is turned."""
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    mesh = triangulate(ground_view.points, ground_view.segments)
    turned = ground_view._replace(
        points=ground_view.points @ turn,
        supports=ground_view.supports @ turn,
        covariance=turn.T @ ground_view.covariance @ turn,
    )
    surfaces = find_surfaces(turned, mesh._replace(points=mesh.points @ turn), options)
    return visible_freespace(turned, surfaces, options).area


def test_an_edge_across_the_seam_is_seen_whole() -> None:
    fan, _ = seen(low_view([(-2, 1), (-4, -3)], [(0, 1)]))
    assert fan.bearings[[0, -1], [0, 1]].tolist() == [-np.pi, np.pi]
    assert fan.area == pytest.approx(shapely.Polygon([(0, 0), (-2, 1), (-4, -3)]).area)
    assert fan.joined.tolist() == [False, True]


def test_a_disc_hides_what_is_behind_it() -> None:
    ground_view = low_view([(2, 0), (6, -4), (6, 4)], [(1, 2)])
    fan, surfaces = seen(ground_view)
    cell = EXACT.resolution
    assert fan.area == pytest.approx(24.0 - (6.0**2 - 2.0**2) / 2.0 * (cell / 2.0))
    assert sorted(surfaces.kind[fan.surface].tolist()) == [0, 0, 2]


@settings(max_examples=60)
@given(rngs())
def test_a_low_lone_point_grants_all_that_is_before_its_disc(rng: np.random.Generator) -> None:
    place = rng.uniform((1.0, -4.0), (9.0, 4.0))
    fan, surfaces = seen(flat_view([place], heights=0.3), SHARP)
    # Beside it is what is doubtful, which grants nothing.
    half = np.arctan2(SHARP.resolution / 2.0, np.hypot(*place))
    assert np.diff(fan.bearings).sum() == pytest.approx(2 * half)
    assert (surfaces.kind[fan.surface] == SurfaceKind.LONE).all()


def test_an_edge_seen_end_on_counts_by_its_nearer_end() -> None:
    fan, surfaces = seen(low_view([(5, 0), (2, 0)], [(0, 1)]))
    assert len(fan.ends) == 1
    np.testing.assert_allclose(fan.ends[0].mean(axis=0), (2.0, 0.0))
    assert surfaces.discs[fan.surface[0]] == pytest.approx(EXACT.resolution / 2.0)


def test_an_edge_through_the_viewpoint_is_seen_where_it_leaves_the_near_range() -> None:
    fan, surfaces = seen(low_view([(-3, 0), (5, 0)], [(0, 1)]))
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
    ground_view = low_view([(4, -1), (4, 1)], [(0, 1)], [(8.0, 0.0), (0.0, 5.0)])
    fan, _ = seen(ground_view, UNBRIDGED)
    assert fan.surface.tolist() == [0, NO_SURFACE]
    assert fan.ends[0, :, 0].max() == pytest.approx(4.0)


def test_frontiers_grant_nothing_and_bound_nothing() -> None:
    fan, surfaces = seen(low_view([(6, -2), (6, 2)]), UNBRIDGED)
    assert len(surfaces.frontiers) == 1
    assert fan.joined.tolist() == [False, False]
    assert fan.area < 2.0 * 0.5 * np.hypot(6.0, 2.0) * EXACT.resolution * 1.001


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
def test_freespace_is_never_behind_a_surface_that_hides(
    room: Cloud, rng: np.random.Generator
) -> None:
    fan, surfaces = seen(uncertain(room, rng), SPREAD)
    assume(len(surfaces.ends) > 0)
    # In a triangle narrower than rounding, all places are right at the end of some surface.
    free = fan.free[np.diff(fan.bearings)[:, 0] > 1e-9]
    # So they are in one of which a whole side lies within the surface's reach.
    free = free[np.hypot(free[..., 0], free[..., 1]).min(axis=1, initial=np.inf) > 1e-6]
    share = rng.uniform(size=(len(free), 5, 1))
    places = free[:, None, 0] * (1.0 - share) + free[:, None, 1] * share
    places = places.reshape(-1, 2)
    radius = np.hypot(*places.T)
    places, radius = places[radius > 1e-6], radius[radius > 1e-6]
    # One that is seen end-on, at a single bearing, hides by its disc.
    hiding = surfaces.ends[fan.contradictions.hiding & (np.linalg.det(surfaces.ends) > 1e-9)]
    inverse = inverse_ranges(hiding, np.arctan2(places[:, 1], places[:, 0]))
    inverse = inverse.max(axis=0, initial=-np.inf)
    with np.errstate(divide="ignore"):
        nearest = np.where(inverse > 0, 1.0 / np.maximum(inverse, 0.0), np.inf)
    assert (radius <= nearest * (1 + 1e-9)).all()
