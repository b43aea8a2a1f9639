"""The widest path: none is wider, it is short, and its bottleneck limits it."""

from __future__ import annotations

import math
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra, minimum_spanning_tree

from groundmap.arrays import Bools, Ints
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import (
    BLOCKED,
    FREE,
    STEPS,
    drawing,
    free_field,
    grid_of,
    masks,
    ringed,
    union_of_squares,
)
from planners import EnclosedError, NonFreeError, OutsideMapError, PlanningProblem, ProblemError
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.distance import NOWHERE
from planners.costmap.kernels.moves import COLS, ROWS
from planners.no_route import widest_route
from planners.search.kernels.lattice import squared_clearance
from planners.search.kernels.widest_path import UNIT, WIDER, spread, steps_over
from planners.search.widest_path import WidestRoute, widest_path

CUT = 2e-9  # [cells] largest error of the root of squares of at least 0.05 cells, cut to 2^-30
OFFSETS = st.sampled_from([0.0, 0.1, 0.25, 0.3, 0.5, 0.7, 0.75])


def problem(grid: ConfidenceGrid, start: Any, goal: Any, **values: Any) -> PlanningProblem:
    asked = {"footprint": 0.0, "clear_start": False} | values
    return PlanningProblem(grid, start=start, goal=goal, **asked)


def drawn(text: str) -> ConfidenceGrid:
    return grid_of(drawing(text))


def lattice_oracle(blocked: Bools) -> Ints:
    """Return the squared clearance of the half-cell lattice, from SciPy's distance transform."""
    rows, cols = blocked.shape
    clear = np.ones((2 * rows + 1, 2 * cols + 1), dtype=np.bool_)
    for i, j in np.ndindex(3, 3):
        clear[i : i + 2 * rows : 2, j : j + 2 * cols : 2] &= ~blocked
    squared: Ints = np.rint(ndimage.distance_transform_edt(clear) ** 2).astype(np.int64)
    return squared


class Graph:
    """The half-cell lattice with two places beside it; clearances of steps by shapely."""

    def __init__(self, blocked: Bools, a: tuple[float, float], b: tuple[float, float]) -> None:
        self.blocked, self.obstacles = blocked, union_of_squares(blocked)
        rows, cols = blocked.shape
        nodes = list(product(range(2 * rows + 1), range(2 * cols + 1)))
        self.places = np.array([(col / 2, row / 2) for row, col in nodes] + [a, b])
        index = {node: i for i, node in enumerate(nodes)}
        pairs = []
        for (row, col), (i, j) in product(nodes, STEPS):
            if (row + i, col + j) in index and (not i or not j or (row + col) % 2 == 0):
                pairs.append((index[row, col], index[row + i, col + j]))
        for k, place in ((-2, a), (-1, b)):
            pairs += [(len(self.places) + k, index[node]) for node in around(place)]
        pairs.append((len(self.places) - 2, len(self.places) - 1))
        self.pairs = np.array([pair for pair in pairs if self.spans_free_cells(*pair)])
        lines = shapely.linestrings(self.places[self.pairs])
        self.clear = shapely.distance(lines, self.obstacles)
        self.lengths = shapely.length(lines)

    def spans_free_cells(self, i: int, j: int) -> bool:
        """Whether the cells between two places are free and at most 2 x 2, as for moves."""
        if max(i, j) < len(self.places) - 2:
            return True
        (left, low), (right, high) = np.floor(np.sort(self.places[[i, j]], axis=0)).astype(int)
        block = self.blocked[low : high + 1, left : right + 1]
        inside = high < self.blocked.shape[0] and right < self.blocked.shape[1]
        return bool(inside and max(block.shape) <= 2 and not block.any())

    def widest(self) -> float:
        """Return the clearance of the widest path, from the maximum spanning tree."""
        use = self.clear > 0
        n = len(self.places)
        graph = coo_array((-self.clear[use], tuple(self.pairs[use].T)), shape=(n, n)).tocsr()
        tree = minimum_spanning_tree(graph)
        _, before = breadth_first_order(tree, n - 2, directed=False)
        way = [n - 1]
        while way[-1] != n - 2:
            if before[way[-1]] < 0:
                return 0.0
            way.append(int(before[way[-1]]))
        return min(-float(tree[i, j] + tree[j, i]) for i, j in pairwise(way))

    def shortest(self, clearance: float) -> float:
        """Return the length of the shortest path of a clearance."""
        use = self.clear >= clearance - 1e-9
        n = len(self.places)
        edges = (self.lengths[use], tuple(self.pairs[use].T))
        lengths = dijkstra(coo_array(edges, shape=(n, n)).tocsr(), directed=False, indices=n - 2)
        return float(lengths[n - 1])


