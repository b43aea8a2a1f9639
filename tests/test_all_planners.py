"""What holds for every planner, whatever it does inside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import (
    OWN_PLANNERS,
    CostSettings,
    EnclosedError,
    NoRouteError,
    PlanningProblem,
    ProblemError,
    Route,
    TimeLimitError,
    plan,
)
from planners.costmap.costmap import Costmap

EXACT = ["astar", "auto", "ara", "dijkstra", "dstar_lite", "jps", "jps+"]
ANY_ANGLE = ["theta", "lazy_theta", "polyanya"]
WEIGHING = ["astar", "auto", "ara", "dijkstra", "dstar_lite", "weighted_astar", "hybrid_astar"]
FLAT = sorted(set(OWN_PLANNERS) - {"hybrid_astar"})  # those that know no heading
RADII = [0.0, 0.5, 1.2]


@st.composite
def problems(draw: st.DrawFn) -> PlanningProblem:
    """Draw a map of boxes and speckles with a start and a goal where the footprint fits."""
    rng = np.random.default_rng(draw(st.integers(0, 2**20)))
    side = int(rng.integers(12, 30))
    blocked: Bools = rng.random((side, side)) < rng.choice([0.02, 0.1, 0.25])
    for _ in range(int(rng.integers(0, 5))):
        row, col = rng.integers(0, side, 2)
        blocked[row : row + rng.integers(1, 9), col : col + rng.integers(1, 9)] = True
    radius = draw(st.sampled_from(RADII))
    grid = grid_of(np.where(blocked, BLOCKED, FREE), resolution=1.0)
    centred = rng.random() < 0.5
    for _ in range(50):
        ends = rng.uniform(1, side - 1, (2, 2))
        ends = np.floor(ends) + 0.5 if centred else ends
        problem = posed(grid, ends[0], ends[1], radius)
        if fits(problem):
            return problem
    assume(False)
    raise AssertionError


def posed(grid: ConfidenceGrid, start: Any, goal: Any, radius: float) -> PlanningProblem:
    return PlanningProblem(grid, start=start, goal=goal, footprint=radius, clear_start=False)


def fits(problem: PlanningProblem) -> bool:
    try:
        plan(problem)
    except EnclosedError:
        return True
    except NoRouteError:
        return False
    return True


def route_or_none(problem: PlanningProblem, planner: str) -> Route | None:
    """Return an audited route, or None where the planner says that there is none."""
    try:
        return plan(problem, planner)
    except EnclosedError:
        return None


@given(problems())
@settings(max_examples=40)
def test_planners_agree_on_whether_there_is_a_route(problem: PlanningProblem) -> None:
    expected = route_or_none(problem, "astar") is None
    for planner in FLAT:
        assert (route_or_none(problem, planner) is None) == expected, planner


@given(problems())
@settings(max_examples=40)
def test_exact_planners_bring_routes_of_the_same_length(problem: PlanningProblem) -> None:
    routes = {name: route_or_none(problem, name) for name in EXACT}
    lengths = {name: route.cost for name, route in routes.items() if route is not None}
    assert lengths == pytest.approx(dict.fromkeys(lengths, lengths.get("astar")), abs=1e-6)


@given(problems())
@settings(max_examples=40)
def test_no_line_is_shorter_than_the_optimal_one_of_any_angle(problem: PlanningProblem) -> None:
    best = route_or_none(problem, "polyanya")
    assume(best is not None)
    assert best is not None
    for planner in [*EXACT, "theta", "lazy_theta", "weighted_astar"]:
        route = route_or_none(problem, planner)
        assert route is not None
        assert best.length <= route.length + 1e-9, planner


@given(problems())
@settings(max_examples=25)
def test_the_way_back_costs_the_same(problem: PlanningProblem) -> None:
    back = posed(problem.grid, problem.goal, problem.start, problem.radius)
    for planner in [*EXACT, "polyanya"]:
        there, again = route_or_none(problem, planner), route_or_none(back, planner)
        assert (there is None) == (again is None), planner
        if there is not None and again is not None:
            assert there.cost == pytest.approx(again.cost, abs=1e-9), planner


@given(problems(), st.integers(0, 2**16))
@settings(max_examples=25)
def test_one_more_obstacle_never_shortens_the_way(problem: PlanningProblem, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, cols = problem.grid.window().count.shape
    grid = problem.grid.merge(ConfidenceGrid(resolution=1.0))  # a copy
    cell = np.array([rng.integers(0, rows), rng.integers(0, cols)])
    for _ in range(3):
        grid.fuse(cell, np.full((1, 1), BLOCKED, dtype=np.float32))
    fuller = posed(grid, problem.start, problem.goal, problem.radius)
    assume(fits(fuller))
    for planner in [*EXACT, "polyanya"]:
        before, after = route_or_none(problem, planner), route_or_none(fuller, planner)
        if after is not None:
            assert before is not None, planner
            assert before.length <= after.length + 1e-9, planner


@pytest.mark.parametrize("planner", sorted(set(OWN_PLANNERS) - set(WEIGHING)))
def test_planners_that_cannot_weigh_cells_refuse_to(planner: str) -> None:
    problem = PlanningProblem(
        grid_of(free_field(32, 32)),
        start=(5, 5, 0),
        goal=(20, 20, 0),
        footprint=1.0,
        costs=CostSettings(clearance_weight=1.0),
    )
    with pytest.raises(ProblemError, match=r"uniform costs, .* Use 'astar'"):
        plan(problem, planner)


@pytest.mark.parametrize("planner", sorted(OWN_PLANNERS))
def test_a_start_that_is_the_goal_is_a_route_of_no_length(planner: str) -> None:
    problem = PlanningProblem(
        grid_of(free_field(32, 32)), start=(9.3, 8.1, 0.5), goal=(9.3, 8.1, 0.5), footprint=1.0
    )
    route = plan(problem, planner)
    assert route.length == 0.0
    assert route.waypoints.tolist() == [[9.3, 8.1]] * 2


@pytest.mark.parametrize("planner", sorted(OWN_PLANNERS))
def test_no_time_is_no_route(planner: str) -> None:
    problem = PlanningProblem(
        grid_of(free_field(32, 32)), start=(9.3, 8.1, 0.5), goal=(20.3, 18.1, 0.5), footprint=1.0
    )
    with pytest.raises(TimeLimitError, match=r"no route within time_limit = 0 s \(0 nodes"):
        plan(problem, planner, time_limit=0)


@pytest.mark.parametrize("planner", sorted(OWN_PLANNERS))
def test_a_planner_is_called_by_its_name(planner: str) -> None:
    if planner != "auto":
        problem = PlanningProblem(
            grid_of(free_field(9, 9)), start=(2, 2), goal=(5, 5), footprint=1.0
        )
        assert OWN_PLANNERS[planner].engine(Costmap.of(problem)).name == planner
