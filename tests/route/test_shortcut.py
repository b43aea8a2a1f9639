"""Shortcuts: never longer, closer to obstacles or more expensive than the route."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats, Ints
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, FREE, free_field, grid_of, masks, union_of_squares
from planners import CostSettings, NoRouteError, PlanningProblem, ProblemError, Route, plan
from planners.audit.audit import audit
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.distance import NOWHERE, squared_distances
from planners.geometry.polyline import cross_cells, length_of
from planners.route.kernels.shortcut import best_chain, keeps, leg_cost
from planners.route.shortcut import cost_of, shortcut, tighten

RADII = [0.0, 0.4, 0.5, math.sqrt(0.5), 1.0]
UNIFORM = np.empty((0, 0))
rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def cluttered(rng: np.random.Generator, *, side: int = 60, boxes: int = 40) -> Bools:
    """Return a map with boxes scattered over it."""
    blocked = np.zeros((side, side), dtype=np.bool_)
    for _ in range(boxes):
        row, col = rng.integers(0, side, 2)
        rows, cols = rng.integers(1, 9, 2)
        blocked[row : row + rows, col : col + cols] = True
    return blocked


def planned(
    blocked: Bools, start: Floats, goal: Floats, radius: float
) -> tuple[PlanningProblem, Route | None]:
    """Return a problem and A*'s route, if there is one."""
    grid = grid_of(np.where(blocked, BLOCKED, FREE))
    problem = PlanningProblem(grid, start=start, goal=goal, footprint=radius, clear_start=False)
    try:
        return problem, plan(problem)
    except NoRouteError:
        return problem, None


@given(rngs, st.sampled_from(RADII))
@settings(max_examples=80)
def test_it_is_never_longer_and_keeps_ends_and_radius(
    rng: np.random.Generator, radius: float
) -> None:
    start, goal = rng.uniform(0.1, 23.9, (2, 2))
    problem, route = planned(
        cluttered(rng, side=24, boxes=int(rng.integers(12))), start, goal, radius
    )
    if route is None:
        return
    tight = shortcut(problem, route)
    audit(problem, tight.waypoints)
    np.testing.assert_array_equal(tight.waypoints[[0, -1]], [start, goal])
    assert math.dist(start, goal) - 1e-9 <= tight.length <= route.length + 1e-9
    assert tight.min_clearance >= min(radius, route.min_clearance) - 1e-9
    assert (tight.min_clearance > 0) or (route.min_clearance == 0)
    assert tight.cost == tight.length
    assert (tight.bound, tight.planner, tight.expanded) == (1.0, "astar", route.expanded)
    assert tight.seconds > route.seconds


@given(masks(), rngs)
@settings(max_examples=60)
def test_among_single_cells_no_corner_is_touched_that_the_route_did_not(
    blocked: Bools, rng: np.random.Generator
) -> None:
    start, goal = rng.uniform(0.1, blocked.shape[::-1], (2, 2))
    problem, route = planned(blocked, start, goal, 0.0)
    if route is not None and route.min_clearance > 0:
        assert shortcut(problem, route).min_clearance > 0


@pytest.mark.parametrize("seed", range(4))
def test_a_requested_clearance_is_kept_where_the_route_kept_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, goal = np.array([[1.5, 1.5], [58.5, 58.5]])
    blocked = cluttered(rng, boxes=25)
    blocked[:4, :4] = blocked[-4:, -4:] = False
    problem, route = planned(blocked, start, goal, 0.5)
    assert route is not None
    lengths = []
    for clearance in (None, 0.3, 1.5, 100.0):
        tight = shortcut(problem, route, clearance=clearance)
        asked = max(clearance or 0.0, 0.5)
        assert tight.min_clearance >= min(asked, route.min_clearance) - 1e-9
        lengths.append(tight.length)
    assert lengths[0] == lengths[1] < lengths[2] <= lengths[3] <= route.length


def test_on_an_open_field_it_is_the_straight_line() -> None:
    problem = PlanningProblem(
        grid_of(free_field(64, 64)), start=(4.3, 5.1), goal=(59.8, 27.4), footprint=2.0
    )
    route = plan(problem)
    tight = shortcut(problem, route)
    assert len(route.waypoints) > 2
    assert tight.waypoints.tolist() == [[4.3, 5.1], [59.8, 27.4]]
    again = shortcut(problem, tight)
    np.testing.assert_array_equal(again.waypoints, tight.waypoints)