def around(place: tuple[float, float]) -> set[tuple[int, int]]:
    """Return the lattice points around a place, and the centres around it."""
    x, y = place
    near = product((math.floor(2 * y), math.ceil(2 * y)), (math.floor(2 * x), math.ceil(2 * x)))
    rows, cols = ((math.floor(v - 0.5), math.ceil(v - 0.5)) for v in (y, x))
    return set(near) | {(2 * row + 1, 2 * col + 1) for row, col in product(rows, cols)}


@given(masks(side=12))
def test_lattice_clearance_is_that_of_a_distance_transform(blocked: Bools) -> None:
    np.testing.assert_array_equal(squared_clearance(blocked), lattice_oracle(blocked))


def test_without_blocked_cells_the_lattice_is_clear_everywhere() -> None:
    assert (squared_clearance(np.zeros((3, 4), dtype=np.bool_)) == NOWHERE).all()


@given(masks(side=6), st.integers(1, 9))
def test_steps_join_points_that_are_clear_enough(blocked: Bools, least: int) -> None:
    squared = np.pad(squared_clearance(blocked), 1)
    steps = steps_over(squared.ravel(), squared.shape[1], least).reshape(squared.shape)
    for row, col in np.ndindex(squared.shape):
        for k in range(8):
            there = (row + int(ROWS[k]), col + int(COLS[k]))
            within = all(0 <= i < n for i, n in zip(there, squared.shape, strict=True))
            along = k % 2 == 0 or (row + col) % 2 == 0
            expected = within and along and min(squared[row, col], squared[there]) >= least
            assert bool(steps[row, col] >> k & 1) == expected


@st.composite
def two_places(draw: st.DrawFn, *, side: int) -> tuple[Bools, Any, Any]:
    """Draw blocked cells within a ring, and two places on free ones."""
    blocked = ringed(draw(masks(side=side)))
    free = np.argwhere(~blocked).tolist()
    assume(free)
    cells = [draw(st.sampled_from(free)) for _ in range(2)]
    a, b = ((col + draw(OFFSETS), row + draw(OFFSETS)) for row, col in cells)
    return blocked, a, b


@given(two_places(side=7))
@settings(max_examples=80, deadline=None)
def test_no_path_is_wider_and_no_equally_wide_one_is_half_as_long(
    drawn_case: tuple[Bools, Any, Any],
) -> None:
    blocked, a, b = drawn_case
    graph = Graph(blocked, a, b)
    route = widest_path(costmap_of_mask(blocked, a, b))
    expected = graph.widest()
    if route is None:
        assert expected == 0.0
        return
    assert route.clearance == pytest.approx(expected, abs=CUT)
    assert route.width == 2.0 * route.clearance
    line = shapely.LineString(route.waypoints)
    assert route.waypoints[[0, -1]].tolist() == [list(a), list(b)]
    assert shapely.distance(line, graph.obstacles) == pytest.approx(expected, abs=1e-9)
    shortest = graph.shortest(expected)
    assert shortest - 1e-9 <= line.length <= 2 * shortest + 1e-9


@given(two_places(side=7))
@settings(max_examples=60, deadline=None)
def test_the_bottleneck_is_the_narrowest_point_of_the_path(
    drawn_case: tuple[Bools, Any, Any],
) -> None:
    blocked, a, b = drawn_case
    for place in ("start", "goal"):
        route = widest_path(costmap_of_mask(blocked, a, b), seen_from=place)
        assume(route is not None)
        assert isinstance(route, WidestRoute)
        spot = shapely.Point(route.bottleneck)
        assert shapely.distance(spot, shapely.LineString(route.waypoints)) <= 1e-9
        clear = shapely.distance(spot, union_of_squares(blocked))
        # A slanted piece at an end may be narrowest in its middle: it extends over half a cell.
        assert route.clearance - 1e-9 <= clear <= route.clearance + math.hypot(0.5, 0.5)


