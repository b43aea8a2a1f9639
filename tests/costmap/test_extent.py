"""The box that is planned on: a tile far away doesn't stop a plan."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import free_field, grid_of
from planners import IncrementalPlanner, PlanningProblem, ProblemError, plan, plan_many
from planners.costmap.costmap import Costmap
from planners.costmap.extent import MOST_CELLS, padded_bounds

FAR = 20_000  # [cells] away along both axes: the box around all tiles has 4e8


def with_far_tile(*, ndim: int = 2, far: int = FAR) -> ConfidenceGrid:
    grid = ConfidenceGrid(resolution=0.1, origin=(0.0,) * ndim)
    side = 100 if ndim == 2 else 30
    grid.fuse(np.zeros(ndim, dtype=np.int64), np.full((side,) * ndim, -1.0, dtype=np.float32))
    grid.fuse(np.full(ndim, far), np.full((2,) * ndim, -1.0, dtype=np.float32))
    return grid


def problem(grid: ConfidenceGrid, **values: Any) -> PlanningProblem:
    asked: dict[str, Any] = {"start": (1.0, 1.0), "goal": (8.0, 6.5), "footprint": 0.3}
    return PlanningProblem(grid, **(asked | values))


@pytest.mark.parametrize("planner", ["astar", "jps", "hybrid_astar", "rrtconnect"])
def test_a_far_tile_changes_no_route(planner: str) -> None:
    yaws: dict[str, Any] = {"start": (1.0, 1.0, 0.0), "goal": (8.0, 6.5, 0.0)}
    settings: dict[str, Any] = {"iterations": 300} if planner == "rrtconnect" else {}
    near, far = (
        plan(problem(grid, **yaws), planner, **settings)
        for grid in (grid_of(free_field(100, 100), resolution=0.1), with_far_tile())
    )
    np.testing.assert_array_equal(far.waypoints, near.waypoints)
    assert (far.cost, far.min_clearance) == (near.cost, near.min_clearance)


def test_a_far_tile_changes_no_route_in_space() -> None:
    ends: dict[str, Any] = {"start": (0.7, 0.7, 0.7), "goal": (2.0, 2.2, 1.5)}
    route = plan(problem(with_far_tile(ndim=3, far=2_000), **ends))
    assert route.length < 2.3


def test_replanning_ignores_a_far_tile_that_comes_later() -> None:
    grid = grid_of(free_field(100, 100), resolution=0.1)
    planner = IncrementalPlanner(problem(grid))
    before = planner.plan().cost
    grid.fuse(np.array([FAR, FAR]), free_field(2, 2))
    planner.update([[FAR, FAR]])
    assert planner.plan().cost == before


def test_the_far_tile_is_named_if_unknown_cells_are_traversable() -> None:
    sentence = (
        r"33554432 cells .*: 1 of 5 tiles, around \(2000, 2000\), lies 28\d\d m from the largest "
        r"part; its poses may be wrong"
    )
    with pytest.raises(ProblemError, match=sentence):
        plan(problem(with_far_tile(), unknown="allow"))


def test_a_goal_on_the_far_tile_is_refused_by_its_name() -> None:
    goal = ((FAR + 1) * 0.1, (FAR + 1) * 0.1)
    with pytest.raises(ProblemError, match=r"1 of 5 tiles, around \(2000, 2000\)"):
        plan(problem(with_far_tile(), goal=goal, footprint=0.05))


def test_of_many_queries_one_beyond_the_part_planned_on_is_refused() -> None:
    far = (FAR + 1) * 0.1
    pairs = [((1.0, 1.0), (8.0, 6.5)), ((1.0, 1.0), (far, far))]
    with pytest.raises(ProblemError, match="goal: expected a place on the part of the map"):
        plan_many(problem(with_far_tile()), pairs, threads=1)


def test_parts_that_the_cleared_start_joins_are_planned_on_together() -> None:
    grid = ConfidenceGrid(resolution=0.1)
    grid.fuse(np.array([0, 0]), free_field(64, 64))
    grid.fuse(np.array([0, 128]), free_field(64, 64))
    grid.fuse(np.array([FAR, FAR]), free_field(2, 2))
    beside = problem(grid, start=(9.6, 3.2), goal=(15.0, 3.2), clear_start_radius=3.5)
    lower_x, _, upper_x, _ = padded_bounds(beside).tolist()
    assert lower_x < 0.0
    assert upper_x > 19.2


def test_maps_of_several_parts_that_fit_are_planned_on_as_a_whole() -> None:
    grid = ConfidenceGrid(resolution=0.1)
    grid.fuse(np.array([0, 0]), free_field(64, 64))
    grid.fuse(np.array([640, 640]), free_field(64, 64))
    costmap = Costmap.of(problem(grid, goal=(5.0, 5.0)))
    assert costmap.blocked.shape == (708, 708)
    assert costmap.blocked.size < MOST_CELLS[2]
