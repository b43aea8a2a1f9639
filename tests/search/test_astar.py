"""A*: optimal, symmetric, interruptible."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap.arrays import Bools, Floats
from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, drawing, free_field, grid_of, masks, shortest_lengths
from planners import (
    AStarSettings,
    CostSettings,
    EnclosedError,
    NoRouteError,
    PlanningProblem,
    TimeLimitError,
    plan,
)
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.moves import COLS, ROWS
from planners.search.astar import AStar
from planners.search.base import SearchResult

RADII = [0.0, 0.4, 0.5, math.sqrt(0.5), 1.0]
places = st.tuples(st.floats(0, 9), st.floats(0, 9))


def mazes(seed: int, *, share: float = 0.35, side: int = 70) -> Bools:
    rng = np.random.default_rng(seed)
    blocked: Bools = rng.random((side, side)) < share
    blocked[1:3, 1:3] = blocked[-3:-1, -3:-1] = False
    return blocked


def cost_or_none(problem: PlanningProblem) -> float | None:
    """Return the length of the route, or None if there is none."""
    try:
        return plan(problem).length
    except NoRouteError:
        return None


@given(masks(), st.sampled_from(RADII), st.data())
@settings(max_examples=60)
def test_cost_is_dijkstras_on_the_oracles_graph(
    blocked: Bools, radius: float, data: st.DataObject
) -> None:
    grid = grid_of(np.where(blocked, BLOCKED, FREE))
    free = np.argwhere(~blocked)
    assume(len(free) > 0)
    start, goal = (free[data.draw(st.integers(0, len(free) - 1))] for _ in range(2))
    # All cells beyond the drawn ones are unknown.
    outside = np.pad(blocked, 1, constant_values=True)
    expected = shortest_lengths(outside, tuple(start + 1), radius)[tuple(goal + 1)]
    got = cost_or_none(
        PlanningProblem(
            grid,
            start=start[::-1] + 0.5,
            goal=goal[::-1] + 0.5,
            footprint=radius,
            clear_start=False,
        )
    )
    if (start == goal).all():
        assert got is None or got == 0.0
    else:
        assert (np.inf if got is None else got) == pytest.approx(expected, abs=1e-6)


@given(masks(), places, places, st.sampled_from(RADII))
@settings(max_examples=60)
def test_a_reversed_query_costs_the_same(
    blocked: Bools, a: tuple[float, float], b: tuple[float, float], radius: float
) -> None:
    grid = grid_of(np.where(blocked, BLOCKED, FREE))
    lengths = [
        cost_or_none(PlanningProblem(grid, start=p, goal=q, footprint=radius, clear_start=False))
        for p, q in ((a, b), (b, a))
    ]
    assert lengths[0] == pytest.approx(lengths[1], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_slices_and_a_growing_heap_change_nothing(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    grid = grid_of(np.where(mazes(seed), BLOCKED, FREE))
    problem = PlanningProblem(grid, start=(1.7, 1.6), goal=(68.2, 68.4), footprint=0.0)
    whole = plan(problem)
    monkeypatch.setattr(AStar, "slice_size", 7)
    monkeypatch.setattr(AStar, "first_room", 9)
    sliced = plan(problem)
    np.testing.assert_array_equal(sliced.waypoints, whole.waypoints)
    assert sliced.expanded == whole.expanded


def test_one_search_object_serves_many_queries() -> None:
    grid = grid_of(np.where(mazes(5, share=0.2), BLOCKED, FREE))
    rng = np.random.default_rng(5)
    problem = PlanningProblem(grid, start=(1.5, 1.5), goal=(9, 9), footprint=0, clear_start=False)
    shared = AStar(Costmap.of(problem))
    for a, b in rng.uniform(1, 69, (20, 2, 2)).tolist():
        assert shape_of(shared.search(a, b, AStarSettings())) == shape_of(
            AStar(Costmap.of(problem)).search(a, b, AStarSettings())
        )


def shape_of(found: SearchResult | None) -> list[list[float]] | None:
    return None if found is None else found.waypoints.tolist()


def test_no_corner_is_cut_at_radius_zero() -> None:
    with pytest.raises(EnclosedError, match="No passage connects start and goal"):
        plan(across("#. .#"))
    assert plan(across(".. .#")).length == pytest.approx(2.0)
    assert plan(across(".. ..")).length == pytest.approx(math.sqrt(2.0))


def across(text: str) -> PlanningProblem:
    """Return a problem from the lower left to the upper right of two by two cells."""
    return PlanningProblem(
        grid_of(drawing(text)),
        start=(0.5, 0.5),
        goal=(1.5, 1.5),
        footprint=0,
        clear_start=False,
    )


def test_a_start_beside_its_cells_centre_is_joined_by_a_straight_piece() -> None:
    grid = grid_of(free_field(64, 64))
    route = plan(PlanningProblem(grid, start=(5.9, 8.5), goal=(20.5, 8.5), footprint=1.0))
    assert route.length == pytest.approx(14.6)
    assert route.waypoints.tolist() == [[5.9, 8.5], [20.5, 8.5]]


def test_a_passage_exactly_as_wide_as_the_footprint_is_passed() -> None:
    z = free_field(64, 64)
    z[20:40, :30] = z[20:40, 33:] = BLOCKED
    for resolution in (0.1, 0.1524, 1.0):
        grid = grid_of(z, resolution=resolution)
        ends = [np.array(xy) * resolution for xy in ((10.5, 5.5), (50.5, 55.5))]
        radius = 1.5 * resolution
        route = plan(PlanningProblem(grid, start=ends[0], goal=ends[1], footprint=radius))
        assert route.min_clearance == pytest.approx(radius, abs=1e-9)
        with pytest.raises(EnclosedError, match=r"m wide at .*; the footprint needs") as caught:
            plan(PlanningProblem(grid, start=ends[0], goal=ends[1], footprint=radius * 1.001))
        assert caught.value.widest_gap == pytest.approx(2 * radius)


def test_a_time_limit_of_zero_is_over_at_once() -> None:
    problem = PlanningProblem(
        grid_of(free_field(64, 64)), start=(5, 5), goal=(5.1, 5.1), footprint=1
    )
    with pytest.raises(TimeLimitError, match=r"astar: no route within time_limit = 0 s \(0 nodes"):
        plan(problem, time_limit=0)


def test_unknown_settings_are_refused_by_name() -> None:
    problem = PlanningProblem(grid_of(free_field(64, 64)), start=(5, 5), goal=(9, 9), footprint=1)
    with pytest.raises(SettingsError, match=r"time_limt.*Did you mean 'time_limit'"):
        plan(problem, time_limt=3)
    with pytest.raises(SettingsError, match="time_limit: expected"):
        plan(problem, time_limit=-1)


def test_waypoints_turn_at_every_inner_point() -> None:
    grid = grid_of(np.where(mazes(2, share=0.2), BLOCKED, FREE), resolution=0.1524)
    route = plan(PlanningProblem(grid, start=(0.3, 0.3), goal=(10.3, 10.3), footprint=0))
    steps: Floats = np.diff(route.waypoints, axis=0)
    steps /= np.hypot(*steps.T)[:, None]
    turns = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    assert (np.abs(turns) > 1e-6).all()


def costly_problem(seed: int, goal: tuple[float, float] = (29.5, 29.5)) -> PlanningProblem:
    """Return a problem on a map whose cells differ in confidence."""
    rng = np.random.default_rng(seed)
    z = np.where(rng.random((32, 32)) < 0.2, BLOCKED, -rng.uniform(0.05, 1.0, (32, 32)))
    z[1, 1] = z[29, 29] = FREE
    return PlanningProblem(
        grid_of(z),
        start=(1.5, 1.5),
        goal=goal,
        footprint=0.0,
        clear_start=False,
        costs=CostSettings(confidence_weight=4.0, clearance_weight=2.0),
    )


def dijkstra_cost(costmap: Costmap) -> float:
    """Return the least cost between the cells of start and goal, by SciPy [cells]."""
    extra = np.where(costmap.traversable, costmap.costs, 0) * (costmap.top / 252)
    index = np.arange(costmap.blocked.size).reshape(costmap.blocked.shape)
    edges = []
    for k in range(8):
        for a in np.argwhere(costmap.moves >> k & 1):
            b = a + np.array([ROWS[k], COLS[k]])
            factor = 1 + (extra[tuple(a)] + extra[tuple(b)]) / 2
            edges.append((index[tuple(a)], index[tuple(b)], (1, math.sqrt(2))[k & 1] * factor))
    tails, heads, costs = np.array(edges).T
    graph = coo_array((costs, (tails.astype(int), heads.astype(int))), shape=(index.size,) * 2)
    start, goal = costmap.window.world_to_cell([(1.5, 1.5), costmap.problem.goal_xy])
    return float(dijkstra(graph.tocsr(), indices=index[tuple(start)])[index[tuple(goal)]])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("planner", ["astar", "dijkstra"])
def test_costs_of_cells_are_those_on_the_oracles_graph(seed: int, planner: str) -> None:
    problem = costly_problem(seed)
    expected = dijkstra_cost(Costmap.of(problem))
    if np.isinf(expected):
        with pytest.raises(EnclosedError, match="no route"):
            plan(problem, planner)
    else:
        route = plan(problem, planner)
        assert route.cost == pytest.approx(expected, rel=1e-6)
        assert route.cost > route.length
        assert route.bound == 1.0


def test_the_estimate_reduces_expansions() -> None:
    problem = costly_problem(1, goal=(15.5, 9.5))
    assert plan(problem, "astar").expanded < plan(problem, "dijkstra").expanded


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("weight", [1.0, 1.2, 2.5, 10.0])
def test_weighted_astar_keeps_its_bound(seed: int, weight: float) -> None:
    problem = costly_problem(seed)
    try:
        best = plan(problem)
    except EnclosedError:
        with pytest.raises(EnclosedError, match="no route"):
            plan(problem, "weighted_astar", weight=weight)
        return
    route = plan(problem, "weighted_astar", weight=weight)
    assert route.bound is not None
    assert best.cost <= route.cost + 1e-9 <= route.bound * best.cost + 2e-9
    assert weight - 1 / 256 <= route.bound <= weight


def test_weighted_astar_expands_less_on_open_maps() -> None:
    grid = grid_of(np.where(mazes(2, share=0.1), BLOCKED, FREE))
    problem = PlanningProblem(grid, start=(1.5, 1.5), goal=(68.5, 60.5), footprint=0.0)
    assert plan(problem, "weighted_astar", weight=3).expanded < plan(problem).expanded / 2


def test_a_weight_below_one_is_refused() -> None:
    with pytest.raises(SettingsError, match="weight: expected greater than or equal to 1"):
        plan(costly_problem(0), "weighted_astar", weight=0.5)
