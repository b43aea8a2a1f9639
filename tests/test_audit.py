"""The audit: passes what keeps its distance, refuses what doesn't."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from groundmap.grid import ConfidenceGrid
from oracles_planning import BLOCKED, FREE, UNSEEN, free_field, grid_of
from planners import AuditError, NoRouteError, PlanningProblem, Route, plan
from planners.audit import audit


def cluttered(seed: int) -> ConfidenceGrid:
    rng = np.random.default_rng(seed)
    return grid_of(np.where(rng.random((60, 60)) < 0.03, BLOCKED, FREE), resolution=0.2)


def random_route(seed: int) -> tuple[PlanningProblem, Route]:
    """Return a random problem that has a route with a bend, and the route."""
    grid, rng = cluttered(seed), np.random.default_rng(seed)
    while True:
        start, goal = rng.uniform(1, 11, (2, 2))
        problem = PlanningProblem(grid, start=start, goal=goal, footprint=rng.uniform(0.1, 0.5))
        try:
            route = plan(problem)
        except NoRouteError:
            continue
        if len(route.waypoints) > 2:
            return problem, route


@pytest.mark.parametrize("seed", range(8))
def test_a_route_passes_for_its_min_clearance_and_not_for_more(seed: int) -> None:
    problem, route = random_route(seed)
    assert route.min_clearance >= problem.radius - 1e-9
    audit(with_radius(problem, route.min_clearance), route.waypoints)
    with pytest.raises(AuditError, match=r"comes too near to a (nonfree|unknown) cell"):
        audit(with_radius(problem, route.min_clearance + 1e-6), route.waypoints)


def with_radius(problem: PlanningProblem, radius: float) -> PlanningProblem:
    return PlanningProblem(
        problem.grid,
        start=problem.start,
        goal=problem.goal,
        footprint=radius,
        clear_start_radius=problem.clear_radius,
    )


@pytest.mark.parametrize("seed", range(8))
def test_a_route_nudged_into_an_obstacle_is_refused(seed: int) -> None:
    problem, route = random_route(seed)
    window = problem.grid.window()
    obstacles = window.cell_to_world(np.argwhere(window.confidence > 0))
    waypoints = route.waypoints.copy()
    nearest = np.hypot(*(obstacles - waypoints[1]).T).argmin()
    waypoints[1] = obstacles[nearest] + problem.radius * 0.5
    with pytest.raises(AuditError, match="comes too near to a nonfree cell at"):
        audit(problem, waypoints)


def field_problem(*, footprint: float = 1.0) -> PlanningProblem:
    z = free_field(64, 64)
    z[30, 30], z[40, 40] = BLOCKED, UNSEEN
    return PlanningProblem(grid_of(z), start=(10.5, 10.5), goal=(50.5, 10.5), footprint=footprint)


@pytest.mark.parametrize(
    ("points", "fault"),
    [
        ([(10.5, 10.5), (30.5, 29.5), (50.5, 10.5)], "nonfree cell"),
        ([(10.5, 10.5), (50.5, 30.5), (40.5, 39.5), (50.5, 10.5)], "unknown cell"),
        ([(10.5, 10.5), (30.5, 0.5), (50.5, 10.5)], "unknown cell"),
        ([(10.5, 10.5), (30.5, -40.5), (50.5, 10.5)], "unknown cell"),
        ([(10.5, 10.5), (50.5, 10.6)], "misses the goal"),
        ([(10.6, 10.5), (50.5, 10.5)], "misses the start"),
        ([(10.5, 10.5), (np.nan, 3.0), (50.5, 10.5)], "is not finite"),
    ],
)
def test_every_fault_is_named(points: npt.ArrayLike, fault: str) -> None:
    with pytest.raises(AuditError, match=fault):
        audit(field_problem(), np.array(points))


def test_at_radius_zero_a_line_may_touch_a_square_and_not_enter_it() -> None:
    problem = field_problem(footprint=0.0)
    audit(problem, np.array([(10.5, 10.5), (30.0, 29.0), (30.0, 36.0), (50.5, 36.0), (50.5, 10.5)]))
    with pytest.raises(AuditError, match=r"comes too near to a nonfree cell at .*got 0 m"):
        audit(problem, np.array([(10.5, 10.5), (30.1, 29.0), (30.1, 32.0), (50.5, 10.5)]))


def test_unknown_cells_near_the_start_are_passed_and_others_are_not() -> None:
    z = free_field(64, 64)
    z[20:40, 20:24] = UNSEEN
    grid = grid_of(z)
    leaving = np.array([(23.0, 30.0), (40.0, 30.0)])
    problem = PlanningProblem(grid, start=leaving[0], goal=leaving[1], footprint=1.5)
    audit(problem, leaving)
    with pytest.raises(AuditError, match="unknown cell"):
        audit(problem, np.array([(23.0, 30.0), (23.0, 39.0), (40.0, 30.0)]))
    with pytest.raises(AuditError, match="unknown cell"):
        audit(
            PlanningProblem(
                grid, start=leaving[0], goal=leaving[1], footprint=1.5, clear_start=False
            ),
            leaving,
        )
