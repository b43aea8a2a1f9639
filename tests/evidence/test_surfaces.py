"""Which edges are surfaces: segments, believed links, lone discs; and what is known of them."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from groundmap.arrays import Floats
from groundmap.evidence.ground_plane.height_classes import GroundView, flatten
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, Surfaces, find_surfaces
from groundmap.evidence.triangulation import triangulate
from groundmap.settings import MapperSettings
from strategies import Cloud, flat_view, level_view, rngs, rooms

OPTIONS = MapperSettings(halo=0.0)  # mesh edges and lone points alone
HALOED = MapperSettings()


def surfaces_of(ground_view: GroundView, options: MapperSettings = OPTIONS) -> Surfaces:
    return find_surfaces(
        ground_view, triangulate(ground_view.points, ground_view.segments), options
    )


def of_kind(surfaces: Surfaces, kind: SurfaceKind) -> Floats:
    """Ends of the surfaces of that kind, shape (n, 2, 2)."""
    ends: Floats = surfaces.ends[surfaces.kind == kind]
    return ends


def pairs(ends: Floats) -> set[frozenset[tuple[float, float]]]:
    return {frozenset(map(tuple, pair)) for pair in ends.round(9).tolist()}


def longest_link(nearer: float, options: MapperSettings) -> float:
    return min(
        max(options.link_length, options.link_angle * nearer), 0.8 * options.narrowest_footprint
    )


@settings(max_examples=100)
@given(rngs(), st.sampled_from([0.5, 1.0, 2.5]), st.sampled_from([0.2, 0.5]))
def test_edges_are_links_by_length_range_and_height_and_frontiers_else(
    rng: np.random.Generator, footprint: float, link_height: float
) -> None:
    options = MapperSettings(narrowest_footprint=footprint, link_height=link_height, halo=0.0)
    points = rng.uniform((0.5, -4.0), (19.0, 4.0), size=(rng.integers(4, 80), 2))
    height = rng.uniform(0.2, 1.5, size=len(points))
    range_ = np.hypot(*points.T)
    corners = Delaunay(points).simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    links: set[frozenset[int]] = set()
    frontiers: set[frozenset[int]] = set()
    doubtful: set[frozenset[int]] = set()
    joined: set[int] = set()
    for a, b in {(min(pair), max(pair)) for pair in corners.tolist()}:
        length = np.hypot(*(points[a] - points[b]))
        longest = longest_link(min(range_[a], range_[b]), options)
        near_enough = length <= longest
        if near_enough and abs(height[a] - height[b]) <= link_height:
            links.add(frozenset([a, b]))
            joined.update((a, b))
        else:
            frontiers.add(frozenset([a, b]))
            if length <= 3 * longest:
                doubtful.add(frozenset([a, b]))
    surfaces = surfaces_of(flat_view(points, heights=height), options)
    ends = points.round(9)
    named = {tuple(place): row for row, place in enumerate(ends.tolist())}

    def rows(found: Floats) -> set[frozenset[int]]:
        return {frozenset(named[place] for place in pair) for pair in pairs(found)}

    assert rows(of_kind(surfaces, SurfaceKind.LINK)) == links
    assert rows(surfaces.frontiers) == frontiers
    assert rows(of_kind(surfaces, SurfaceKind.DOUBTFUL)) == doubtful
    lone = of_kind(surfaces, SurfaceKind.LONE).mean(axis=1).round(9)
    assert {named[tuple(place)] for place in lone.tolist()} == set(range(len(points))) - joined


@pytest.mark.parametrize(
    ("distance", "length", "footprint", "linked"),
    [
        (5.0, 0.49, 1.0, True),  # half a metre, near by
        (5.0, 0.51, 1.0, False),
        (17.5, 0.69, 1.0, True),  # 0.04 rad, far away
        (17.5, 0.72, 1.0, False),
        (19.9, 0.79, 0.8, False),  # 0.8 of the footprint, whatever the range
        (19.9, 0.63, 0.8, True),
        (5.0, 0.41, 0.5, False),
        (5.0, 0.39, 0.5, True),
    ],
)
def test_a_link_is_believed_up_to_its_bound(
    distance: float, length: float, footprint: float, linked: bool
) -> None:
    options = MapperSettings(narrowest_footprint=footprint, doubt=1, halo=0.0)
    surfaces = surfaces_of(flat_view([(distance, 0), (distance, length)]), options)
    kind = SurfaceKind.LINK if linked else SurfaceKind.LONE
    assert set(surfaces.kind.tolist()) == {kind}
    assert len(surfaces.frontiers) == (0 if linked else 1)


@pytest.mark.parametrize(
    ("distance", "length", "footprint", "doubt", "doubtful"),
    [
        (5.0, 0.51, 1.0, 3.0, True),
        (5.0, 1.49, 1.0, 3.0, True),  # three times half a metre
        (5.0, 1.51, 1.0, 3.0, False),
        (17.5, 2.09, 1.0, 3.0, True),  # three times 0.04 rad
        (17.5, 2.11, 1.0, 3.0, False),
        (5.0, 1.19, 0.5, 3.0, True),  # three times 0.8 of the footprint
        (5.0, 1.21, 0.5, 3.0, False),
        (5.0, 0.74, 1.0, 1.5, True),
        (5.0, 0.76, 1.0, 1.5, False),
    ],
)
def test_an_unbelieved_link_is_doubtful_up_to_a_multiple_of_its_bound(
    distance: float, length: float, footprint: float, doubt: float, doubtful: bool
) -> None:
    options = MapperSettings(narrowest_footprint=footprint, doubt=doubt, halo=0.0)
    ground_view = flat_view([(distance, 0), (distance, length)])
    surfaces = surfaces_of(ground_view, options)
    found = of_kind(surfaces, SurfaceKind.DOUBTFUL)
    assert pairs(found) == (pairs(ground_view.points[None]) if doubtful else set())
    assert len(of_kind(surfaces, SurfaceKind.LONE)) == 2  # to draw, its ends are alone
    assert len(surfaces.frontiers) == 1


def test_a_short_link_between_bands_that_do_not_overlap_is_doubtful() -> None:
    surfaces = surfaces_of(flat_view([(5, 0), (5, 0.4)], heights=[0.2, 0.8]))
    assert sorted(surfaces.kind.tolist()) == [SurfaceKind.LONE, SurfaceKind.LONE, 3]


@pytest.mark.parametrize(("depth", "linked"), [(0.69, True), (0.71, False)])
def test_the_nearer_end_sets_the_bound(depth: float, linked: bool) -> None:
    surfaces = surfaces_of(flat_view([(17.5, 0), (17.5 + depth, 0.02)]))
    assert (SurfaceKind.LINK in surfaces.kind) == linked


@pytest.mark.parametrize(
    ("band", "height", "linked"),
    [((0.2, 1.8), 1.0, True), ((0.2, 0.6), 1.05, True), ((0.2, 0.6), 1.15, False)],
)
def test_a_post_links_with_what_overlaps_its_height_band(
    band: tuple[float, float], height: float, linked: bool
) -> None:
    ground_view = flat_view([(5, 0), (5, 0), (5, 0.4)], [(0, 1)], heights=[*band, height])
    assert (SurfaceKind.LINK in surfaces_of(ground_view).kind) == linked


def test_a_segment_is_a_surface_however_long_and_whatever_its_heights() -> None:
    ground_view = flat_view([(5, -4), (9, 6)], [(0, 1)], heights=[0.2, 1.9])
    surfaces = surfaces_of(ground_view)
    assert pairs(of_kind(surfaces, SurfaceKind.SEGMENT)) == pairs(ground_view.points[None])
    assert len(surfaces.frontiers) == 0


@settings(max_examples=100)
@given(rooms())
def test_segments_are_kept_outside_the_near_range_and_only_there(room: Cloud) -> None:
    surfaces = surfaces_of(flat_view(room.points, room.segments))
    found = shapely.linestrings(of_kind(surfaces, SurfaceKind.SEGMENT))
    lines = shapely.linestrings(room.points[room.segments])
    given_lines = shapely.union_all(lines)
    near = shapely.Point(0, 0).buffer(OPTIONS.min_range, quad_segs=500)
    assert shapely.length(found).sum() == pytest.approx(
        shapely.difference(given_lines, near).length, abs=1e-3
    )
    assert (shapely.distance(found, shapely.Point(0, 0)) >= OPTIONS.min_range - 1e-9).all()
    corners = shapely.points(shapely.get_coordinates(found))
    assert (shapely.distance(corners, given_lines) < 1e-9).all()


@settings(max_examples=100)
@given(rooms())
def test_ends_turn_counter_clockwise_around_the_viewpoint(room: Cloud) -> None:
    surfaces = surfaces_of(flat_view(room.points, room.segments), HALOED)
    first, last = np.moveaxis(surfaces.ends, 1, 0)
    assert (first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0] >= 0).all()


def test_values_turn_with_the_ends() -> None:
    ground_view = flat_view(
        [(5, 2), (5, -2)], [(0, 1)], heights=[1.8, 0.4], covariance=[0.3**2, 0.1**2]
    )
    surfaces = surfaces_of(ground_view)
    np.testing.assert_array_equal(surfaces.ends[0], [(5, -2), (5, 2)])
    np.testing.assert_array_equal(surfaces.tops[0], [0.4, 1.8])
    np.testing.assert_array_equal(surfaces.bottoms[0], [0.4, 1.8])
    np.testing.assert_allclose(surfaces.reach[0], [0.2, 0.6])


def test_an_edge_within_the_near_range_is_counted_and_dropped() -> None:
    surfaces = surfaces_of(flat_view([(0.1, -0.2), (0.1, 0.2), (0.2, 0.0), (5, 5)], [(0, 1)]))
    assert surfaces.through_viewpoint > 0
    assert pairs(of_kind(surfaces, SurfaceKind.SEGMENT)) == set()


def test_a_doubtful_link_within_the_near_range_is_dropped_and_not_counted() -> None:
    options = MapperSettings(link_length=0.1, link_angle=0.0, min_range=1.0, halo=0.0)
    # One link lies inside, two end there; the two lone points inside are what is counted.
    surfaces = surfaces_of(flat_view([(0.8, 0.0), (0.8, 0.2), (1.1, 0.0)]), options)
    assert (np.hypot(*np.moveaxis(surfaces.ends, -1, 0)) >= 1.0 - 1e-9).all()
    assert surfaces.through_viewpoint == 2


def test_an_edge_that_enters_the_near_range_is_cut_there() -> None:
    surfaces = surfaces_of(flat_view([(4, 0), (0.1, 0)], [(0, 1)], heights=[1.0, 0.22]))
    piece = of_kind(surfaces, SurfaceKind.SEGMENT)[0]
    assert np.sort(piece[:, 0]).tolist() == pytest.approx([OPTIONS.min_range, 4.0])
    assert surfaces.tops[0].min() == pytest.approx(0.22 + 0.2 * (1.0 - 0.22) / 3.9)


def test_a_post_within_the_near_range_is_no_surface() -> None:
    post = level_view(segments=[[(0.2, 0.0, 0.3), (0.2, 0.0, 0.9)]])
    surfaces = surfaces_of(flatten(post, OPTIONS))
    assert len(surfaces.ends) == 0


@pytest.mark.parametrize("model", ["none", "ellipsoid", "radius"])
@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.4])
def test_a_lone_point_is_a_disc_of_half_a_cell_or_its_sigma(
    model: Literal["none", "ellipsoid", "radius"], sigma: float
) -> None:
    options = MapperSettings(uncertainty=model, halo=0.0)
    surfaces = surfaces_of(flat_view([(6, 3)], covariance=sigma**2, heights=0.7), options)
    radius = max(options.resolution / 2.0, 0.0 if model == "none" else sigma)
    assert surfaces.kind.tolist() == [SurfaceKind.LONE]
    np.testing.assert_allclose(surfaces.discs, [radius])
    np.testing.assert_allclose(surfaces.ends[0].mean(axis=0), (6, 3))
    across = surfaces.ends[0, 1] - surfaces.ends[0, 0]
    assert np.hypot(*across) == pytest.approx(2 * radius)
    assert across @ (6, 3) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_array_equal(surfaces.tops, [[0.7, 0.7]])
    np.testing.assert_array_equal(surfaces.bottoms, [[0.7, 0.7]])


def test_only_lone_points_have_discs() -> None:
    surfaces = surfaces_of(flat_view([(5, 0), (5, 0.3), (9, 4), (9, 6), (3, -3)], [(2, 3)]))
    np.testing.assert_array_equal(surfaces.discs > 0, surfaces.kind == SurfaceKind.LONE)
    assert sorted(surfaces.kind.tolist()) == [0, 1, 2]


def test_where_segments_cross_the_band_spans_both() -> None:
    ends = [(4, -1), (8, 3), (4, 1), (8, -3)]  # they meet at (5, 0), a quarter of the way
    ground_view = flat_view(
        ends, [(0, 1), (2, 3)], heights=[0.4, 0.8, 1.0, 1.8], covariance=[0.01, 0.05, 0.01, 0.05]
    )
    surfaces = surfaces_of(ground_view)
    at_crossing = np.isclose(surfaces.ends, (5, 0)).all(axis=2)
    assert at_crossing.sum() == 4
    np.testing.assert_allclose(surfaces.tops[at_crossing], 1.2)
    np.testing.assert_allclose(surfaces.bottoms[at_crossing], 0.5)
    np.testing.assert_allclose(surfaces.reach[at_crossing], 2 * np.sqrt(0.02))


def test_a_crossing_is_as_high_as_the_segments_there_for_links_too() -> None:
    """A point 0.5 m beside a crossing links with the band between 0.5 m and 1.2 m."""
    ends = [(4, -1), (8, 3), (4, 1), (8, -3)]
    for height, linked in ((1.6, True), (1.8, False)):
        ground_view = flat_view(
            [*ends, (4.7, 0)], [(0, 1), (2, 3)], heights=[0.4, 0.8, 1.0, 1.8, height]
        )
        links = pairs(of_kind(surfaces_of(ground_view), SurfaceKind.LINK))
        assert (frozenset([(4.7, 0.0), (5.0, 0.0)]) in links) == linked


def test_a_low_point_on_a_high_segment_does_not_lower_it() -> None:
    """The segment is two edges there, and the vertex between them is of both features."""
    ground_view = flat_view([(5, -2), (5, 2), (5, 0)], [(0, 1)], heights=[1.8, 1.8, 0.3])
    np.testing.assert_array_equal(surfaces_of(ground_view).tops, np.full((2, 2), 1.8))


def test_features_that_share_a_vertex_span_a_band_and_take_the_widest_covariance() -> None:
    ground_view = flat_view(
        [(5, 0), (5.0004, 0), (5, 1)], [(0, 2)], heights=[0.3, 1.7, 0.3], covariance=[0.01, 0.25, 0]
    )
    surfaces = surfaces_of(ground_view)
    assert surfaces.tops[0].tolist() == [1.7, 0.3]
    assert surfaces.bottoms[0].tolist() == [0.3, 0.3]
    np.testing.assert_allclose(surfaces.reach[0], [2 * np.sqrt(0.25), 0.0])


@settings(max_examples=60)
@given(rooms(), rngs())
def test_every_surface_has_a_height_and_a_reach(room: Cloud, rng: np.random.Generator) -> None:
    count = len(room.points)
    ground_view = flat_view(
        room.points,
        room.segments,
        heights=rng.uniform(0.2, 1.9, size=count),
        covariance=rng.uniform(0.0, 0.3, size=count) ** 2,
    )
    surfaces = surfaces_of(ground_view, HALOED)
    assert ((surfaces.bottoms >= 0.2 - 1e-9) & (surfaces.tops <= 1.9 + 1e-9)).all()
    assert (surfaces.bottoms <= surfaces.tops).all()
    assert ((surfaces.reach >= 0) & (surfaces.reach <= 0.6 + 1e-9)).all()


def test_a_short_segment_beside_a_crossing_does_no_harm() -> None:
    """Its ends fall on one node of the noding grid."""
    points = [(0, 4), (4, 1), (4, 3), (2, 2), (0, 1), (2.4006, 2.1996), (2.4014, 2.2004)]
    surfaces = surfaces_of(flat_view(points, [(0, 1), (2, 3), (2, 4), (5, 6)]))
    assert np.isfinite(surfaces.tops).all()


# What a feature is on may go on beside it


def doubtful_beside(ground_view: GroundView, halo: float) -> list[tuple[Floats, float]]:
    """Half chords across the line of sight beside each feature, and how high they are."""
    found = []
    for place, height in zip(ground_view.points, ground_view.heights.tolist(), strict=True):
        across = np.array([-place[1], place[0]]) / np.hypot(*place)
        if np.hypot(*place) >= 0.3 and halo > 0:
            found += [(np.stack([place - halo * across, place]), height)]
            found += [(np.stack([place, place + halo * across]), height)]
    return found


@settings(max_examples=60)
@given(rngs(), st.sampled_from([0.0, 0.15, 0.6]))
def test_beside_each_feature_half_chords_across_the_line_of_sight_are_doubtful(
    rng: np.random.Generator, halo: float
) -> None:
    points = rng.uniform((-0.5, -4.0), (9.0, 4.0), size=(rng.integers(1, 20), 2))
    ground_view = flat_view(
        points,
        heights=rng.uniform(0.2, 1.5, size=len(points)),
        covariance=rng.uniform(0.0, 0.3, size=len(points)) ** 2,
    )
    surfaces = surfaces_of(ground_view, MapperSettings(halo=halo, doubt=1.0, link_height=99.0))
    doubtful = surfaces.kind == SurfaceKind.DOUBTFUL
    expected = doubtful_beside(ground_view, halo)
    assert doubtful.sum() == len(expected)
    for pair, height in expected:
        off = np.abs(surfaces.ends[doubtful] - pair).max(axis=(1, 2))
        row = np.flatnonzero(doubtful)[off.argmin()]
        assert off.min() < 1e-4
        assert surfaces.tops[row].tolist() == surfaces.bottoms[row].tolist() == [height, height]
        assert surfaces.discs[row] == 0.0


@settings(max_examples=60)
@given(rooms(), st.floats(0.01, 1.0))
def test_what_is_beside_features_changes_nothing_but_adds_to_what_is_doubtful(
    room: Cloud, halo: float
) -> None:
    ground_view = flat_view(room.points, room.segments)
    plain = surfaces_of(ground_view)
    haloed = surfaces_of(ground_view, MapperSettings(halo=halo))
    for kind in SurfaceKind:
        if kind != SurfaceKind.DOUBTFUL:
            np.testing.assert_array_equal(of_kind(haloed, kind), of_kind(plain, kind))
    np.testing.assert_array_equal(haloed.frontiers, plain.frontiers)
    assert haloed.through_viewpoint == plain.through_viewpoint
    assert pairs(of_kind(plain, SurfaceKind.DOUBTFUL)) <= pairs(
        of_kind(haloed, SurfaceKind.DOUBTFUL)
    )


def test_no_features_have_no_surfaces() -> None:
    surfaces = surfaces_of(flat_view())
    assert len(surfaces.ends) == len(surfaces.kind) == len(surfaces.frontiers) == 0
