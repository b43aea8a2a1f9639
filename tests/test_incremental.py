"""Planning on a live map: the routes that planning from scratch would return, for less work."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap import ConfidenceGrid
from groundmap.arrays import Floats32
from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, UNSEEN, drawing, free_field, grid_of
from planners import (
    AuditError,
    CostSettings,
    EnclosedError,
    NoRouteError,
    OutsideMapError,
    PlanningProblem,
    ProblemError,
    Route,
    TimeLimitError,
    UnknownSpaceError,
    plan,
)
from planners.incremental import IncrementalPlanner
from planners.problem.problem import Unknown

SIDE = 16


def problem_on(z: Floats32, radius: float = 0.6) -> PlanningProblem:
    return PlanningProblem(grid_of(z), start=(2.2, 2.4), goal=(13.4, 13.7), footprint=radius)


def put(grid: ConfidenceGrid, row: int, col: int, confidence: float) -> tuple[int, int]:
    """Let a cell of the grid be of a confidence, seen once, and return the cell."""
    (i, inner_row), (j, inner_col) = divmod(row, 64), divmod(col, 64)
    tile = grid.tile((i, j))
    tile.confidence[inner_row, inner_col] = confidence
    tile.count[inner_row, inner_col] = confidence != UNSEEN
    return row, col


def outcome(ask: Callable[[], Route]) -> tuple[str, float]:
    """Return the name of the exception, and the cost of the route."""
    try:
        return "", ask().cost
    except NoRouteError as error:
        return type(error).__name__, 0.0


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([CostSettings(), CostSettings(clearance_weight=2.0, inflation_radius=2.0)]),
    st.tuples(
        st.booleans(),
        st.sampled_from([0.2, 0.6]),
        st.sampled_from(["avoid", "avoid", "allow", "penalise"]),
    ),
    st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_each_plan_is_as_good_as_one_from_scratch(
    seed: int, costs: CostSettings, policy: tuple[bool, float, Unknown], on_corners: bool
) -> None:
    clear_start, radius, unknown = policy
    rng = np.random.default_rng(seed)
    z = rng.choice([FREE, BLOCKED, UNSEEN], (SIDE, SIDE), p=[0.9, 0.06, 0.04])
    z[12:15, 12:15] = FREE
    problem = problem_on(z.astype(np.float32), radius)
    asked = replace(problem, costs=costs, clear_start=clear_start, unknown=unknown)
    planner = IncrementalPlanner(asked)
    for _ in range(6):
        place = rng.uniform(0.2, SIDE, 2)
        start = tuple((np.round(place) if on_corners else place).tolist())
        got = outcome(partial(planner.plan, start=start))
        expected = outcome(partial(plan, planner.problem, "astar"))
        assert got[0] == expected[0]
        assert got[1] == pytest.approx(expected[1], rel=1e-12)
        for _ in range(int(rng.integers(0, 3))):
            planner.update(changed(problem.grid, rng))


def changed(grid: ConfidenceGrid, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Change cells of the map, now and then beyond its tile, but for those around the goal."""
    reach = int(rng.choice([SIDE, SIDE, 90]))
    cells = rng.integers(SIDE - reach, reach, (12, 2))
    cells = cells[np.abs(cells - 13).max(axis=1) > 1]
    values = rng.choice([FREE, BLOCKED, UNSEEN], len(cells), p=[0.75, 0.2, 0.05])
    return [
        put(grid, row, col, value)
        for (row, col), value in zip(cells.tolist(), values.tolist(), strict=True)
    ]


def test_little_is_expanded_once_a_cell_before_the_robot_is_blocked() -> None:
    z = free_field(64, 64)
    z[20:40, 20] = z[40, 20:50] = BLOCKED
    problem = replace(problem_on(z), goal=(60.5, 55.5))
    planner = IncrementalPlanner(problem)
    planner.plan()
    planner.update([put(problem.grid, 14, 14, BLOCKED)])
    replanned = planner.plan(start=(10.5, 11.5))
    assert replanned.cost == pytest.approx(plan(planner.problem, "astar").cost)
    assert replanned.expanded < plan(planner.problem, "astar").expanded / 4
    assert replanned.planner == "dstar_lite"


def test_nothing_is_expanded_while_nothing_changes() -> None:
    planner = IncrementalPlanner(problem_on(free_field(SIDE, SIDE)))
    route = planner.plan()
    again = planner.plan(start=route.waypoints[0])
    assert again.expanded == 0
    np.testing.assert_array_equal(again.waypoints, route.waypoints)


def test_a_robot_that_is_fenced_in_gets_out_once_the_fence_opens() -> None:
    z = drawing("""
        ................
        ................
        ................
        ................
        ................
        ................
        ................
        ................
        ................
        ######..........
        .....#..........
        .....#..........
        .....#..........
        .....#..........
        .....#..........
        .....#..........
    """)
    planner = IncrementalPlanner(problem_on(z))
    with pytest.raises(EnclosedError, match="the start is enclosed"):
        planner.plan()
    for row in (2, 3, 4):
        planner.update([put(planner.problem.grid, row, 5, FREE)])
    assert planner.plan().min_clearance >= 0.6


