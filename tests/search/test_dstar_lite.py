"""D* Lite: after any changes, the cost is that of a search from scratch, with less work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap import ConfidenceGrid
from groundmap.arrays import Floats, Ints
from oracles_planning import BLOCKED, FREE, drawing, free_field, grid_of
from planners import CostSettings, PlanningProblem, TimeLimitError
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of
from planners.costmap.kernels.moves import COLS, ONE, ROWS
from planners.search.astar import AStar, AStarSettings
from planners.search.dstar_lite import DStarLite, DStarLiteSettings
from planners.search.kernels.astar import BEST, FAR
from planners.search.kernels.dstar_lite import G

SIDE = 10
GOAL = (1.9, 2.8)  # beside its cell's centre: joined to four cells
COSTLY = CostSettings(clearance_weight=2.0, inflation_radius=2.5, confidence_weight=1.0)

cells = st.tuples(st.integers(0, SIDE - 1), st.integers(0, SIDE - 1))
values = st.sampled_from([FREE, FREE, BLOCKED, -0.25])
changes = st.lists(st.tuples(cells, values), max_size=8)
places = st.tuples(st.floats(0.5, SIDE - 0.5), st.floats(0.5, SIDE - 0.5))


def put(grid: ConfidenceGrid, row: int, col: int, confidence: float) -> None:
    """Set the confidence of a cell of the grid, observed once."""
    (i, row), (j, col) = divmod(row, 64), divmod(col, 64)
    tile = grid.tile((i, j))
    tile.confidence[row, col] = confidence
    tile.count[row, col] = 1


def problem_on(
    grid: ConfidenceGrid, *, costs: CostSettings | None = None, radius: float = 0.0
) -> PlanningProblem:
    return PlanningProblem(
        grid,
        start=(SIDE - 1.5, SIDE - 1.5),
        goal=GOAL,
        footprint=radius,
        clear_start=False,
        costs=costs or CostSettings(),
    )


def cost_of(engine: DStarLite, start: tuple[float, float]) -> float:
    """Return the cost of the best route [cells]; inf for none, -1 for a straight piece."""
    found = engine.search(start, GOAL, DStarLiteSettings())
    if ends_of(engine.costmap, start, GOAL).direct:
        return -1.0
    return np.inf if found is None else float(engine.state[BEST]) / ONE


def expected_cost(costmap: Costmap, start: tuple[float, float]) -> float:
    """Return the same, from SciPy's Dijkstra on the costmap's cells, costs and steps."""
    ends = ends_of(costmap, start, GOAL)
    if ends.direct:
        return -1.0
    if len(ends.sources) == 0 or len(ends.targets) == 0:
        return np.inf
    distances = costs_from(costmap, ends.sources)
    rows, cols, final = ends.targets.T
    return float((distances[rows, cols] + final / ONE).min())


def costs_from(costmap: Costmap, sources: Ints) -> Floats:
    """Return the cost of every cell from the nearest source [cells]."""
    traversable, size = costmap.traversable, costmap.traversable.size
    number = np.arange(size).reshape(traversable.shape)
    edges = [(np.full(len(sources), size), number[sources[:, 0], sources[:, 1]], sources[:, 2])]
    for row, col in np.argwhere(traversable).tolist():
        for k in range(8):
            i, j = row + int(ROWS[k]), col + int(COLS[k])
            if 0 <= i < traversable.shape[0] and 0 <= j < traversable.shape[1]:
                block = traversable[min(row, i) : max(row, i) + 1, min(col, j) : max(col, j) + 1]
                price = int(costmap.costs[row, col]) + int(costmap.costs[i, j])
                if block.all():
                    step = costmap.steps[k % 2, price]
                    edges.append((number[row, [col]], number[i, [j]], np.array([step])))
    tails, heads, costs = (np.concatenate(column) for column in zip(*edges, strict=True))
    # 2^-60 of a cell: an edge of length 0 would be none.
    graph = coo_array((costs / ONE + 2.0**-60, (tails, heads)), shape=(size + 1, size + 1))
    distances: Floats = dijkstra(graph.tocsr(), indices=size)[:size].reshape(traversable.shape)
    return distances


@given(
    st.lists(st.tuples(changes, places), min_size=1, max_size=6),
    st.sampled_from([0.0, 0.5]),
    st.sampled_from([None, COSTLY]),
)
@settings(max_examples=40, deadline=None)
def test_after_any_changes_the_cost_is_dijkstras(
    rounds: list[tuple[list[tuple[tuple[int, int], float]], tuple[float, float]]],
    radius: float,
    costs: CostSettings | None,
) -> None:
    grid = grid_of(free_field(SIDE, SIDE))
    problem = problem_on(grid, costs=costs, radius=radius)
    engine = DStarLite(Costmap.of(problem))
    for changed, start in rounds:
        for (row, col), value in changed:
            put(grid, row, col, value)
        costmap = Costmap.of(problem)
        engine.update(costmap)
        assert cost_of(engine, start) == pytest.approx(expected_cost(costmap, start), abs=1e-7)


@given(st.integers(0, 2**32 - 1), st.sampled_from([None, COSTLY]))
@settings(max_examples=25)
def test_on_a_growing_map_the_cost_is_exactly_that_from_scratch(
    seed: int, costs: CostSettings | None
) -> None:
    rng = np.random.default_rng(seed)
    grid = grid_of(np.where(rng.random((SIDE, SIDE)) < 0.2, BLOCKED, FREE))
    problem = problem_on(grid, costs=costs)
    engine = DStarLite(Costmap.of(problem))
    for _ in range(6):
        low, high = rng.integers(-40, 0), rng.integers(SIDE, SIDE + 80)
        for row, col in rng.integers(low, high, (40, 2)).tolist():
            put(grid, row, col, BLOCKED if rng.random() < 0.3 else FREE)
        for row, col in rng.integers(-2, SIDE + 2, (30, 2)).tolist():
            put(grid, row, col, BLOCKED if rng.random() < 0.3 else FREE)
        costmap = Costmap.of(problem)
        engine.update(costmap)
        start = tuple(rng.uniform(0.5, SIDE - 0.5, 2).tolist())
        assert cost_of(engine, start) == cost_of(DStarLite(costmap), start)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_on_a_shrinking_or_moving_window_the_cost_is_exactly_that_from_scratch(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid = grid_of(np.where(rng.random((SIDE, SIDE)) < 0.25, BLOCKED, FREE))
    problem = replace(problem_on(grid), unknown="allow", clear_start=True)
    engine = DStarLite(Costmap.of(problem))
    for _ in range(6):
        start = tuple(rng.uniform(0.5, SIDE - 0.5, 2).tolist())
        around = float(rng.uniform(0, 30))  # [m] the window extends this far around the start
        costmap = Costmap.of(replace(problem, start=start, clear_start_radius=around))
        engine.update(costmap)
        assert cost_of(engine, start) == cost_of(DStarLite(costmap), start)


def test_a_goal_outside_of_the_window_is_found_again_once_inside() -> None:
    beyond = (5.5, 80.3)  # of the tile; the costmap contains it while the cleared start does
    problem = replace(problem_on(grid_of(free_field(SIDE, SIDE))), unknown="allow", goal=beyond)
    costmaps = [
        Costmap.of(replace(problem, clear_start=True, clear_start_radius=radius))
        for radius in (90.0, 3.0)
    ]
    engine = DStarLite(costmaps[0])
    for costmap, reached in zip([*costmaps, costmaps[0]], (True, False, True), strict=True):
        engine.update(costmap)
        found = engine.search(problem.start_xy, beyond, DStarLiteSettings())
        assert (found is not None) == reached


@given(st.integers(0, 2**32 - 1), st.sampled_from([None, COSTLY]))
@settings(max_examples=25)
def test_a_reversed_query_costs_the_same(seed: int, costs: CostSettings | None) -> None:
    rng = np.random.default_rng(seed)
    grid = grid_of(np.where(rng.random((20, 20)) < 0.3, BLOCKED, -rng.uniform(0.1, 1, (20, 20))))
    costmap = Costmap.of(problem_on(grid, costs=costs))
    engine = DStarLite(costmap)
    a, b = (tuple(xy) for xy in rng.uniform(0.5, 19.5, (2, 2)).tolist())
    forth, back = (engine.search(*ends, DStarLiteSettings()) for ends in ((a, b), (b, a)))
    astar = AStar(costmap).search(a, b, AStarSettings())
    assert (forth is None) == (back is None) == (astar is None)
    if forth is not None and back is not None and astar is not None:
        assert forth.cost == pytest.approx(back.cost, rel=1e-12)
        assert forth.cost == pytest.approx(astar.cost, rel=1e-12)


def test_a_far_change_costs_fewer_expansions_than_a_search_from_scratch() -> None:
    grid, problem = rooms()
    engine = DStarLite(Costmap.of(problem))
    first = engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    put(grid, 57, 3, BLOCKED)
    engine.update(Costmap.of(problem))
    second = engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    assert first is not None
    assert second is not None
    assert second.expanded < first.expanded / 20
    assert second.cost == first.cost


def test_a_change_before_the_robot_costs_fewer_expansions_than_a_search_from_scratch() -> None:
    grid, problem = rooms()
    engine = DStarLite(Costmap.of(problem))
    first = engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    assert first is not None
    for row, col in ((60, 58), (59, 59), (59, 60)):
        put(grid, row, col, BLOCKED)
    engine.update(Costmap.of(problem))
    second = engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    scratch = DStarLite(Costmap.of(problem)).search(problem.start_xy, GOAL, DStarLiteSettings())
    assert second is not None
    assert scratch is not None
    assert second.cost == pytest.approx(scratch.cost)
    assert second.expanded < scratch.expanded / 5


def rooms() -> tuple[ConfidenceGrid, PlanningProblem]:
    """Return four rooms, joined by doors, and a problem from one to the opposite one."""
    z = free_field(64, 64)
    z[31:33] = z[:, 31:33] = BLOCKED
    for door in (12, 50):
        z[31:33, door] = z[door, 31:33] = FREE
    grid = grid_of(z)
    return grid, replace(problem_on(grid), start=(60.5, 61.5))


def test_the_same_query_again_expands_nothing() -> None:
    _, problem = rooms()
    engine = DStarLite(Costmap.of(problem))
    answers = [engine.search(problem.start_xy, GOAL, DStarLiteSettings()) for _ in range(2)]
    assert answers[0] is not None
    assert answers[1] is not None
    assert answers[1].expanded == 0
    np.testing.assert_array_equal(answers[0].waypoints, answers[1].waypoints)


def test_a_robot_that_drives_its_route_expands_nothing_more() -> None:
    _, problem = rooms()
    engine = DStarLite(Costmap.of(problem))
    found = engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    while found is not None and len(found.waypoints) > 2:
        x, y = found.waypoints[1].tolist()
        found = engine.search((x, y), GOAL, DStarLiteSettings())
        assert found is not None
        assert found.expanded == 0


def test_an_enclosed_robot_has_no_route_until_its_enclosure_opens() -> None:
    grid = grid_of(
        drawing("""
        ..........
        ..........
        .....####.
        .....#..#.
        .....#..#.
        .....####.
        ..........
        ..........
    """)
    )
    problem = problem_on(grid)
    engine = DStarLite(Costmap.of(problem))
    inside = (6.5, 3.5)
    assert cost_of(engine, inside) == np.inf
    put(grid, 3, 5, FREE)
    engine.update(Costmap.of(problem))
    assert cost_of(engine, inside) == expected_cost(Costmap.of(problem), inside) < np.inf
    put(grid, 3, 5, BLOCKED)
    engine.update(Costmap.of(problem))
    assert cost_of(engine, inside) == np.inf


def test_a_goal_that_is_blocked_and_cleared_again_is_found_again() -> None:
    grid = grid_of(free_field(SIDE, SIDE))
    problem = problem_on(grid)
    engine = DStarLite(Costmap.of(problem))
    for value, reached in ((FREE, True), (BLOCKED, False), (FREE, True)):
        put(grid, 2, 1, value)
        engine.update(Costmap.of(problem))
        assert (cost_of(engine, (8.5, 8.5)) < np.inf) == reached


def test_another_goal_is_searched_from_scratch() -> None:
    _, problem = rooms()
    engine = DStarLite(Costmap.of(problem))
    for goal in (GOAL, (3.5, 60.5), (60.5, 2.5), GOAL):
        found = engine.search(problem.start_xy, goal, DStarLiteSettings())
        astar = AStar(engine.costmap).search(problem.start_xy, goal, AStarSettings())
        assert found is not None
        assert astar is not None
        assert found.cost == pytest.approx(astar.cost, rel=1e-12)
        assert found.waypoints[-1].tolist() == list(goal)


def test_another_weight_of_costs_is_searched_from_scratch() -> None:
    _, problem = rooms()
    engine = DStarLite(Costmap.of(replace(problem, costs=COSTLY)))
    engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    doubled = CostSettings(clearance_weight=4.0, inflation_radius=2.5, confidence_weight=2.0)
    costmap = Costmap.of(replace(problem, costs=doubled))
    np.testing.assert_array_equal(engine.costmap.costs, costmap.costs)
    engine.update(costmap)
    found = engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    astar = AStar(costmap).search(problem.start_xy, GOAL, AStarSettings())
    assert found is not None
    assert astar is not None
    assert found.cost == pytest.approx(astar.cost, rel=1e-12)


def test_slices_and_a_growing_heap_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = driven()
    monkeypatch.setattr(DStarLite, "slice_size", 7)
    monkeypatch.setattr(DStarLite, "first_room", 10)
    assert driven() == whole


def driven() -> list[float]:
    """Return costs of a drive through a maze that changes around the robot."""
    rng = np.random.default_rng(11)
    grid = grid_of(np.where(rng.random((60, 60)) < 0.2, BLOCKED, FREE))
    problem = problem_on(grid)
    engine = DStarLite(Costmap.of(problem))
    costs = []
    for i in range(58, 20, -4):
        for row, col in rng.integers(i - 10, i + 1, (30, 2)).tolist():
            put(grid, row, col, BLOCKED if rng.random() < 0.2 else FREE)
        put(grid, i, i, FREE)
        put(grid, 2, 1, FREE)
        engine.update(Costmap.of(problem))
        costs.append(cost_of(engine, (i + 0.5, i + 0.25)))
    return costs


def test_a_search_after_a_time_limit_continues(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, problem = rooms()
    expected = DStarLite(Costmap.of(problem)).search(problem.start_xy, GOAL, DStarLiteSettings())
    assert expected is not None
    engine = DStarLite(Costmap.of(problem))
    monkeypatch.setattr(DStarLite, "slice_size", 1)
    with pytest.raises(TimeLimitError, match=r"dstar_lite: no route within time_limit = 0.0002 s"):
        engine.search(problem.start_xy, GOAL, DStarLiteSettings(time_limit=2e-4))
    found = engine.search(problem.start_xy, GOAL, DStarLiteSettings(time_limit=None))
    assert found is not None
    assert found.cost == expected.cost
    assert found.expanded <= expected.expanded


def test_a_time_limit_of_zero_is_over_at_once() -> None:
    problem = problem_on(grid_of(free_field(SIDE, SIDE)))
    with pytest.raises(TimeLimitError, match=r"dstar_lite: no route within time_limit = 0 s"):
        DStarLite(Costmap.of(problem)).search(GOAL, GOAL, DStarLiteSettings(time_limit=0))


def test_settled_costs_are_the_distances_to_the_goal() -> None:
    _, problem = rooms()
    costmap = Costmap.of(replace(problem, costs=COSTLY))
    engine = DStarLite(costmap)
    engine.search(problem.start_xy, GOAL, DStarLiteSettings())
    settled = engine.labels[:, G].reshape(costmap.traversable.shape)
    expected = costs_from(costmap, ends_of(costmap, problem.start_xy, GOAL).targets)
    at = settled < FAR
    assert at.sum() > 500
    np.testing.assert_allclose(settled[at] / ONE, expected[at], rtol=0, atol=1e-7)