@given(two_places(side=9))
@settings(max_examples=60, deadline=None)
def test_the_reverse_path_is_as_wide(drawn_case: tuple[Bools, Any, Any]) -> None:
    blocked, a, b = drawn_case
    there, back = (widest_path(costmap_of_mask(blocked, *ends)) for ends in ((a, b), (b, a)))
    assert (there is None) == (back is None)
    if there is not None and back is not None:
        assert there.width == pytest.approx(back.width, abs=2 * CUT)


@given(masks(side=9), st.data())
@settings(max_examples=60, deadline=None)
def test_marked_points_are_those_that_a_wider_path_reaches(
    blocked: Bools, data: st.DataObject
) -> None:
    squared = np.pad(squared_clearance(ringed(blocked)), 1)
    points = np.flatnonzero(squared).tolist()
    assume(points)
    source, target = (data.draw(st.sampled_from(points)) for _ in range(2))
    keys = squared.ravel().astype(np.int64) * UNIT
    key, parts = spread(
        squared.ravel(),
        squared.shape[1],
        np.array([[source, keys[source]]]),
        np.array([[target, keys[target]]]),
    )
    above = keys > key
    expected = connected(above.reshape(squared.shape), source) & above
    np.testing.assert_array_equal(parts == WIDER, expected)
    at_least = connected((keys >= max(key, 1)).reshape(squared.shape), source)
    assert bool(at_least[target]) == (key > 0)


def connected(clear: Bools, source: int) -> Bools:
    """Return the lattice points that steps over clear ones join to a source, shape (points,)."""
    nodes = np.arange(clear.size).reshape(clear.shape)
    evens = (np.indices(clear.shape).sum(axis=0) % 2 == 0)[:-1]
    pairs = [
        np.stack([nodes[:, :-1].ravel(), nodes[:, 1:].ravel()]),
        np.stack([nodes[:-1].ravel(), nodes[1:].ravel()]),
        np.stack([nodes[:-1, :-1][evens[:, :-1]], nodes[1:, 1:][evens[:, :-1]]]),
        np.stack([nodes[:-1, 1:][evens[:, 1:]], nodes[1:, :-1][evens[:, 1:]]]),
    ]
    i, j = np.concatenate(pairs, axis=1)
    both = clear.ravel()[i] & clear.ravel()[j]
    graph = coo_array((np.ones(both.sum()), (i[both], j[both])), shape=(clear.size, clear.size))
    reached = np.zeros(clear.size, dtype=np.bool_)
    reached[breadth_first_order(graph.tocsr(), source, directed=False)[0]] = True
    return reached & clear.ravel()


def costmap_of_mask(blocked: Bools, a: Any, b: Any) -> Costmap:
    """Return the costmap of a map that begins at cell [0, 0] of the mask."""
    return Costmap.of(problem(grid_of(np.where(blocked, BLOCKED, FREE)), a, b))


def two_rooms(*gaps: tuple[int, int, int]) -> ConfidenceGrid:
    """Return a field with walls at columns, each with a gap from a row to another one."""
    z = free_field(64, 64)
    for col, low, high in gaps:
        z[:, col : col + 2] = BLOCKED
        z[low:high, col : col + 2] = FREE
    return grid_of(z)


def test_the_bottleneck_is_the_gap_and_not_another_point_of_equal_clearance() -> None:
    route = widest_route(problem(two_rooms((30, 40, 43)), (10.3, 9.2), (50.5, 9.5)))
    assert route.width == 3.0
    assert route.bottleneck == (31.0, 41.5)


def test_of_two_gaps_the_narrower_is_the_bottleneck() -> None:
    grid = two_rooms((20, 10, 16), (40, 50, 53))
    for ends in (((9.5, 30.5), (55.5, 30.5)), ((55.5, 30.5), (9.5, 30.5))):
        route = widest_route(problem(grid, *ends))
        assert (route.width, route.bottleneck) == (3.0, (41.0, 51.5))


def test_of_two_equal_gaps_the_bottleneck_is_the_one_nearer_to_seen_from() -> None:
    costmap = Costmap.of(problem(two_rooms((20, 10, 13), (40, 50, 53)), (9.5, 30.5), (55.5, 30.5)))
    seen = {place: widest_path(costmap, seen_from=place) for place in ("start", "goal")}
    spots = {place: route.bottleneck for place, route in seen.items() if route is not None}
    assert spots == {"start": (21.0, 11.5), "goal": (41.0, 51.5)}


