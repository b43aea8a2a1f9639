"""Constrained Delaunay triangulation: chains, topology, duplicates, defined results, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay, KDTree

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.evidence.triangulation import MERGE_DISTANCE, NODING_GRID, Mesh, triangulate
from oracles import (
    components,
    deepest_intrusion,
    edge_set,
    first_nearby,
    peak_memory,
    sides,
    signed_areas,
    without_chain,
    without_segment,
)
from strategies import Cloud, clouds, rngs

SCALES = [1e-2, 1.0, 1e2, 1e4]
KINDS = ["generic", "lattice", "tenths", "thirds", "near_duplicates", "collinear", "t_junctions"]


def may_be_noded(mesh: Mesh) -> bool:
    """Whether all vertices lie on the noding grid, as they do where noding was needed."""
    steps = mesh.points / NODING_GRID
    return bool((np.abs(steps - np.round(steps)) < 1e-12 * np.maximum(1.0, np.abs(steps))).all())


def tolerance(mesh: Mesh) -> float:
    """How far a chain may leave its segment: rounding, or a millimetre where noding was needed."""
    rounding = 1e-12 * max(1.0, float(np.abs(mesh.points).max(initial=0.0)))
    return rounding + (NODING_GRID if may_be_noded(mesh) else 0.0)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=60)
@given(data=st.data())
def test_every_segment_is_a_chain_of_constrained_edges(kind: str, data: st.DataObject) -> None:
    cloud = data.draw(clouds(kind))
    mesh = triangulate(cloud.points, cloud.segments)
    assert without_chain(mesh, cloud.points, cloud.segments, tolerance(mesh)) == []


@pytest.mark.parametrize("scale", SCALES)
@settings(max_examples=40)
@given(cloud=clouds())
def test_chains_hold_at_every_scale(scale: float, cloud: Cloud) -> None:
    cloud = Cloud(cloud.points * scale, cloud.segments)
    mesh = triangulate(cloud.points, cloud.segments)
    assert without_chain(mesh, cloud.points, cloud.segments, tolerance(mesh)) == []


@settings(max_examples=100)
@given(clouds())
def test_only_pieces_of_segments_are_constrained(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    assert without_segment(mesh, cloud.segments, tolerance(mesh)) == []


def test_crossing_segments_both_survive() -> None:
    mesh = triangulate([(0, 0), (2, 2), (0, 2), (2, 0)], [(0, 1), (2, 3)])
    np.testing.assert_allclose(mesh.points[4], (1.0, 1.0))
    assert edge_set(mesh) >= {(0, 4), (1, 4), (2, 4), (3, 4)}
    assert mesh.constrained.sum() == 4
    assert sorted(map(tuple, mesh.crossings.tolist())) == [(4, 0, 1), (4, 2, 3)]


def test_overlapping_segments_share_edges() -> None:
    mesh = triangulate([(0, 0), (3, 0), (1, 0), (4, 0), (2, 5)], [(0, 1), (2, 3)])
    fixed = set(map(tuple, mesh.edges[mesh.constrained].tolist()))
    assert fixed == {(0, 2), (1, 2), (1, 3)}


SHORT_BESIDE_A_CROSSING = Cloud(
    np.array([(0, 4), (4, 1), (4, 3), (2, 2), (0, 1), (2.4006, 2.1996), (2.4014, 2.2004)]),
    np.array([(0, 1), (2, 3), (2, 4), (5, 6)]),
)


@settings(max_examples=100)
@given(clouds())
@example(SHORT_BESIDE_A_CROSSING)
def test_each_crossing_lies_on_the_segments_it_names(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    assert (mesh.crossings[:, 1] != mesh.crossings[:, 2]).all()
    a, b = mesh.points[mesh.crossings[:, 1]], mesh.points[mesh.crossings[:, 2]]
    along, offset = b - a, mesh.points[mesh.crossings[:, 0]] - a
    across = along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0]
    distance = np.abs(across) / np.hypot(*along.T)
    assert (distance <= tolerance(mesh) + 1e-12).all()
    share = (along * offset).sum(axis=1) / (along**2).sum(axis=1)
    assert ((share > -1e-2) & (share < 1.01)).all()


@settings(max_examples=100)
@given(clouds())
def test_each_vertex_is_an_input_or_a_crossing(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    assert set(mesh.source) | set(mesh.crossings[:, 0]) == set(range(len(mesh.points)))


@settings(max_examples=100)
@given(clouds())
def test_triangles_turn_counter_clockwise(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    assert (signed_areas(mesh) > -1e-12).all()


@settings(max_examples=100)
@given(clouds())
def test_neighbours_lie_opposite_to_corners(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    for triangle, (corners, across) in enumerate(
        zip(mesh.simplices.tolist(), mesh.neighbors.tolist(), strict=True)
    ):
        for corner, other in zip(corners, across, strict=True):
            side = set(corners) - {corner}
            sharing = [t for t, s in enumerate(mesh.simplices.tolist()) if side < set(s)]
            assert sorted({triangle, other} - {-1}) == sharing


@settings(max_examples=100)
@given(clouds())
def test_each_edge_is_listed_once(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    assert len(edge_set(mesh)) == len(mesh.edges) == len(mesh.constrained)
    assert (mesh.edges[:, 0] < mesh.edges[:, 1]).all()
    fixed = set(map(tuple, mesh.edges[mesh.constrained].tolist()))
    assert sides(mesh) <= edge_set(mesh)
    if len(mesh.simplices):
        assert edge_set(mesh) == sides(mesh) | fixed


@settings(max_examples=100)
@given(clouds())
def test_edges_join_all_vertices(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    assert components(mesh) == 1


@settings(max_examples=60)
@given(rngs(), st.sampled_from(SCALES))
def test_without_segments_it_is_scipys_delaunay(rng: np.random.Generator, scale: float) -> None:
    points = rng.uniform(-scale, scale, size=(rng.integers(4, 40), 2))
    distances = KDTree(points).query(points, k=2)[0][:, 1]
    points = points[distances > 2 * MERGE_DISTANCE]
    if len(points) < 4:
        points = scale * np.array([(0.0, 0.0), (1.0, 0.1), (0.3, 0.9), (0.7, 2.0)])
    mesh, twin = triangulate(points), Delaunay(points)
    expected = {frozenset(corners) for corners in twin.simplices.tolist()}
    assert {frozenset(corners) for corners in mesh.simplices.tolist()} == expected
    assert not mesh.constrained.any()


@settings(max_examples=60)
@given(clouds())
def test_without_segments_circumcircles_are_empty(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points)
    thick = np.abs(signed_areas(mesh)) > 1e-6
    assert deepest_intrusion(mesh._replace(simplices=mesh.simplices[thick])) < 1e-6


@settings(max_examples=60)
@given(rngs(), st.sampled_from([0.0, 1e-15, 1e-9, 1e-4]))
def test_neighbours_on_a_wall_are_linked_however_straight_it_is(
    rng: np.random.Generator, roughness: float
) -> None:
    along = np.cumsum(rng.uniform(0.05, 1.0, size=12))
    angle = rng.uniform(-np.pi, np.pi)
    points = along[:, None] * (np.cos(angle), np.sin(angle)) + rng.uniform(-9.0, 9.0, size=2)
    points += roughness * rng.normal(size=points.shape)
    links = {(i, i + 1) for i in range(11)}
    assert links <= edge_set(triangulate(points))


@settings(max_examples=100)
@given(clouds())
@example(Cloud(np.array([(0.0, 0.0), (0.0009, 0.0), (0.0018, 0.0)]), np.empty((0, 2), np.int64)))
def test_points_move_no_farther_than_a_millimetre(cloud: Cloud) -> None:
    mesh = triangulate(cloud.points, cloud.segments)
    moved = np.hypot(*(mesh.points[mesh.source] - cloud.points).T)
    allowed = MERGE_DISTANCE + (NODING_GRID if may_be_noded(mesh) else 0.0)
    assert moved.max(initial=0.0) <= allowed * (1 + 1e-9)


def test_points_within_a_millimetre_become_the_first_of_them() -> None:
    mesh = triangulate([(0, 0), (5, 0), (5.0005, 0), (0, 5), (0, 5.002)])
    assert mesh.source.tolist() == [0, 1, 1, 2, 3]
    np.testing.assert_array_equal(mesh.points, [(0, 0), (5, 0), (0, 5), (0, 5.002)])


@settings(max_examples=200)
@given(rngs(), st.sampled_from([0.25, 0.5, np.sqrt(0.5), 1.0]), st.sampled_from([0.0, -7.3, 1e6]))
def test_each_point_becomes_the_first_kept_within_a_millimetre(
    rng: np.random.Generator, step: float, away: float
) -> None:
    # Lattices have pairs whose distance is a millimetre but for rounding.
    places = rng.integers(-5, 6, (rng.integers(1, 60), 2)) * step * MERGE_DISTANCE
    points = away + places + rng.choice([0.0, 1e-4]) * rng.uniform(-1, 1, places.shape)
    source = triangulate(points).source
    stands_for = np.array(first_nearby(points, MERGE_DISTANCE))
    np.testing.assert_array_equal(source, source[stands_for])
    assert len(set(source.tolist())) == len(set(stands_for.tolist()))


def test_points_within_a_millimetre_are_not_held_as_pairs() -> None:
    points = np.random.default_rng(0).uniform(0.0, MERGE_DISTANCE, (2000, 2))
    assert peak_memory(lambda: triangulate(points)) < 10e6  # 2,000,000 pairs take 300 MB


def test_a_segment_between_near_duplicates_vanishes() -> None:
    mesh = triangulate([(0, 0), (0.0005, 0), (4, 0), (0, 4)], [(0, 1), (2, 3)])
    assert mesh.edges[mesh.constrained].tolist() == [[1, 2]]


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_points_have_no_edges(count: int) -> None:
    mesh = triangulate(np.ones((count, 2)))
    assert len(mesh.points) == len(mesh.source) == count
    assert mesh.simplices.shape == mesh.neighbors.shape == (0, 3)
    assert mesh.edges.shape == (0, 2)
    assert mesh.constrained.shape == (0,)


def test_two_points_are_one_edge() -> None:
    assert triangulate([(3, 1), (1, 2)]).edges.tolist() == [[0, 1]]
    joined = triangulate([(3, 1), (1, 2)], [(1, 0)])
    assert joined.edges.tolist() == [[0, 1]]
    assert joined.constrained.tolist() == [True]


@settings(max_examples=60)
@given(
    st.lists(st.integers(-50, 50), min_size=2, max_size=12, unique=True),
    st.sampled_from([(1, 0), (0, 1), (1, 1), (2, -3)]),
)
def test_points_on_a_line_are_chained_along_it(
    along: list[int], direction: tuple[int, int]
) -> None:
    points: Floats = np.outer(along, direction).astype(np.float64)
    order = np.argsort(along)
    expected = np.sort(np.stack([order[:-1], order[1:]], axis=1), axis=1)
    mesh = triangulate(points)
    assert len(mesh.simplices) == 0
    assert edge_set(mesh) == set(map(tuple, expected.tolist()))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_by_its_place(value: float) -> None:
    with pytest.raises(InputError, match=r"points: expected finite .* at index \(2, 1\)"):
        triangulate([(0, 0), (1, 0), (0, value)])


@pytest.mark.parametrize("pair", [(0, 3), (-1, 0), (7, 1)])
def test_a_segment_that_names_no_point_is_refused(pair: tuple[int, int]) -> None:
    with pytest.raises(InputError, match=r"segments: expected rows of the 3 points.* at row 1"):
        triangulate([(0, 0), (1, 0), (0, 1)], [(0, 1), pair])


def test_points_of_another_shape_are_refused() -> None:
    with pytest.raises(InputError, match=r"points: expected shape \(n, 2\), got shape \(2, 3\)"):
        triangulate([(0, 0, 0), (1, 1, 1)])
