"""Line of sight, Theta* and Lazy Theta*: exact visibility, routes as defined."""

from __future__ import annotations

import heapq
import math
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Bytes, Ints
from oracles_planning import BLOCKED, FREE, drawing, free_field, grid_of
from oracles_visibility import (
    bitmaps,
    centre,
    costmap_of,
    noise,
    region,
    sees,
    visibility_lengths,
)
from planners import PlanningProblem, ProblemError, TimeLimitError
from planners.audit.audit import audit
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.moves import COLS, ONE, ROWS
from planners.costmap.moves import allowed_moves
from planners.geometry.polyline import length_of
from planners.problem.costs import CostSettings
from planners.search.kernels.heap import TIE_SHIFT
from planners.search.kernels.sight import sight
from planners.search.theta import LazyTheta, LazyThetaSettings, Theta, ThetaSettings

ENGINES = [(Theta, ThetaSettings()), (LazyTheta, LazyThetaSettings())]


def traversable_in(text: str) -> Bools:
    """Return the traversable cells of a drawing."""
    traversable: Bools = drawing(text) == FREE
    return traversable


@given(bitmaps())
@settings(max_examples=40)
def test_cells_see_each_other_if_the_line_between_them_is_in_the_region(traversable: Bools) -> None:
    moves, cells = allowed_moves(traversable), np.argwhere(traversable)
    each = [(i, j) for i, j in product(range(len(cells)), repeat=2) if i != j]
    pairs = np.array(each, dtype=np.int64).reshape(-1, 2)
    got = [sight(moves, *cells[i], *cells[j]) for i, j in pairs]
    expected = sees(region(traversable), cells[:, ::-1].astype(np.float64), pairs)
    assert got == expected.tolist()


def test_sight_passes_where_two_squares_meet_in_a_corner() -> None:
    moves = allowed_moves(traversable_in("#.. ... ..#"))
    assert sight(moves, 0, 0, 2, 2)
    assert not sight(moves, 0, 0, 2, 1)
    assert not sight(moves, 0, 1, 1, 2)


def test_sight_runs_along_corridors_of_one_cell() -> None:
    moves = allowed_moves(traversable_in("#.# ... #.#"))
    assert sight(moves, 0, 1, 2, 1)
    assert sight(moves, 1, 2, 1, 0)
    assert not sight(moves, 0, 1, 1, 2)
    assert sight(moves, 1, 1, 1, 1)


@pytest.mark.parametrize(("engine", "options"), ENGINES)
@given(traversable=bitmaps(), data=st.data())
@settings(max_examples=30)
def test_routes_are_those_of_the_reference(
    engine: type[Theta], options: ThetaSettings, traversable: Bools, data: st.DataObject
) -> None:
    cells = np.argwhere(traversable)
    searching = engine(costmap_of(traversable))
    for _ in range(3):
        a, b = (cells[data.draw(st.integers(0, len(cells) - 1))] for _ in range(2))
        found = searching.search(centre(a), centre(b), options)
        if np.abs(a - b).max() <= 1:
            continue  # within two by two cells, there is no search
        expected = twin(allowed_moves(traversable), a, b, lazy=engine.lazy)
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            turns = np.array(expected, dtype=np.float64)
            assert length_of(found.waypoints) == pytest.approx(length_of(turns), rel=1e-12)


@pytest.mark.parametrize(("engine", "options"), ENGINES)
@given(traversable=bitmaps(), data=st.data())
@settings(max_examples=30)
def test_no_route_is_shorter_than_the_shortest_and_all_legs_are_in_sight(
    engine: type[Theta], options: ThetaSettings, traversable: Bools, data: st.DataObject
) -> None:
    cells = np.argwhere(traversable)
    _, lengths = visibility_lengths(traversable)
    i, j = (data.draw(st.integers(0, len(cells) - 1)) for _ in range(2))
    found = engine(costmap_of(traversable)).search(centre(cells[i]), centre(cells[j]), options)
    assert (found is not None) == np.isfinite(lengths[i, j])
    if found is not None:
        assert length_of(found.waypoints) >= lengths[i, j] - 1e-9
        turns = np.rint(found.waypoints - 0.5).astype(np.int64)[:, ::-1]
        moves = allowed_moves(traversable)
        assert all(sight(moves, *a, *b) for a, b in pairwise(turns))