def test_of_equally_wide_paths_the_shortest_is_returned() -> None:
    z = free_field(64, 64)
    z[:, 30:32] = BLOCKED
    z[10:13, 30:32] = z[50:53, 30:32] = FREE
    route = widest_route(problem(grid_of(z), (20.5, 20.5), (40.5, 20.5)))
    assert route.bottleneck == (31.0, 11.5)


def test_a_start_beside_a_wall_is_the_bottleneck() -> None:
    route = widest_route(problem(two_rooms((30, 40, 43)), (29.25, 9.5), (10.5, 30.5)))
    assert (route.width, route.bottleneck) == (1.5, (29.25, 9.5))


def test_a_goal_beside_a_wall_is_the_bottleneck() -> None:
    route = widest_route(problem(two_rooms((30, 40, 43)), (10.5, 30.5), (29.25, 9.5)))
    assert (route.width, route.bottleneck) == (1.5, (29.25, 9.5))


def test_from_a_place_to_itself_the_width_is_that_of_the_place() -> None:
    route = widest_route(problem(two_rooms((30, 40, 43)), (12.3, 9.2), (12.3, 9.2)))
    assert route.waypoints.tolist() == [[12.3, 9.2], [12.3, 9.2]]
    assert route.clearance == pytest.approx(9.2)
    assert route.bottleneck == (12.3, 9.2)


def test_a_corner_that_two_blocked_cells_share_is_no_way() -> None:
    with pytest.raises(EnclosedError, match="No passage connects start and goal, however narrow"):
        widest_route(problem(drawn("#. .#"), (0.5, 0.5), (1.5, 1.5)))
    assert widest_route(problem(drawn(".. .#"), (0.5, 0.5), (1.5, 1.5))).width == 1.0


def test_without_blocked_cells_it_is_infinitely_wide_and_straight() -> None:
    asked = problem(grid_of(free_field(64, 64)), (3.5, 3.5), (40.5, 20.5), unknown="allow")
    route = widest_route(asked)
    assert route.width == route.clearance == math.inf
    assert shapely.LineString(route.waypoints).length == pytest.approx(20 + 17 * math.sqrt(2))


def test_it_does_not_depend_on_the_footprint() -> None:
    grid, ends = two_rooms((30, 40, 43)), ((10.3, 9.2), (50.5, 9.5))
    first, *others = (widest_route(problem(grid, *ends, footprint=r)) for r in (0.0, 1.0, 99.0))
    for other in others:
        np.testing.assert_array_equal(first.waypoints, other.waypoints)


def test_the_start_is_cleared_as_for_the_footprint() -> None:
    z = free_field(64, 64)
    z[18:23, 18:23] = 0.0
    asked: dict[str, Any] = {"footprint": 2.0, "clear_start": True}
    route = widest_route(problem(grid_of(z), (20.5, 20.5), (50.5, 20.5), **asked))
    assert route.width == pytest.approx(2 * (64 - 50.5))


def test_invalid_places_are_refused() -> None:
    grid = two_rooms((30, 40, 43))
    with pytest.raises(NonFreeError, match=r"goal \(30.50, 9.50\): .* non-free space"):
        widest_route(problem(grid, (10.5, 9.5), (30.5, 9.5)))
    with pytest.raises(OutsideMapError, match=r"goal \(90.00, 9.50\) is outside the map"):
        widest_route(problem(grid, (10.5, 9.5), (90, 9.5)))


def test_a_map_in_three_dimensions_is_refused() -> None:
    asked = PlanningProblem(
        ConfidenceGrid(origin=(0, 0, 0)), start=(1, 1, 1), goal=(2, 2, 2), footprint=0.1
    )
    with pytest.raises(ProblemError, match="grid: expected a 2-D map, got a 3-D map"):
        widest_route(asked)


@pytest.mark.parametrize("resolution", [0.1, 0.1524])
def test_widths_are_in_metres(resolution: float) -> None:
    z = free_field(64, 64)
    z[:, 30:32] = BLOCKED
    z[40:43, 30:32] = FREE
    grid = grid_of(z, resolution=resolution, origin=(-3.0, 7.0))
    a, b, spot = (
        np.array(xy) * resolution + (-3.0, 7.0) for xy in ((10.5, 9.5), (50.5, 9.5), (31.0, 41.5))
    )
    route = widest_route(problem(grid, a, b))
    assert route.width == pytest.approx(3 * resolution)
    assert route.bottleneck == pytest.approx(spot)
    assert route.waypoints[[0, -1]].tolist() == [a.tolist(), b.tolist()]
