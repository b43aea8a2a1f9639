"""Drawing into cells: general position against shapely, cell borders by partition."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats
from groundmap.evidence.ground_plane.kernels.raster import draw_surfaces, fill_star, lowest_sight
from oracles import (
    cells_crossed,
    cells_in_disc,
    cells_inside,
    centres,
    parity_inside,
)
from strategies import rngs

SHAPE = (24, 32)


def star(origin: Floats, corners: Floats, joined: Bools) -> Bools:
    """Cells that `fill_star` sets: pieces from each corner to the next."""
    return pieces(origin, corners, np.roll(corners, -1, axis=0), joined)


def pieces(origin: Floats, start: Floats, end: Floats, joined: Bools) -> Bools:
    z = np.zeros(SHAPE, dtype=np.float32)
    fill_star(z, np.zeros(SHAPE, dtype=np.uint8), origin, start, end, joined)
    assert set(np.unique(z)) <= {0.0, -1.0}
    found: Bools = z != 0
    return found


def drawn(
    ends: Floats,
    *,
    outline: Floats | None = None,
    caps: tuple[float, float] = (0.0, 0.0),
    disc: float = 0.0,
    on_surface: float = 0.0,
    around: float = 0.0,
) -> Bools:
    """Cells that one surface raises; an outline of its own ends spreads nowhere."""
    z = np.zeros(SHAPE, dtype=np.float32)
    corners = ends[[0, 1, 1, 0]] if outline is None else outline
    draw_surfaces(
        z,
        np.zeros(SHAPE, dtype=np.float32),
        ends[None],
        ends[None],
        corners[None],
        corners[None],
        np.array([caps]),
        np.array([disc]),
        np.array([on_surface]),
        np.array([around]),
        np.array([1.0]),
        np.zeros(2),
        np.inf,
    )
    found: Bools = z > 0
    return found


def random_star(rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """A point inside the block and corners around it, some of them outside the block."""
    origin = rng.uniform((4.0, 4.0), (28.0, 20.0))
    bearing = np.sort(np.append(rng.uniform(-np.pi, np.pi, size=count), (-2.0, 0.0, 2.0)))
    radius = rng.uniform(0.5, 18.0, size=len(bearing))
    return origin, origin + radius[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], 1)


@settings(max_examples=150)
@given(rngs(), st.integers(3, 20))
def test_a_star_holds_the_cells_whose_centres_lie_inside(
    rng: np.random.Generator, count: int
) -> None:
    """Walking to the origin and back where pieces meet changes nothing."""
    origin, corners = random_star(rng, count)
    found = star(origin, corners, rng.uniform(size=len(corners)) < 0.8)
    np.testing.assert_array_equal(found, parity_inside(corners, SHAPE))
    np.testing.assert_array_equal(found, cells_inside(shapely.Polygon(corners), SHAPE))


@settings(max_examples=100)
@given(rngs(), st.integers(1, 12))
def test_pieces_with_gaps_hold_the_cells_of_their_triangles(
    rng: np.random.Generator, count: int
) -> None:
    origin = rng.uniform((4.0, 4.0), (28.0, 20.0))
    bearing = np.sort(rng.uniform(-np.pi, np.pi, size=2 * count)).reshape(-1, 2)
    bearing[:, 1] = np.minimum(bearing[:, 1], bearing[:, 0] + 3.0)
    radius = rng.uniform(0.5, 18.0, size=bearing.shape)
    ends = origin + radius[..., None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    found = pieces(origin, ends[:, 0], ends[:, 1], np.zeros(count, dtype=np.bool_))
    triangles = [shapely.Polygon([origin, *pair]) for pair in ends]
    np.testing.assert_array_equal(found, cells_inside(shapely.union_all(triangles), SHAPE))


@settings(max_examples=100)
@given(rngs(), st.integers(2, 6))
def test_pieces_that_step_in_range_are_one_polygon(rng: np.random.Generator, count: int) -> None:
    """Joined pieces need not meet: the outline runs along the ray between their ends."""
    origin = rng.uniform((10.0, 8.0), (22.0, 16.0))
    bearing = np.linspace(-np.pi, np.pi, count + 2)
    both = np.stack([bearing[:-1], bearing[1:]], axis=1)
    radius = rng.uniform(1.0, 12.0, size=both.shape)
    ends = origin + radius[..., None] * np.stack([np.cos(both), np.sin(both)], axis=-1)
    found = pieces(origin, ends[:, 0], ends[:, 1], np.ones(len(ends), dtype=np.bool_))
    triangles = [shapely.Polygon([origin, *pair]).buffer(1e-12) for pair in ends]
    np.testing.assert_array_equal(found, cells_inside(shapely.union_all(triangles), SHAPE))


def dyadic(low: int, high: int) -> st.SearchStrategy[float]:
    """Halves, so that many fall on cell centres."""
    return st.integers(2 * low, 2 * high).map(lambda halves: halves / 2.0)


@settings(max_examples=200)
@given(st.data())
def test_stars_that_share_borders_share_no_cell_and_leave_none_out(data: st.DataObject) -> None:
    """A rectangle is cut by rays from a viewpoint into stars; all corners may be cell centres."""
    left, bottom = data.draw(dyadic(0, 6)), data.draw(dyadic(0, 6))
    right, top = data.draw(dyadic(20, 32)), data.draw(dyadic(16, 24))
    origin = np.array([data.draw(dyadic(8, 18)), data.draw(dyadic(8, 14))])
    on_bottom = sorted(data.draw(st.sets(dyadic(7, 19), max_size=3)))
    on_right = sorted(data.draw(st.sets(dyadic(7, 15), max_size=3)))
    on_top = sorted(data.draw(st.sets(dyadic(7, 19), max_size=3)), reverse=True)
    corners = np.array(
        [(left, bottom)]
        + [(x, bottom) for x in on_bottom]
        + [(right, bottom)]
        + [(right, y) for y in on_right]
        + [(right, top)]
        + [(x, top) for x in on_top]
        + [(left, top)]
    )
    cuts = sorted(data.draw(st.sets(st.integers(0, len(corners) - 1), min_size=1, max_size=5)))
    times = np.zeros(SHAPE, dtype=np.int64)
    for first, last in zip(cuts, [*cuts[1:], cuts[0] + len(corners)], strict=True):
        chain = corners[np.arange(first, last + 1) % len(corners)]
        joined = np.ones(len(chain) - 1, dtype=np.bool_)
        joined[-1] = False
        times += pieces(origin, chain[:-1], chain[1:], joined)
    np.testing.assert_array_equal(times, box_cells(left, bottom, right, top).astype(np.int64))
    np.testing.assert_array_equal(
        star(origin, corners, np.ones(len(corners), dtype=np.bool_)), times > 0
    )


def box_cells(left: float, bottom: float, right: float, top: float) -> Bools:
    """Cells with their centres in a box that holds its left and lower side."""
    x, y = np.moveaxis(centres(SHAPE), -1, 0)
    inside: Bools = (left <= x) & (x < right) & (bottom <= y) & (y < top)
    return inside


@settings(max_examples=200)
@given(st.data())
def test_triangles_of_one_fan_hold_each_cell_once(data: st.DataObject) -> None:
    """The fan as a whole and its triangles one by one agree, also on the borders."""
    corner = st.tuples(dyadic(0, 32), dyadic(0, 24)).map(np.array)
    origin = data.draw(corner)
    corners = np.array(data.draw(st.lists(corner, min_size=3, max_size=10)))
    offset = corners - origin
    corners = corners[np.argsort(np.arctan2(offset[:, 1], offset[:, 0]), kind="stable")]
    start, end = corners[:-1], corners[1:]
    joined = np.ones(len(start), dtype=np.bool_)
    joined[-1] = False
    alone = np.zeros(1, dtype=np.bool_)
    times = np.zeros(SHAPE, dtype=np.int64)
    for row in range(len(start)):
        times += pieces(origin, start[row : row + 1], end[row : row + 1], alone)
    np.testing.assert_array_equal(times % 2 == 1, pieces(origin, start, end, joined))
    strict = _cross(start - origin, end - origin) > 0
    if strict.all():
        assert times.max() <= 1


def _cross(a: Floats, b: Floats) -> Floats:
    cross: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return cross


@settings(max_examples=200)
@given(rngs())
def test_a_line_visits_the_cells_it_passes_through(rng: np.random.Generator) -> None:
    ends = rng.uniform((-4.0, -4.0), (36.0, 28.0), size=(2, 2))
    if rng.uniform() < 0.3:
        ends[1] = ends[0] + rng.uniform(-0.5, 0.5, size=2)
    np.testing.assert_array_equal(
        drawn(ends, on_surface=1.0), cells_crossed(ends[0], ends[1], SHAPE)
    )


@settings(max_examples=100)
@given(st.data())
def test_a_line_between_cell_corners_and_centres_leaves_no_cell_out(data: st.DataObject) -> None:
    ends = np.array([[data.draw(dyadic(0, 31)), data.draw(dyadic(0, 23))] for _ in range(2)])
    found = drawn(ends, on_surface=1.0)
    crossed = cells_crossed(ends[0], ends[1], SHAPE)
    x, y = np.moveaxis(centres(SHAPE), -1, 0)
    # Along a border either side may be meant; elsewhere every cell crossed is visited.
    if (ends[0] != ends[1]).all():
        assert (found >= crossed).all()
    touched = shapely.dwithin(shapely.points(x, y), shapely.LineString(ends), np.sqrt(0.5) + 1e-9)
    assert (found <= touched).all()
    assert found.any()


@pytest.mark.parametrize("ends", [[(5.3, 7.2), (5.3, 7.2)], [(5.3, 7.2), (5.9, 7.9)]])
def test_a_line_within_one_cell_visits_that_cell(ends: list[tuple[float, float]]) -> None:
    assert np.argwhere(drawn(np.array(ends), on_surface=1.0)).tolist() == [[7, 5]]


@settings(max_examples=150)
@given(rngs())
def test_a_quadrangle_holds_the_cells_inside_and_those_along_its_flanks(
    rng: np.random.Generator,
) -> None:
    ends, outline = random_spread(rng)
    found = drawn(ends, outline=outline, around=1.0)
    expected = cells_inside(shapely.Polygon(outline), SHAPE)
    expected |= cells_crossed(outline[0], outline[3], SHAPE)
    expected |= cells_crossed(outline[1], outline[2], SHAPE)
    np.testing.assert_array_equal(found, expected)


def random_spread(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """An edge and the convex quadrangle around it along the rays of a distant viewpoint."""
    ends = rng.uniform((2.0, 2.0), (30.0, 22.0), size=(2, 2))
    viewpoint = rng.uniform((-60.0, -60.0), (-40.0, -40.0))
    ray = ends - viewpoint
    offset = ray / np.hypot(*ray.T)[:, None] * rng.uniform(0.2, 6.0, size=(2, 1))
    return ends, np.array([*(ends - offset), *(ends + offset)[::-1]])


@settings(max_examples=150)
@given(st.data())
def test_quadrangles_that_share_a_side_fill_what_they_cover_together(
    data: st.DataObject,
) -> None:
    """With borders on cell centres no cell is lost between the two, and none taken twice."""
    lower, middle, upper = (
        np.array([(3.0, y + data.draw(dyadic(-2, 2))), (29.0, y + data.draw(dyadic(-2, 2)))])
        for y in (4.0, 12.0, 20.0)
    )
    below = np.array([*lower, *middle[::-1]])
    above = np.array([*middle, *upper[::-1]])
    whole = np.array([*lower, *upper[::-1]])
    ends = np.zeros((2, 2)) - 50.0
    first, second, both = (
        drawn(ends, outline=outline, around=1.0) & away_from_flanks()
        for outline in (below, above, whole)
    )
    assert not (first & second).any()
    np.testing.assert_array_equal(first | second, both)


def away_from_flanks() -> Bools:
    """Where lines along x = 3 and x = 29 don't come."""
    x = centres(SHAPE)[..., 0]
    inside: Bools = (x > 4.0) & (x < 28.0)
    return inside


