"""Occlusion by prisms, compared with shapely in plan view and in the plane of sight."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats
from groundmap.simulate.kernels.occlusion import find_hidden, first_hits
from groundmap.simulate.occlusion import edges_of, in_sight
from groundmap.simulate.world import Hole, Solid, World
from strategies import rngs

Heights = list[tuple[float, float]]

MARGIN = 1e-7  # [m]: nearer than this to an edge, a line may count as either
BOX = shapely.box(2.0, -1.0, 3.0, 1.0)
EYE = np.array([0.0, 0.0, 1.0])


def kernel(
    eye: Floats, targets: Floats, outlines: list[shapely.Polygon], heights: Heights
) -> Bools:
    pieces = [edges_of(outline) for outline in outlines]
    starts = np.cumsum([0, *map(len, pieces)], dtype=np.int64)
    out = np.empty(len(targets), dtype=np.bool_)
    level = np.hstack([np.array(heights), np.zeros((len(heights), 2))])
    find_hidden(eye, targets, np.concatenate(pieces), starts, level, out)
    return out


def behind(target: tuple[float, float, float], outline: shapely.Polygon, top: float = 2.0) -> bool:
    return bool(kernel(EYE, np.array([target]), [outline], [(0.0, top)])[0])


def star(rng: np.random.Generator) -> shapely.Polygon:
    """Draw a polygon that is rarely convex and sometimes has a hole."""
    count = int(rng.integers(5, 12))
    turns = 2 * np.pi * (np.arange(count) + rng.uniform(0.0, 0.9, count)) / count
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    corners = rng.uniform(0.5, 3.0, (len(turns), 1)) * around
    outline = shapely.Polygon(corners + rng.uniform(-6.0, 6.0, 2))
    middle = outline.centroid
    if outline.contains(middle) and rng.random() < 0.5:
        gap = middle.buffer(0.7 * middle.distance(outline.exterior), quad_segs=2)
        return outline.difference(gap)
    return outline


def sight_in_its_plane(
    eye: Floats, target: Floats, outline: shapely.Polygon, heights: tuple[float, float]
) -> tuple[bool, bool]:
    """Whether a prism hides the target for sure, and whether it may.

    In the upright plane through both, a prism is some rectangles: distance by height.
    """
    flat = shapely.LineString([eye[:2], target[:2]])
    sight = shapely.LineString([(0.0, eye[2]), (flat.length, target[2])])
    surely = perhaps = False
    pieces = shapely.get_parts(shapely.intersection(flat, outline))
    for piece in pieces[~shapely.is_empty(pieces)]:
        away = np.hypot(*(shapely.get_coordinates(piece) - eye[:2]).T)
        cut = shapely.box(away.min(), heights[0], away.max(), heights[1])
        surely |= bool(sight.intersects(cut.buffer(-MARGIN, join_style="mitre")))
        perhaps |= bool(sight.intersects(cut.buffer(MARGIN, join_style="mitre")))
    return surely, perhaps


@settings(max_examples=60)
@given(rngs())
def test_a_prism_hides_what_its_cut_along_sight_hides(rng: np.random.Generator) -> None:
    outlines = [star(rng) for _ in range(rng.integers(1, 5))]
    low = rng.uniform(0.0, 1.5, len(outlines)) * (rng.random(len(outlines)) < 0.5)
    heights = list(zip(low.tolist(), (low + rng.uniform(0.1, 2.0, len(low))).tolist(), strict=True))
    eye = np.array([*rng.uniform(-9.0, 9.0, 2), rng.uniform(0.3, 2.5)])
    assume(not shapely.contains_xy(shapely.union_all(outlines), *eye[:2]))
    targets = rng.uniform((-9.0, -9.0, 0.0), (9.0, 9.0, 3.0), (25, 3))
    targets[:5, 2] = eye[2]  # level sight
    found = kernel(eye, targets, outlines, heights)
    for target, answer in zip(targets, found, strict=True):
        cuts = zip(outlines, heights, strict=True)
        surely, perhaps = np.any([sight_in_its_plane(eye, target, *cut) for cut in cuts], axis=0)
        if surely == perhaps:
            assert answer == surely


def lattice_polygon(rng: np.random.Generator) -> shapely.Polygon:
    while True:
        outline = shapely.Polygon(rng.integers(0, 7, (rng.integers(3, 7), 2)).astype(np.float64))
        if outline.is_valid and outline.area > 0:
            return outline


@settings(max_examples=100)
@given(rngs())
def test_a_line_through_a_corner_counts_it_once(rng: np.random.Generator) -> None:
    outline = lattice_polygon(rng)
    eye = rng.integers(-1, 8, 2).astype(np.float64)
    assume(not outline.covers(shapely.Point(eye)))
    rows, cols = np.indices((9, 9)).reshape(2, -1) - 1.0
    targets = np.column_stack([cols, rows, np.ones(81)])
    lines = shapely.linestrings(np.stack([np.tile(eye, (81, 1)), targets[:, :2]], axis=1))
    inside = shapely.relate_pattern(lines, outline, "T********")  # interior meets interior
    found = kernel(np.array([*eye, 1.0]), targets, [outline], [(0.0, 2.0)])
    along = shapely.length(shapely.intersection(lines, outline.boundary)) > 0
    np.testing.assert_array_equal(found[~along], inside[~along])


def test_no_sight_leaks_between_boxes_that_touch_and_one_of_two_edges_is_inside() -> None:
    left, right = shapely.box(2, 0, 3, 1), shapely.box(2, -1, 3, 0)
    target = np.array([(5.0, 0.0, 1.0)])
    answers = [bool(kernel(EYE, target, [one], [(0.0, 2.0)])[0]) for one in (left, right)]
    assert sorted(answers) == [False, True]


@pytest.mark.parametrize(("x", "answer"), [(2.0 - 1e-6, False), (2.0 + 1e-6, True), (4.0, True)])
def test_points_just_before_a_face_are_seen_and_just_behind_are_hidden(
    x: float, answer: bool
) -> None:
    assert behind((x, 0.3, 0.5), BOX) == answer


# Over a box that is 0.5 m high and ends at x = 3, sight from 1 m up comes down at x = 6.
@pytest.mark.parametrize(("x", "answer"), [(5.99, True), (6.01, False)])
def test_ground_is_seen_over_the_top_of_a_low_box(x: float, answer: bool) -> None:
    assert behind((x, 0.0, 0.0), BOX, top=0.5) == answer


@pytest.mark.parametrize(("height", "answer"), [(0.5, False), (0.81, True), (1.3, False)])
def test_sight_passes_under_a_table_top(height: float, answer: bool) -> None:
    # At x = 2 to 3, half way to x = 5, sight to 0.5 m is below the top: from 0.8 to 0.7 m.
    top = [(0.85, 0.95)]
    assert bool(kernel(EYE, np.array([(5.0, 0.0, height)]), [BOX], top)[0]) == answer


def test_a_place_inside_a_hollow_prism_is_hidden_by_its_walls_alone() -> None:
    hollow = BOX.difference(shapely.box(2.2, -0.8, 2.8, 0.8))
    assert behind((2.5, 0.0, 1.0), hollow)
    assert not behind((2.5, 0.0, 2.5), hollow)
    eye, targets = np.array([2.5, 0.0, 1.0]), np.array([(2.6, 0.5, 1.0), (4.0, 0.0, 1.0)])
    assert kernel(eye, targets, [hollow], [(0.0, 2.0)]).tolist() == [False, True]


def test_glass_hides_nothing() -> None:
    target = np.array([(6.0, 0.0, 1.0)])
    for transparent in (False, True):
        pane = Solid(BOX, top=2.0, transparent=transparent)
        world = World(bounds=(0, -5, 10, 5), solids=(pane,))
        assert in_sight(world, EYE, target)[0] == transparent


@settings(max_examples=60)
@given(rngs())
def test_the_floor_of_a_hole_is_seen_through_its_mouth_alone(rng: np.random.Generator) -> None:
    holes = (Hole(BOX, depth=float(rng.uniform(0.3, 3.0))), Hole(star(rng).convex_hull, depth=1.0))
    world = World(bounds=(-9, -9, 9, 9), holes=holes)
    eye = np.array([*rng.uniform(-6.0, 6.0, 2), rng.uniform(0.5, 2.0)])
    for hole in holes:
        xmin, ymin, xmax, ymax = hole.outline.bounds
        targets = rng.uniform((xmin, ymin, -hole.depth), (xmax, ymax, -0.05), (30, 3))
        found = in_sight(world, eye, targets)
        for target, answer in zip(targets, found, strict=True):
            through, blocked = np.transpose([below_ground(eye, target, one) for one in holes])
            if (through | blocked).all():
                assert answer == through.any()


def below_ground(eye: Floats, target: Floats, hole: Hole) -> tuple[bool, bool]:
    """Return whether sight below the ground is certainly in the hole, and certainly not."""
    sight = eye + np.linspace(0.0, 1.0, 400)[:, None] * (target - eye)
    places = shapely.points(sight[sight[:, 2] < 0, :2])
    outside = shapely.distance(places, hole.outline)
    rim = shapely.distance(places, hole.outline.exterior)
    return bool(((outside == 0) & (rim > 0.02)).all()), bool((outside > 0.02).any())


@settings(max_examples=60)
@given(rngs(), st.integers(0, 4))
def test_first_hits_are_where_rays_first_meet_an_edge(rng: np.random.Generator, count: int) -> None:
    edges = np.concatenate([np.empty((0, 4)), *(edges_of(star(rng)) for _ in range(count))])
    lines = shapely.linestrings(edges.reshape(-1, 2, 2))
    eye, bearings = rng.uniform(-7.0, 7.0, 2), rng.uniform(-np.pi, np.pi, 40)
    ranges, which = np.empty(40), np.empty(40, dtype=np.int64)
    first_hits(eye, bearings, edges, ranges, which)
    start, walls = shapely.Point(eye), shapely.multilinestrings(lines)
    for bearing, distance, row in zip(bearings, ranges, which, strict=True):
        way = np.array([np.cos(bearing), np.sin(bearing)])
        ray = shapely.LineString([eye, eye + 50.0 * way])
        apart = shapely.distance(start, shapely.intersection(ray, walls))
        if np.isnan(apart):  # they don't meet
            assert [distance, row] == [np.inf, -1]
        else:
            assert distance == pytest.approx(apart, abs=1e-9)
            assert lines[row].distance(shapely.Point(eye + distance * way)) < 1e-9


@settings(max_examples=40)
@given(rngs())
def test_a_solid_with_a_slope_hides_what_points_along_sight_are_in_it(
    rng: np.random.Generator,
) -> None:
    slope = rng.uniform(-0.4, 0.4, 2)
    low = rng.uniform(0.0, 1.0)
    ramp = Solid(star(rng), bottom=low, top=low + 6.0, slope=(slope[0], slope[1]))
    eye = np.array([*rng.uniform(-9.0, 9.0, 2), rng.uniform(0.3, 7.0)])
    assume(not shapely.contains_xy(ramp.outline, *eye[:2]))
    targets = rng.uniform((-9.0, -9.0, 0.0), (9.0, 9.0, 7.0), (25, 3))
    found = in_sight(World(bounds=(-9, -9, 9, 9), solids=(ramp,)), eye, targets)
    for target, answer in zip(targets, found, strict=True):
        places = eye + np.linspace(0.0, 1.0, 4001)[:, None] * (target - eye)
        depth = np.minimum(places[:, 2] - low, ramp.top_at(places[:, :2]) - places[:, 2])
        depth[~shapely.contains_xy(ramp.outline, places[:, :2])] = -1.0
        if (depth > 0.0).any():
            assert not answer
        elif (depth < -0.02).all():
            assert answer