def test_a_goal_beyond_the_map_is_reached_once_the_map_has_grown_to_it() -> None:
    planner = IncrementalPlanner(problem_on(free_field(64, 64)))
    planner.plan()
    with pytest.raises(OutsideMapError, match=r"goal \(80.00, 13.00\) is outside the map"):
        planner.plan(goal=(80, 13))
    grown = [put(planner.problem.grid, row, col, FREE) for row in range(64) for col in (64, 127)]
    for col in range(65, 127):
        grown += [put(planner.problem.grid, row, col, FREE) for row in range(64)]
    planner.update(grown)
    assert planner.plan(start=(3, 3)).waypoints[-1].tolist() == [80, 13]


def test_an_update_before_the_first_plan_is_none() -> None:
    planner = IncrementalPlanner(problem_on(free_field(SIDE, SIDE)))
    planner.update([put(planner.problem.grid, 8, 8, BLOCKED)])
    assert planner.plan().cost == pytest.approx(plan(planner.problem, "astar").cost)


def test_the_audit_catches_changes_that_were_not_said() -> None:
    planner = IncrementalPlanner(problem_on(free_field(SIDE, SIDE)))
    x, y = planner.plan().waypoints[1:3].mean(axis=0)
    put(planner.problem.grid, int(y), int(x), BLOCKED)
    with pytest.raises(AuditError, match="comes too close to a non-free cell"):
        planner.plan()


def test_a_place_that_is_none_is_refused_and_changes_nothing() -> None:
    planner = IncrementalPlanner(problem_on(free_field(SIDE, SIDE)))
    route = planner.plan()
    with pytest.raises(ProblemError, match=r"start: expected x, y \[m\]"):
        planner.plan(start=(0.0, float("nan")))
    assert planner.plan().cost == route.cost


def test_settings_are_those_of_the_search() -> None:
    problem = problem_on(free_field(SIDE, SIDE))
    with pytest.raises(SettingsError, match=r"time_limt.*Did you mean 'time_limit'"):
        IncrementalPlanner(problem, time_limt=3)
    with pytest.raises(TimeLimitError, match="dstar_lite: no route within time_limit = 0 s"):
        IncrementalPlanner(problem, time_limit=0).plan()


def test_a_3d_map_is_refused() -> None:
    grid = ConfidenceGrid(resolution=1.0, origin=(0.0, 0.0, 0.0))
    problem = PlanningProblem(grid, start=(0, 0, 0), goal=(1, 1, 1), footprint=0.5)
    with pytest.raises(ProblemError, match="grid: expected a 2-D map, got a 3-D map"):
        IncrementalPlanner(problem)


def test_cells_cleared_around_the_start_are_unknown_again_after_the_robot_has_moved() -> None:
    z = free_field(SIDE, SIDE)
    z[:, 7:9] = UNSEEN
    planner = IncrementalPlanner(problem_on(z))
    for start, joined in (((3, 3), False), ((8, 8), True), ((3, 3), False), ((8, 12), True)):
        if joined:
            assert planner.plan(start=start).start_unknown_area > 0
        else:
            with pytest.raises(EnclosedError, match="is enclosed"):
                planner.plan(start=start)


def test_a_start_on_ground_added_after_the_cleared_cells_is_checked() -> None:
    grid = ConfidenceGrid(resolution=0.1)
    grid.fuse(np.array([0, 0]), free_field(64, 64))
    here = {"start": (5.9, 3.0), "goal": (3.0, 3.0), "footprint": 0.2}
    planner = IncrementalPlanner(
        PlanningProblem(grid, **here, cleared_at=(5.9, 3.0), clear_start_radius=2.0)  # type: ignore[arg-type]
    )
    planner.plan()
    grid.fuse(np.array([30, 66]), free_field(1, 3))  # a tile that the window doesn't hold
    planner.update([[30, 66], [30, 67], [30, 68]])
    with pytest.raises(UnknownSpaceError, match=r"start \(10.00, 3.00\)"):
        planner.plan(start=(10.0, 3.0))


def test_cells_that_touched_the_clear_radius_are_unknown_again_after_the_robot_has_moved() -> None:
    z = free_field(SIDE, SIDE)
    z[5] = UNSEEN  # a band across, which the first start stands beside
    problem = PlanningProblem(grid_of(z), start=(8, 6), goal=(8.5, 2.5), footprint=0.0)
    planner = IncrementalPlanner(problem)
    assert planner.plan().unknown_length > 0.0
    with pytest.raises(EnclosedError, match="enclosed"):
        planner.plan(start=(8.5, 10.5))


def test_a_map_that_grew_within_the_margin_is_planned_on_as_a_whole() -> None:
    grid = ConfidenceGrid(resolution=0.1)
    grid.fuse(np.array([0, 0]), free_field(64, 64))
    here = {"start": (5.9, 3.0), "goal": (3.0, 1.0), "footprint": 0.2}
    planner = IncrementalPlanner(
        PlanningProblem(grid, **here, unknown="allow", clear_start_radius=2.0)  # type: ignore[arg-type]
    )
    planner.plan()
    wall = [put(grid, 20, col, BLOCKED) for col in range(80)]  # around it there is only the margin
    planner.update(wall)
    assert planner.plan().cost == pytest.approx(plan(planner.problem).cost)