@settings(max_examples=100)
@given(rngs())
def test_caps_are_discs_around_the_ends(rng: np.random.Generator) -> None:
    ends = rng.uniform((-2.0, -2.0), (34.0, 26.0), size=(2, 2))
    caps = rng.uniform(0.1, 6.0, size=2)
    found = drawn(ends, caps=(caps[0], caps[1]), around=1.0)
    expected = cells_in_disc(ends[0], caps[0], SHAPE) | cells_in_disc(ends[1], caps[1], SHAPE)
    for end in ends:  # the flanks of an outline without width
        expected |= cells_crossed(end - 1e-9, end + 1e-9, SHAPE)
    np.testing.assert_array_equal(found, expected)


@settings(max_examples=100)
@given(rngs())
def test_a_disc_lies_around_the_middle_and_holds_its_own_cell(rng: np.random.Generator) -> None:
    ends = rng.uniform((-2.0, -2.0), (34.0, 26.0), size=(2, 2))
    radius = float(rng.uniform(0.05, 5.0))
    middle = ends.mean(axis=0)
    expected = cells_in_disc(middle, radius, SHAPE)
    expected |= cells_crossed(middle - 1e-9, middle + 1e-9, SHAPE)
    np.testing.assert_array_equal(drawn(ends, disc=radius, on_surface=1.0), expected)