@pytest.mark.parametrize("radius", [0.0, 1.0, 3.7])
def test_around_the_end_of_a_wall_it_is_a_taut_string(radius: float) -> None:
    z = free_field(128, 128)
    z[:80, 60] = BLOCKED
    start, goal = (20.5, 30.5), (110.5, 50.5)
    problem = PlanningProblem(grid_of(z), start=start, goal=goal, footprint=radius)
    wall = shapely.box(60.0, 0.0, 61.0, 80.0).buffer(radius, quad_segs=64)
    corners = [p for p in shapely.get_coordinates(wall) if p[1] >= 80.0]
    string = shapely.convex_hull(shapely.MultiPoint([start, *corners, goal]))
    over = string.exterior.length - math.dist(start, goal)
    assert over <= shortcut(problem, plan(problem)).length + 1e-3
    assert shortcut(problem, plan(problem)).length == pytest.approx(over, abs=0.25)


@given(rngs)
@settings(max_examples=15)
def test_with_costs_it_is_never_more_expensive(rng: np.random.Generator) -> None:
    z = np.where(cluttered(rng), BLOCKED, rng.uniform(-1, -0.1, (60, 60)))
    costs = CostSettings(clearance_weight=rng.uniform(0, 5), confidence_weight=rng.uniform(0.1, 5))
    ends = rng.uniform(1, 59, (2, 2))
    problem = PlanningProblem(
        grid_of(z), start=ends[0], goal=ends[1], footprint=0.6, costs=costs, clear_start=False
    )
    try:
        route = plan(problem)
    except NoRouteError:
        return
    tight = shortcut(problem, route)
    costmap = Costmap.of(problem)
    before, after = (added_up(costmap, line) for line in (route.waypoints, tight.waypoints))
    assert tight.length <= route.length + 1e-9
    assert after <= before + 1e-6
    assert tight.cost == pytest.approx(route.cost - (before - after))
    assert cost_of(costmap, tight.waypoints) == pytest.approx(after)


def added_up(costmap: Costmap, line: Floats) -> float:
    """Return what a line costs, cell by cell [m]."""
    parts = cross_cells(costmap.to_cells(line))
    extra = np.minimum(costmap.costs[tuple(parts.cells.T)], 252) / 252 * costmap.top
    return float(((1 + extra) * parts.lengths).sum()) * costmap.window.resolution


def test_a_detour_around_expensive_cells_is_not_cut_short() -> None:
    z = free_field(64, 64)
    z[10:30, 20:40] = -0.02
    problem = PlanningProblem(
        grid_of(z),
        start=(5.5, 20.5),
        goal=(58.5, 20.5),
        footprint=0.5,
        costs=CostSettings(confidence_weight=20.0),
    )
    route = plan(problem)
    tight = shortcut(problem, route)
    expensive = shapely.box(20, 10, 40, 30)
    assert shapely.LineString(tight.waypoints).intersection(expensive).length < 1.0
    assert tight.length < route.length
    assert shortcut(replace(problem, costs=CostSettings()), route).length < 53.01


# The kernels


@given(masks(side=12), rngs, st.floats(0.01, 3.0))
@settings(max_examples=100)
def test_whether_a_segment_keeps_a_distance_agrees_with_shapely(
    blocked: Bools, rng: np.random.Generator, need: float
) -> None:
    a, b = rng.uniform(0, blocked.shape[::-1], (2, 2))
    distance = shapely.distance(shapely.LineString([a, b]), union_of_squares(blocked))
    assume(abs(distance - need) > 1e-9)
    squared = squared_distances(blocked, NOWHERE)
    assert keeps(blocked, squared, a[0], a[1], b[0], b[1], need) == (distance > need)
    assert keeps(blocked, squared, a[0], a[1], a[0], a[1], need) == (
        shapely.distance(shapely.Point(a), union_of_squares(blocked)) >= need
    )


@given(rngs, st.booleans())
@settings(max_examples=60)
def test_the_cost_of_a_leg_is_the_sum_over_the_crossed_cells(
    rng: np.random.Generator, on_lattice: bool
) -> None:
    factors = rng.uniform(1, 9, (7, 8))
    a, b = rng.uniform(0, (8, 7), (2, 2))
    if on_lattice:
        a, b = np.rint(2 * a).clip(0, 13) / 2, np.rint(2 * b).clip(0, 13) / 2
    parts = cross_cells(np.array([a, b]))
    cells = np.minimum(parts.cells, [6, 7])
    expected = (factors[tuple(cells.T)] * parts.lengths).sum()
    assert leg_cost(factors, *a, *b) == pytest.approx(expected)


