"""What one view says: one z per cell, walls before freespace, the same for every view position."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap import GroundMapper, View
from groundmap.arrays import Bools, Floats
from groundmap.errors import InputError
from groundmap.evidence.evidence import Evidence
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.rasterised import evidence_of
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, find_surfaces
from groundmap.evidence.ground_plane.view_parts import ViewParts
from groundmap.evidence.ground_plane.visibility import visible_freespace
from groundmap.evidence.triangulation import triangulate
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from oracles import Cell, cell_boxes, in_map, said, shifted, turned
from strategies import flat_view, rngs, views

RESOLUTION = 0.125
MODELS = ["ellipsoid", "radius", "none"]  # of constant density
SLACK = 1e-9  # [m], what rounding may add to a cell


def explained(view: View, **options: Any) -> ViewParts:
    parts = GroundMapper(**{"resolution": RESOLUTION, **options}).explain(view)
    assert isinstance(parts, ViewParts)
    return parts


def by_hand(ground_view: GroundView, **options: Any) -> ViewParts:
    """The steps of `GroundMapper.explain` from a ground_view view on."""
    chosen = MapperSettings(**{"resolution": RESOLUTION, **options})
    mesh = triangulate(ground_view.points, ground_view.segments)
    surfaces = find_surfaces(ground_view, mesh, chosen)
    fan = visible_freespace(ground_view, surfaces, chosen)
    grid = ConfidenceGrid(resolution=chosen.resolution)
    return ViewParts(
        ground_view, mesh, surfaces, fan, evidence_of(ground_view, surfaces, fan, grid, chosen)
    )


def straight(parts: ViewParts) -> Bools:
    """Which surfaces are drawn as lines: segments, and links that are believed."""
    kind = parts.surfaces.kind
    drawn: Bools = (kind == SurfaceKind.SEGMENT) | (kind == SurfaceKind.LINK)
    return drawn


def lines(parts: ViewParts) -> Floats:
    """Segments and links as shapely lines in the map."""
    found: Floats = shapely.linestrings(
        in_map(parts.ground_view, parts.surfaces.ends[straight(parts)])
    )
    return found


def around(parts: ViewParts) -> Floats:
    """z of what each surface sweeps: a ray through it adds up to one cell that is believed."""
    swept = 2.0 * parts.surfaces.reach.mean(axis=1)
    z: Floats = RESOLUTION / np.maximum(swept, RESOLUTION) * parts.fan.contradictions.belief
    return z


def on(parts: ViewParts) -> Floats:
    """z on each surface itself: four times as much, if nothing contradicts it up to 1."""
    belief = parts.fan.contradictions.belief
    z: Floats = np.minimum(4.0 * around(parts) / belief, 1.0) * belief
    return z


def loudest(parts: ViewParts, shapes: Floats, values: Floats) -> None:
    """Check that no cell is less free than the surest of the shapes that touch it makes it.

    Cells without ground, which are below 0, are left out.
    """
    z, height = said(parts.evidence), parts.evidence.height
    assert height is not None
    above = set(map(tuple, (np.argwhere(height >= 0) + parts.evidence.lower).tolist()))
    nonfree = [cell for cell, value in z.items() if value > 0 and cell in above]
    most = np.zeros(len(nonfree))
    cell, shape = shapely.STRtree(shapes).query(boxes(nonfree), "dwithin", distance=SLACK)
    np.maximum.at(most, cell, values[shape])
    assert (np.array([z[cell] for cell in nonfree]) <= most + 1e-6).all()


def discs(parts: ViewParts) -> Floats:
    """Discs of lone points in the map."""
    lone = parts.surfaces.kind == SurfaceKind.LONE
    middles = in_map(parts.ground_view, parts.surfaces.ends[lone].mean(axis=1))
    found: Floats = shapely.buffer(
        shapely.points(middles), parts.surfaces.discs[lone], quad_segs=64
    )
    return found


def spreads(parts: ViewParts) -> Floats:
    """What each surface sweeps when it moves by its reach along the rays, in the map.

    A lone point is a cell wide, whatever its disc, since its bearing is well known.
    """
    ends, reach = parts.surfaces.ends.copy(), parts.surfaces.reach
    lone = parts.surfaces.kind == SurfaceKind.LONE
    middle = ends[lone].mean(axis=1, keepdims=True)
    ends[lone] = middle + (ends[lone] - middle) * (
        RESOLUTION / 2 / parts.surfaces.discs[lone, None, None]
    )
    share = (reach / np.hypot(ends[..., 0], ends[..., 1]))[..., None]
    corners = np.concatenate([ends * (1 - share), ends * (1 + share)], axis=1)
    found: Floats = shapely.convex_hull(shapely.multipoints(in_map(parts.ground_view, corners)))
    return found


def boxes(cells: list[Cell]) -> Floats:
    return cell_boxes(cells, RESOLUTION)


def middles(evidence: Evidence) -> Floats:
    """Centres (x, y) of all cells of the block [m, map]."""
    rows, cols = np.indices(evidence.z.shape)
    corner = np.stack([cols + evidence.lower[1], rows + evidence.lower[0]], axis=-1)
    return (corner + 0.5) * RESOLUTION


@settings(max_examples=40)
@given(views(), st.sampled_from(MODELS))
def test_each_cell_is_spoken_of_once_and_within_bounds(view: View, model: str) -> None:
    evidence = explained(view, uncertainty=model).evidence
    assert (np.abs(evidence.z) <= 1.0).all()
    cells = evidence.cells()
    assert len(np.unique(cells, axis=0)) == len(cells) == np.count_nonzero(evidence.z)
    assert evidence.height is not None
    free = evidence.z < 0
    # The lower the lowest line of sight, the surer: -1 on the ground, -0.25 above 0.45 m.
    expected = -np.clip(1.0 - evidence.height[free] / 0.6, 0.25, 1.0)
    np.testing.assert_allclose(evidence.z[free], expected, rtol=1e-6)


@settings(max_examples=40)
@given(views(), st.sampled_from(MODELS))
def test_a_cell_that_a_surface_passes_is_never_free(view: View, model: str) -> None:
    parts = explained(view, uncertainty=model)
    z = said(parts.evidence)
    free = boxes([cell for cell, value in z.items() if value < 0])
    tree = shapely.STRtree(free)
    for line in lines(parts):
        near = free[tree.query(line)]
        assert shapely.length(shapely.intersection(near, line)).max(initial=0.0) < SLACK


@settings(max_examples=40)
@given(views(), st.sampled_from(["ellipsoid", "none"]))
def test_cells_that_surfaces_pass_are_as_surely_nonfree_as_the_surface_is(
    view: View, model: str
) -> None:
    parts = explained(view, uncertainty=model)
    z = parts.evidence.z.reshape(-1)
    x, y = np.moveaxis(middles(parts.evidence), -1, 0)
    squares = shapely.box(
        x - RESOLUTION / 2, y - RESOLUTION / 2, x + RESOLUTION / 2, y + RESOLUTION / 2
    ).reshape(-1)
    tree = shapely.STRtree(squares)
    for line, value in zip(lines(parts), on(parts)[straight(parts)], strict=True):
        near = tree.query(line)
        passed = near[shapely.length(shapely.intersection(squares[near], line)) > SLACK]
        assert (z[passed] >= np.float32(value) - 1e-6).all()
    lone = parts.surfaces.kind == SurfaceKind.LONE
    for disc, value in zip(discs(parts), on(parts)[lone], strict=True):
        inside = shapely.contains_xy(disc.buffer(-SLACK), x, y).reshape(-1)
        assert (z[inside] >= np.float32(value) - 1e-6).all()


@settings(max_examples=40)
@given(views())
def test_without_spread_only_surfaces_and_discs_are_nonfree(view: View) -> None:
    parts = explained(view, uncertainty="none")
    lone = parts.surfaces.kind == SurfaceKind.LONE
    shapes = np.concatenate([lines(parts), discs(parts)])
    belief = parts.fan.contradictions.belief
    loudest(parts, shapes, np.concatenate([belief[straight(parts)], belief[lone]]))


@settings(max_examples=40)
@given(views())
def test_the_spread_lies_along_the_rays(view: View) -> None:
    parts = explained(view, uncertainty="ellipsoid")
    lone, line = parts.surfaces.kind == SurfaceKind.LONE, straight(parts)
    shapes = np.concatenate([lines(parts), discs(parts), spreads(parts)[line | lone]])
    values = np.concatenate([on(parts)[line], on(parts)[lone], around(parts)[line | lone]])
    loudest(parts, shapes, values)


def test_the_spread_does_not_reach_behind_the_viewpoint() -> None:
    """A short baseline knows of a wall 18 m ahead within 10 m: twice that is beyond the camera."""
    ground_view = flat_view([(18, -1), (18, 1)], [(0, 1)], covariance=10.0**2)
    nonfree = [cell for cell, value in said(by_hand(ground_view).evidence).items() if value > 0]
    assert min(col for _, col in nonfree) >= -1


@settings(max_examples=40)
@given(views())
def test_what_a_segment_sweeps_along_the_rays_is_nonfree(view: View) -> None:
    parts = explained(view, uncertainty="ellipsoid")
    x, y = np.moveaxis(middles(parts.evidence), -1, 0)
    drawn = straight(parts)
    for spread, value in zip(spreads(parts)[drawn], around(parts)[drawn], strict=True):
        inside = shapely.contains_xy(spread.buffer(-SLACK), x, y)
        assert (parts.evidence.z[inside] >= np.float32(value) - 1e-6).all()


@settings(max_examples=40)
@given(views(), st.sampled_from(MODELS))
def test_free_cells_are_those_of_the_fan_that_no_surface_claims(view: View, model: str) -> None:
    parts = explained(view, uncertainty=model)
    triangles = np.concatenate([np.zeros((len(parts.fan.free), 1, 2)), parts.fan.free], axis=1)
    fan = shapely.union_all(
        shapely.buffer(shapely.polygons(in_map(parts.ground_view, triangles)), 1e-10)
    )
    x, y = np.moveaxis(middles(parts.evidence), -1, 0)
    base = in_map(parts.ground_view, parts.ground_view.base)[0]
    wheels = np.hypot(x - base[0], y - base[1]) <= 0.5  # of the narrowest footprint, 1 m
    inside = shapely.contains_xy(fan, x, y) | wheels
    np.testing.assert_array_equal(parts.evidence.z < 0, inside & (parts.evidence.z <= 0))


def moved(view: View, transform: Floats) -> View:
    return replace(view, T_map_base=transform @ view.T_map_base)


@settings(max_examples=40)
@given(views(), st.sampled_from(MODELS), st.tuples(st.integers(-80, 80), st.integers(-80, 80)))
def test_a_view_moved_by_whole_cells_says_the_same_there(
    view: View, model: str, cells: tuple[int, int]
) -> None:
    rows, cols = cells
    shift = np.eye(4)
    shift[:2, 3] = cols * RESOLUTION, rows * RESOLUTION
    here = explained(view, uncertainty=model).evidence
    there = explained(moved(view, shift), uncertainty=model).evidence
    assert said(there) == shifted(said(here), rows, cols)


@settings(max_examples=40)
@given(views(), st.sampled_from(MODELS), st.integers(1, 3))
def test_a_view_turned_by_quarters_says_the_same_turned(
    view: View, model: str, quarters: int
) -> None:
    quarter = np.array([[0.0, -1.0, 0, 0], [1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]])
    expected = said(explained(view, uncertainty=model).evidence)
    for _ in range(quarters):
        view, expected = moved(view, quarter), turned(expected)
    assert said(explained(view, uncertainty=model).evidence) == expected


@settings(max_examples=40)
@given(rngs())
def test_the_radius_spreads_a_wall_alike_to_all_sides(rng: np.random.Generator) -> None:
    sigma = float(rng.uniform(0.1, 0.5))
    wall = rng.uniform((4.0, -3.0), (10.0, 3.0), size=(2, 2))
    parts = by_hand(
        flat_view(wall, [(0, 1)], covariance=sigma**2), uncertainty="radius", robot_height=2.0
    )
    x, y = np.moveaxis(middles(parts.evidence), -1, 0)
    distance = shapely.distance(shapely.points(x, y), shapely.LineString(wall))
    nonfree = parts.evidence.z > 0
    assert nonfree[distance < 2 * sigma - SLACK].all()
    assert not nonfree[distance > 2 * sigma + RESOLUTION].any()
    np.testing.assert_allclose(
        parts.evidence.z[nonfree], min(1.0, RESOLUTION / (4 * sigma)), rtol=1e-6
    )


@settings(max_examples=40)
@given(rngs())
def test_the_radius_spreads_a_lone_point_alike_to_all_sides(rng: np.random.Generator) -> None:
    sigma = float(rng.uniform(0.1, 0.5))
    place = rng.uniform((4.0, -3.0), (10.0, 3.0))
    parts = by_hand(flat_view([place], covariance=sigma**2), uncertainty="radius")
    distance = np.hypot(*np.moveaxis(middles(parts.evidence) - place, -1, 0))
    nonfree = parts.evidence.z > 0
    assert nonfree[distance < 2 * sigma - SLACK].all()
    assert not nonfree[distance > 2 * sigma + RESOLUTION].any()


@pytest.mark.parametrize("model", MODELS)
def test_a_lone_point_keeps_its_own_cell_nonfree(model: str) -> None:
    parts = by_hand(flat_view([(5.06, 1.07)], covariance=1e-6), uncertainty=model)
    assert said(parts.evidence)[(8, 40)] > 0


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("through", "z"), [(0, 1.0), (1, 1.0), (2, 1 / 3), (3, 1 / 4)])
def test_a_ghost_is_drawn_as_weakly_as_it_is_believed(model: str, through: int, z: float) -> None:
    behind = [(7.9, 0.1), (8.0, 0.1), (8.1, 0.1)][:through]
    ground_view = flat_view(
        [(4.06, 0.06), (9, -3), (9, 3)], [(1, 2)], heights=[1.0, 0.1, 0.1], supports=behind
    )
    cells = said(by_hand(ground_view, uncertainty=model).evidence)
    assert cells[(0, 32)] == pytest.approx(z)
    assert cells[(0, 72)] == 1.0  # the wall behind it
    assert ((0, 60) in cells) == (through >= 2)  # is seen through it


def test_a_doubtful_link_is_not_drawn_and_hides_what_is_behind_it() -> None:
    ground_view = flat_view([(5.06, -0.6), (5.06, 0.6)], heights=0.4, supports=[(8.0, 0.0)])
    cells = said(by_hand(ground_view).evidence)
    assert cells[(0, 39)] < 0.0
    assert not any(row in range(-3, 3) and col > 40 for row, col in cells)
    assert not any(row in range(-3, 3) and z > 0 for (row, _), z in cells.items())
    assert said(by_hand(ground_view, doubt=1.0).evidence)[(0, 60)] < 0.0


def test_what_may_go_on_beside_a_feature_is_not_drawn() -> None:
    wide = said(by_hand(flat_view([(5.06, 0.06)], heights=0.4), halo=0.9).evidence)
    none = said(by_hand(flat_view([(5.06, 0.06)], heights=0.4), halo=0.0).evidence)
    nonfree = [{cell for cell, z in cells.items() if z > 0} for cells in (wide, none)]
    assert nonfree[0] == nonfree[1]
    assert len(nonfree[0]) > 0


def test_nothing_seen_says_nothing() -> None:
    assert said(by_hand(flat_view()).evidence) == {}


def test_the_resolution_is_refused_if_a_view_takes_too_many_cells() -> None:
    ground_view = flat_view([(9, -9), (9, 9)], [(0, 1)])
    with pytest.raises(InputError, match=r"resolution: expected one that cuts a view into"):
        by_hand(ground_view, resolution=1e-3)


def drop_offs(ground_view: GroundView, resolution: float = 0.5) -> list[Cell]:
    """Cells that a view of nothing but drop-offs speaks of."""
    evidence = by_hand(ground_view, resolution=resolution).evidence
    assert evidence.height is not None
    assert (evidence.height[evidence.z > 0] < 0).all()
    return [(row, col) for row, col in evidence.cells().tolist()]


def test_drop_offs_are_in_the_cells_below_them() -> None:
    places = [(1.0, 0.5), (1.01, 0.49), (3.0, -2.0), (3.1, -2.1)]
    ground_view = flat_view(
        viewpoint=(0.01, 0.02), forward=(0.0, 1.0), drop_offs=places, drop_off_heights=-0.01
    )
    # Ahead is y of the map, left is -x.
    assert sorted(drop_offs(ground_view)) == [(2, -1), (6, 4)]


# A line of sight from 1 m up to a feature 1 m below the ground, 5.9 m ahead, enters the pit
# at 2.95 m.
PIT = flat_view(drop_offs=[(5.9, 0.1)] * 2, drop_off_heights=-1.0)


def test_ground_is_missing_from_where_sight_enters_a_pit() -> None:
    assert drop_offs(PIT) == [(0, col) for col in range(6, 12)]


def test_a_pit_lies_where_the_view_stands() -> None:
    moved = PIT._replace(viewpoint=np.array([10.0, 20.0]), forward=np.array([0.0, 1.0]))
    assert drop_offs(moved) == [(40 + row, 19) for row in range(6, 12)]


def nonfree(ground_view: GroundView) -> dict[Cell, float]:
    z = said(by_hand(ground_view, resolution=0.5).evidence)
    return {cell: value for cell, value in z.items() if value > 0}


def test_a_false_match_across_ground_that_was_seen_counts_where_it_is_alone() -> None:
    ground_view = flat_view(
        drop_offs=[(5.9, 0.1)] * 2, drop_off_heights=-1.0, supports=[(4.0, 0.0)]
    )
    assert nonfree(ground_view) == {(0, 11): 1.0}


def test_a_line_below_the_ground_for_long_counts_at_its_end_alone() -> None:
    for end, count in ((5.9, 6), (6.1, 1)):  # 2.95 m and 3.05 m of it are below
        assert len(drop_offs(flat_view(drop_offs=[(end, 0.1)] * 2, drop_off_heights=-1.0))) == count


def test_a_drop_off_counts_as_much_as_it_is_sure() -> None:
    ground_view = flat_view(drop_offs=[(1.2, 0.1), (1.3, 0.1)], drop_off_heights=[-0.01, -0.02])
    for sureness in (0.25, 0.0):
        unsure = ground_view._replace(drop_off_sureness=np.array([sureness, sureness]))
        expected = {(0, 2): sureness} if sureness else {}
        assert nonfree(unsure) == pytest.approx(expected)


def test_a_lone_drop_off_says_nothing() -> None:
    for apart, count in ((0.45, 2), (0.55, 0)):
        places = [(1.2, 0.1), (1.2, 0.1 + apart)]
        assert len(nonfree(flat_view(drop_offs=places, drop_off_heights=-0.01))) == count


def test_the_top_of_what_was_seen_is_on_its_surface_alone() -> None:
    low, high = (6.0, -1.0), (6.0, 1.0)
    parts = by_hand(flat_view([low, high], [(0, 1)], heights=[0.4, 0.8], covariance=0.04))
    z, height = parts.evidence.z, parts.evidence.height
    assert height is not None
    on_surface = z == z.max()
    np.testing.assert_allclose(height[on_surface], 0.8, rtol=1e-6)
    around = (z > 0) & ~on_surface
    assert around.sum() > 10
    assert np.isinf(height[around]).all()


def test_sight_is_as_low_over_a_cell_as_the_line_to_the_ground_behind_it() -> None:
    # From 1 m up to the ground 8 m ahead, and over the nearest 4 m to a second feature.
    parts = by_hand(flat_view(supports=[(8.0, 0.0), (4.0, 0.0)]))
    evidence = parts.evidence
    assert evidence.height is not None
    for x, sight in ((7.9375, 0.0078), (4.5625, 0.4297), (3.4375, 0.1406), (2.0625, 0.484)):
        row, col = np.floor(np.array([0.01, x]) / RESOLUTION).astype(np.int64) - evidence.lower
        assert evidence.z[row, col] < 0
        assert evidence.height[row, col] == pytest.approx(sight, abs=1 / 64 + 1e-3)
