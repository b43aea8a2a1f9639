"""The audit: passes what keeps its distance, refuses what doesn't."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, FREE, UNSEEN, free_field, grid_of
from planners import AuditError, NoRouteError, PlanningProblem, Route, plan
from planners.audit.audit import audit
from strategies import rngs


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
    with pytest.raises(AuditError, match=r"comes too close to (a non-free|an unknown) cell"):
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
    with pytest.raises(AuditError, match="comes too close to a non-free cell at"):
        audit(problem, waypoints)


def field_problem(*, footprint: float = 1.0) -> PlanningProblem:
    z = free_field(64, 64)
    z[30, 30], z[40, 40] = BLOCKED, UNSEEN
    return PlanningProblem(grid_of(z), start=(10.5, 10.5), goal=(50.5, 10.5), footprint=footprint)


@pytest.mark.parametrize(
    ("points", "fault"),
    [
        ([(10.5, 10.5), (30.5, 29.5), (50.5, 10.5)], "a non-free cell"),
        ([(10.5, 10.5), (50.5, 30.5), (40.5, 39.5), (50.5, 10.5)], "an unknown cell"),
        ([(10.5, 10.5), (30.5, 0.5), (50.5, 10.5)], "an unknown cell"),
        ([(10.5, 10.5), (30.5, -40.5), (50.5, 10.5)], "an unknown cell"),
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
    with pytest.raises(AuditError, match=r"comes too close to a non-free cell at .*got 0 m"):
        audit(problem, np.array([(10.5, 10.5), (30.1, 29.0), (30.1, 32.0), (50.5, 10.5)]))


def test_unknown_cells_near_the_start_are_passed_and_others_are_not() -> None:
    z = free_field(64, 64)
    z[20:40, 20:24] = UNSEEN
    grid = grid_of(z)
    leaving = np.array([(23.0, 30.0), (40.0, 30.0)])
    problem = PlanningProblem(grid, start=leaving[0], goal=leaving[1], footprint=1.5)
    audit(problem, leaving)
    with pytest.raises(AuditError, match="an unknown cell"):
        audit(problem, np.array([(23.0, 30.0), (23.0, 39.0), (40.0, 30.0)]))
    with pytest.raises(AuditError, match="an unknown cell"):
        audit(
            PlanningProblem(
                grid, start=leaving[0], goal=leaving[1], footprint=1.5, clear_start=False
            ),
            leaving,
        )


CAR = [(-0.5, -0.6), (2.5, -0.6), (2.5, 0.6), (-0.5, 0.6)]
HOOK = [(-0.5, -0.5), (2.5, -0.5), (2.5, 0.5), (1.5, 0.5), (1.5, -0.2), (-0.5, -0.2)]


def car_problem(outline: list[tuple[float, float]], **ends: Any) -> PlanningProblem:
    z = free_field(64, 64)
    z[30, 30] = BLOCKED  # x and y from 30 to 31
    asked: dict[str, Any] = {"start": (20.0, 29.3, 0.0), "goal": (40.0, 29.3, 0.0)} | ends
    return PlanningProblem(grid_of(z), footprint=outline, **asked)


def drive(ys: float, *, turn: float = 0.0) -> tuple[Floats, Floats]:
    """Return poses along y = `ys`, turned by `turn` in the middle."""
    x = np.linspace(20.0, 40.0, 201)
    middle = np.exp(-(((x - 29.0) / 3.0) ** 2))
    middle[[0, -1]] = 0.0
    return np.column_stack([x, np.full_like(x, ys)]), turn * middle


def test_an_outline_may_pass_where_its_disc_may_not() -> None:
    problem = car_problem(CAR)
    waypoints, headings = drive(29.3)
    audit(problem, waypoints, headings=headings)
    with pytest.raises(AuditError, match="comes too close to a non-free cell"):
        audit(problem, waypoints)


def test_an_outline_may_touch_a_square_and_not_enter_it() -> None:
    ends = {"start": (20.0, 29.4, 0.0), "goal": (40.0, 29.4, 0.0)}
    waypoints, headings = drive(29.4)
    audit(car_problem(CAR, **ends), waypoints, headings=headings)
    low = {"start": (20.0, 29.4 + 1e-6, 0.0), "goal": (40.0, 29.4 + 1e-6, 0.0)}
    with pytest.raises(AuditError, match=r"sweeps a non-free cell at \(3\d\.\d\d, 30\.00\)"):
        audit(car_problem(CAR, **low), waypoints + np.array([0, 1e-6]), headings=headings)


def test_an_outline_that_turns_into_an_obstacle_is_refused() -> None:
    waypoints, headings = drive(29.3, turn=0.3)
    with pytest.raises(AuditError, match="sweeps a non-free cell"):
        audit(car_problem(CAR), waypoints, headings=headings)


def placed(outline: list[tuple[float, float]], pose: Floats) -> shapely.Polygon:
    x, y, yaw = pose.tolist()
    cos, sin = np.cos(yaw), np.sin(yaw)
    return shapely.Polygon(np.array(outline) @ [[cos, sin], [-sin, cos]] + [x, y])


@given(rngs(), st.sampled_from([CAR, HOOK]), st.floats(-2.5, 2.5))
@settings(max_examples=60)
def test_an_outline_that_sweeps_an_obstacle_between_two_poses_is_refused(
    rng: np.random.Generator, outline: list[tuple[float, float]], turn: float
) -> None:
    first = np.array([28.0, 30.0, rng.uniform(-1.5, 1.5)])
    last = first + np.array([*rng.uniform(-1, 1, 2), turn])
    between = [placed(outline, first + t * (last - first)) for t in np.linspace(0, 1, 100)]
    assume(shapely.area(shapely.intersection(between, shapely.box(30, 30, 31, 31))).max() > 1e-6)
    poses = np.array([first, last])
    with pytest.raises(AuditError, match="sweeps a non-free cell"):
        audit(car_problem(outline, start=first, goal=last), poses[:, :2], headings=poses[:, 2])


@pytest.mark.parametrize("y", [29.7, 30.0, 30.2, 30.4])
@pytest.mark.parametrize("yaw", [-0.1, 0.0, 0.3])
def test_a_turn_of_a_rounding_error_hides_nothing(y: float, yaw: float) -> None:
    for dx, dy in (0.5, 0.3), (0.2, 0.5):
        poses = np.array([[28.0, y, yaw], [28.0 + dx, y + dy, yaw + 6e-8]])
        problem = car_problem(CAR, start=poses[0], goal=poses[1])
        with pytest.raises(AuditError, match="sweeps a non-free cell"):
            audit(problem, poses[:, :2], headings=poses[:, 2])


@pytest.mark.parametrize(("y", "clear"), [(30.15, True), (30.25, False)])
def test_the_hollow_of_an_outline_is_not_part_of_it(y: float, clear: bool) -> None:
    problem = car_problem(HOOK, start=(30.25, 20.0, 0.0), goal=(30.25, y, 0.0))
    up = np.column_stack([np.full(50, 30.25), np.linspace(20.0, y, 50)])
    if clear:
        audit(problem, up, headings=np.zeros(50))
    else:
        with pytest.raises(AuditError, match="sweeps a non-free cell"):
            audit(problem, up, headings=np.zeros(50))


def test_a_route_that_misses_a_yaw_is_refused() -> None:
    waypoints, headings = drive(25.0)
    ends = {"start": (20.0, 25.0, 0.0), "goal": (40.0, 25.0, 0.1)}
    with pytest.raises(AuditError, match=r"misses the yaw of the goal .* got 0\.1"):
        audit(car_problem(CAR, **ends), waypoints, headings=headings)
    whole_turn = {"start": (20.0, 25.0, 2 * np.pi), "goal": (40.0, 25.0, -2 * np.pi)}
    audit(car_problem(CAR, **whole_turn), waypoints, headings=headings)