def twin(moves: Bytes, start: Ints, goal: Ints, *, lazy: bool) -> list[tuple[int, int]] | None:
    """Return where Theta* turns [row, col], in plain Python, with ties as in the kernel's heap."""
    width = moves.shape[1]
    source, target = int(start[0] * width + start[1]), int(goal[0] * width + goal[1])
    cost, parent, closed = {source: 0.0}, {source: source}, set[int]()
    heap: list[tuple[int, int, int]] = []

    def away(a: int, b: int) -> float:
        return math.hypot(a // width - b // width, a % width - b % width)

    def clear(a: int, b: int) -> bool:
        return bool(sight(moves, a // width, a % width, b // width, b % width))

    def beside(node: int) -> list[int]:
        allowed = int(moves[node // width, node % width])
        return [node + int(ROWS[k]) * width + int(COLS[k]) for k in range(8) if allowed >> k & 1]

    def wait(node: int) -> None:
        h = away(node, target)
        heapq.heappush(heap, (int((cost[node] + h) * ONE), int(h * ONE) >> TIE_SHIFT, node))

    wait(source)
    while heap:
        _, _, node = heapq.heappop(heap)
        if node in closed:
            continue
        if lazy and not clear(parent[node], node):
            parent[node] = min(
                (n for n in beside(node) if n in closed), key=lambda n: cost[n] + away(n, node)
            )
            cost[node] = cost[parent[node]] + away(parent[node], node)
        closed.add(node)
        if node == target:
            break
        for near in set(beside(node)) - closed:
            through = parent[node] if lazy or clear(parent[node], near) else node
            if cost[through] + away(through, near) < cost.get(near, math.inf):
                cost[near], parent[near] = cost[through] + away(through, near), through
                wait(near)
    if target not in closed:
        return None
    line = [target]
    while parent[line[-1]] != line[-1]:
        line.append(parent[line[-1]])
    return [divmod(node, width) for node in line]


@pytest.mark.parametrize(("engine", "options"), ENGINES)
def test_slices_and_a_growing_heap_change_nothing(
    engine: type[Theta], options: ThetaSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    costmap = costmap_of(noise(60, share=0.8))
    ends = centre((1, 1)), centre((58, 58))
    searching = engine(costmap)
    whole = searching.search(*ends, options)
    monkeypatch.setattr(Theta, "slice_size", 7)
    monkeypatch.setattr(Theta, "first_room", 9)
    sliced = engine(costmap).search(*ends, options)
    assert whole is not None
    assert sliced is not None
    np.testing.assert_array_equal(sliced.waypoints, whole.waypoints)
    assert sliced.expanded == whole.expanded
    again = searching.search(*ends, options)
    assert again is not None
    np.testing.assert_array_equal(again.waypoints, whole.waypoints)


@pytest.mark.parametrize(("engine", "options"), ENGINES)
@pytest.mark.parametrize("radius", [0.0, 0.2, 0.35])
def test_routes_from_anywhere_pass_the_audit(
    engine: type[Theta], options: ThetaSettings, radius: float
) -> None:
    rng = np.random.default_rng(7)
    grid = grid_of(np.where(rng.random((60, 60)) < 0.03, BLOCKED, FREE), resolution=0.1524)
    passed = 0
    for start, goal in rng.uniform(0.6, 8.5, (30, 2, 2)).tolist():
        problem = PlanningProblem(grid, start=start, goal=goal, footprint=radius)
        found = engine(Costmap.of(problem)).search(tuple(start), tuple(goal), options)
        if found is not None:
            audit(problem, found.waypoints)
            passed += 1
    assert passed > 0


@pytest.mark.parametrize(("engine", "options"), ENGINES)
def test_a_time_limit_of_zero_is_over_at_once(engine: type[Theta], options: ThetaSettings) -> None:
    searching = engine(costmap_of(np.ones((5, 5), dtype=np.bool_)))
    with pytest.raises(TimeLimitError, match=f"{engine.name}: no route within time_limit = 0 s"):
        searching.search((0.5, 0.5), (4.5, 3.5), type(options)(time_limit=0))


@pytest.mark.parametrize(("engine", "options"), ENGINES)
def test_non_uniform_costs_are_refused(engine: type[Theta], options: ThetaSettings) -> None:
    costs = CostSettings(clearance_weight=1.0)
    grid = grid_of(free_field(8, 8))
    problem = PlanningProblem(grid, start=(4, 4), goal=(5, 5), footprint=1.0, costs=costs)
    with pytest.raises(ProblemError, match=rf"which '{engine.name}' needs.*Use 'astar'"):
        engine(Costmap.of(problem))