@given(masks(side=12), rngs, st.floats(0.1, 1.0), st.sampled_from([3, 100]))
@settings(max_examples=40)
def test_the_chain_is_the_best_of_all_chains(
    blocked: Bools, rng: np.random.Generator, need: float, ahead: int
) -> None:
    points = rng.uniform(0, blocked.shape[::-1], (12, 2))
    legs = np.arange(12)
    chain = best_chain(
        blocked,
        squared_distances(blocked, NOWHERE),
        UNIFORM,
        points,
        legs,
        legs - 1,
        need,
        need,
        0.01,
        ahead,
    )
    expected = best_cost(blocked, points, need, ahead)
    cost = sum(math.dist(points[i], points[j]) + 0.01 for i, j in pairwise(chain.tolist()))
    assert cost == pytest.approx(expected)


def best_cost(blocked: Bools, points: Floats, need: float, ahead: int) -> float:
    squares, costs = union_of_squares(blocked), [0.0]
    for j in range(1, len(points)):
        reached = [
            costs[i] + math.dist(points[i], points[j]) + 0.01
            for i in range(max(0, j - ahead), j)
            if i == j - 1 or shapely.distance(shapely.LineString(points[[i, j]]), squares) >= need
        ]
        costs.append(min(reached))
    return costs[-1]


def test_a_leg_keeps_the_clearance_of_the_part_that_it_replaces() -> None:
    blocked: Bools = np.zeros((20, 20), dtype=np.bool_)
    blocked[0, 10] = True
    points = np.array([[2.0, 1.5], [10.5, 9.0], [19.0, 1.5]])
    legs: Ints = np.arange(3)
    squared = squared_distances(blocked, NOWHERE)
    for wanted, expected in ((0.4, [0, 2]), (0.6, [0, 1, 2]), (100.0, [0, 1, 2])):
        chain = best_chain(blocked, squared, UNIFORM, points, legs, legs - 1, 0.1, wanted, 0.01, 9)
        assert chain.tolist() == expected


# What is refused


def two_ways() -> tuple[PlanningProblem, Route]:
    problem = PlanningProblem(
        grid_of(free_field(64, 64)), start=(5, 5), goal=(50, 20), footprint=1.0, clear_start=False
    )
    return problem, plan(problem)


@pytest.mark.parametrize("clearance", [-0.1, math.nan, math.inf])
def test_a_clearance_that_is_none_is_refused(clearance: float) -> None:
    with pytest.raises(ProblemError, match="clearance: expected a distance of 0 or more"):
        shortcut(*two_ways(), clearance=clearance)


def test_a_route_of_another_problem_is_refused() -> None:
    problem, route = two_ways()
    with pytest.raises(ProblemError, match=r"route: .*got one from \(5.00, 5.00\) to \(50.00, 20"):
        shortcut(replace(problem, goal=(50, 21)), route)
    with pytest.raises(ProblemError, match=r"one that keeps 7.00 m.*got one that keeps 5.00 m"):
        shortcut(replace(problem, footprint=7.0), route)


def test_a_route_with_planned_headings_is_refused() -> None:
    problem, route = two_ways()
    turned = replace(route, headings=route.headings + 0.1, planner="hybrid_astar")
    with pytest.raises(ProblemError, match=r"with planned headings \(hybrid_astar\)"):
        shortcut(problem, turned)
    looking = replace(problem, goal=(50, 20, 3.0))
    assert shortcut(looking, plan(looking)).headings[-1] == 3.0


def test_a_map_that_is_not_flat_is_refused() -> None:
    _, route = two_ways()
    grid = ConfidenceGrid(resolution=1.0, origin=(0, 0, 0))
    problem = PlanningProblem(grid, start=(5, 5, 0), goal=(50, 20, 0), footprint=1.0)
    with pytest.raises(ProblemError, match="grid: expected a 2-D map, got a 3-D map"):
        shortcut(problem, route)


def test_a_line_of_thousands_of_turns_gets_no_longer() -> None:
    problem, _ = two_ways()
    rng = np.random.default_rng(0)
    line = np.column_stack([np.linspace(5, 50, 3000), 30 + np.cumsum(rng.normal(size=3000)) / 20])
    tight = tighten(Costmap.of(problem), line)
    assert length_of(tight) <= length_of(line)
    assert len(tight) == 2