@settings(max_examples=50)
@given(rngs())
def test_the_surer_surface_wins_in_any_order(rng: np.random.Generator) -> None:
    count = 6
    ends = rng.uniform((0.0, 0.0), (32.0, 24.0), size=(count, 2, 2))
    outlines = ends[:, [0, 1, 1, 0]] + np.array([(0, 0), (0, 0), (0, 3), (0, 3)])
    on_surface, around = rng.uniform(0.5, 1.0, size=count), rng.uniform(0.1, 0.5, size=count)
    around[: count // 2] = on_surface[: count // 2]  # as near the camera
    on_surface[1], tops = on_surface[0], rng.uniform(0.2, 2.0, size=count)
    ground_view = np.zeros((count, 2)), np.zeros(count)

    def drawing(order: list[int]) -> Floats:
        z = np.full(SHAPE, -1.0, dtype=np.float32)
        height = np.zeros(SHAPE, dtype=np.float32)
        picked = (
            outlines[order],
            outlines[order],
            ground_view[0],
            ground_view[1],
            on_surface[order],
            around[order],
            tops[order],
        )
        draw_surfaces(z, height, ends[order], ends[order], *picked, np.zeros(2), np.inf)
        return np.stack([z, height]).astype(np.float64)

    forth = drawing(list(range(count)))
    np.testing.assert_array_equal(forth, drawing(list(range(count))[::-1]))
    singly = np.array([drawing([row]) for row in range(count)])
    np.testing.assert_array_equal(forth[0], singly[:, 0].max(axis=0))
    # The surest surface of a cell gives its top, the highest known of equally sure ones.
    known = (singly[:, 0] == forth[0]) & np.isfinite(singly[:, 1])
    highest = np.where(known, singly[:, 1], -1.0).max(axis=0)
    np.testing.assert_array_equal(forth[1], np.where(known.any(axis=0), highest, np.inf))


@settings(max_examples=100)
@given(rngs())
def test_each_cell_has_the_height_of_the_lowest_line_of_sight_over_it(
    rng: np.random.Generator,
) -> None:
    eye, count = 1.2, int(rng.integers(1, 8))
    origin = rng.uniform((-2.0, -2.0), (34.0, 26.0))
    bearing, width = rng.uniform(-np.pi, np.pi, size=count), rng.uniform(0.05, 1.2, size=count)
    bearings = np.stack([bearing, bearing + width], axis=1)
    radius = rng.uniform(1.0, 30.0, size=(count, 2))
    ends = origin + radius[..., None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    heights = rng.uniform(0.0, 0.8, size=(count, 2))
    height = np.full(SHAPE, eye, dtype=np.float32)
    lowest_sight(height, origin, eye, ends, heights)
    expected = np.full(SHAPE, eye)
    for (a, b), low in zip(ends, heights, strict=True):
        sides = np.column_stack([a - origin, b - origin])
        shares = (centres(SHAPE) - origin) @ np.linalg.inv(sides).T
        inside = (shares >= 0).all(axis=-1) & (shares.sum(axis=-1) <= 1)
        line = eye + shares @ (low - eye)
        expected[inside] = np.minimum(expected, line)[inside]
    # Rounded up to 1/64 m.
    assert (height >= expected - 1e-6).all()
    assert (height <= expected + 1 / 64 + 1e-6).all()
