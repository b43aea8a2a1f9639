"""Smoothed routes: bounded curvature and exact clearance, or a place where that can't be."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import NonlinearConstraint, minimize

from groundmap.arrays import Bools, Floats, Floats32
from groundmap.errors import InputError
from oracles_planning import BLOCKED, FREE, free_field, grid_of, masks, union_of_squares
from planners import CostSettings, NoRouteError, PlanningProblem, ProblemError, TimeLimitError, plan
from planners.audit.audit import audit
from planners.errors import SmoothingError
from planners.route.kernels.smooth import STIFF, TENSION, free_discs, nearest, relax
from planners.route.shortcut import shortcut
from planners.route.smooth import max_curvature, smooth

rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def boxes(rng: np.random.Generator, *, side: int = 64, number: int = 25) -> Floats32:
    """Return evidence for boxes scattered over a field."""
    z = free_field(side, side)
    for _ in range(number):
        row, col = rng.integers(0, side, 2)
        rows, cols = rng.integers(1, 9, 2)
        z[row : row + rows, col : col + cols] = BLOCKED
    return z


def corridor(*, width: int, turn: int) -> Floats32:
    """Return evidence for a corridor that turns left at a right angle, from (1, 1) on, then up."""
    z = np.full((64, 64), BLOCKED, dtype=np.float32)
    z[1 : 1 + width, 1 : 1 + turn] = FREE
    z[1:62, 1 + turn - width : 1 + turn] = FREE
    return z


def along(line: Floats) -> Floats:
    """Return the direction of each piece of a line [rad]."""
    dx, dy = np.diff(line, axis=0).T
    directions: Floats = np.arctan2(dy, dx)
    return directions


@given(rngs, st.sampled_from([0.0, 0.2, 0.45]), st.sampled_from([0.3, 1.0, 2.0]))
@settings(max_examples=40)
def test_it_keeps_curvature_and_clearance_or_names_the_place_of_failure(
    rng: np.random.Generator, radius: float, turning_radius: float
) -> None:
    grid = grid_of(boxes(rng), resolution=0.2)
    start, goal = rng.uniform(0.3, 12.5, (2, 2))
    problem = PlanningProblem(grid, start=start, goal=goal, footprint=radius, clear_start=False)
    refused: list[SmoothingError] = []
    try:
        rounded = smooth(problem, plan(problem), turning_radius=turning_radius)
    except SmoothingError as error:
        refused.append(error)
    except NoRouteError:
        return
    for refusal in refused:
        assert refusal.turning_radius == turning_radius
        assert 0 <= refusal.possible <= turning_radius
        assert shapely.Point(refusal.xy).distance(shapely.box(*grid.bounds())) == 0
        return
    audit(problem, rounded.waypoints, headings=rounded.headings)
    assert max_curvature(rounded.waypoints) * turning_radius <= 1 + 1e-9
    assert rounded.min_clearance >= radius - 1e-9
    np.testing.assert_array_equal(rounded.waypoints[[0, -1]], [start, goal])
    assert rounded.length >= math.dist(start, goal) - 1e-9
    assert rounded.cost == rounded.length
    if len(rounded.waypoints) > 2:
        turned = np.angle(np.exp(1j * (rounded.headings[:-1] - along(rounded.waypoints))))
        assert np.abs(turned).max() <= 0.1 / turning_radius


def test_a_corner_is_rounded_at_little_cost() -> None:
    z = free_field(64, 64)
    z[:40, 30] = BLOCKED
    problem = PlanningProblem(
        grid_of(z, resolution=0.1), start=(0.6, 0.4), goal=(5.6, 1.4), footprint=0.4
    )
    route = plan(problem)
    tight = shortcut(problem, route)
    for turning_radius in (0.3, 0.8, 1.2):
        rounded = smooth(problem, route, turning_radius=turning_radius)
        assert tight.length - 0.02 <= rounded.length <= 1.06 * tight.length
        assert max_curvature(rounded.waypoints) * turning_radius <= 1 + 1e-9
        assert max_curvature(tight.waypoints) > 1 / turning_radius or turning_radius == 0.3


def test_a_straight_route_stays_as_it_is() -> None:
    problem = PlanningProblem(
        grid_of(free_field(64, 64)), start=(5.2, 5.1), goal=(50, 20), footprint=1.0
    )
    rounded = smooth(problem, plan(problem), turning_radius=100.0)
    assert rounded.waypoints.tolist() == [[5.2, 5.1], [50.0, 20.0]]
    assert max_curvature(rounded.waypoints) == 0.0
    still = replace(problem, goal=(5.2, 5.1))
    assert smooth(still, plan(still), turning_radius=1.0).length == 0.0


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
@settings(max_examples=20)
def test_requested_yaws_are_kept(start_yaw: float, goal_yaw: float) -> None:
    start, goal = (20.0, 32.0, start_yaw), (44.0, 32.0, goal_yaw)
    problem = PlanningProblem(grid_of(free_field(64, 64)), start=start, goal=goal, footprint=1.0)
    try:
        rounded = smooth(problem, plan(problem), turning_radius=3.0)
    except SmoothingError:
        # Only where it would have to turn around.
        assert max(abs(start_yaw), abs(goal_yaw)) > 2.0
        return
    audit(problem, rounded.waypoints, headings=rounded.headings)
    assert rounded.headings[[0, -1]] == pytest.approx([start_yaw, goal_yaw], abs=1e-9)
    directions = along(rounded.waypoints)[[0, -1]] - [start_yaw, goal_yaw]
    assert np.abs(np.angle(np.exp(1j * directions))).max() < 1e-6


def cornered(**changes: Any) -> PlanningProblem:
    """Return the problem to get around a corner with 0.5 m to spare on either side."""
    grid = grid_of(corridor(width=5, turn=40))
    problem = PlanningProblem(grid, start=(3.5, 3.5), goal=(38.5, 58.5), footprint=2.0)
    return replace(problem, **changes)


def test_a_corridor_as_wide_as_the_footprint_is_kept_to() -> None:
    problem = cornered(footprint=2.5, goal=(20.5, 3.5))
    rounded = smooth(problem, plan(problem), turning_radius=5.0)
    assert rounded.waypoints.tolist() == [[3.5, 3.5], [20.5, 3.5]]
    yawed = cornered(footprint=2.5, start=(3.5, 3.5, 0.0), goal=(20.5, 3.5, 0.0))
    assert smooth(yawed, plan(yawed), turning_radius=5.0).length == pytest.approx(17.0)


def test_a_corner_is_taken_with_nearly_the_radius_that_there_is_room_for() -> None:
    # The arc touches the outer walls, 2 m off, and passes the inner corner, 2 m off, which is
    # sqrt(2) (1 m + 2 m) from where the outer lines of the centre meet.
    limit = (3.0 * math.sqrt(2.0) - 2.0) / (math.sqrt(2.0) - 1.0)
    problem = cornered()
    route = plan(problem)
    for share in (0.3, 0.6, 0.9):
        rounded = smooth(problem, route, turning_radius=share * limit)
        assert max_curvature(rounded.waypoints) * share * limit <= 1 + 1e-9
    with pytest.raises(
        SmoothingError, match=r"with a turning radius of 5\.52 m: the clear"
    ) as caught:
        smooth(problem, route, turning_radius=1.02 * limit)
    error = caught.value
    assert math.dist(error.xy, (38.5, 3.5)) < 5.0
    assert 0.8 * limit <= error.possible <= limit


def test_a_corner_without_any_room_is_refused() -> None:
    problem = cornered(footprint=2.5)
    with pytest.raises(SmoothingError, match="clearance allows none of the radii tried") as caught:
        smooth(problem, plan(problem), turning_radius=10.0)
    assert caught.value.possible == 0.0
    assert math.dist(caught.value.xy, (38.5, 3.5)) < 5.0


def test_waypoints_have_about_the_requested_spacing() -> None:
    z = free_field(64, 64)
    z[:40, 30] = BLOCKED
    problem = PlanningProblem(grid_of(z), start=(6, 4), goal=(56, 14), footprint=4.0)
    route = plan(problem)
    for spacing, expected in ((None, 0.5), (0.25, 0.25), (3.0, 3.0)):
        rounded = smooth(problem, route, turning_radius=8.0, spacing=spacing)
        steps = np.hypot(*np.diff(rounded.waypoints, axis=0).T)
        assert expected * 0.85 <= steps.min() <= steps.max() <= expected * 1.15


def test_a_more_expensive_route_has_a_wider_bound() -> None:
    z = free_field(64, 64)
    z[:40, 30] = BLOCKED
    problem = PlanningProblem(
        grid_of(z),
        start=(6, 4),
        goal=(56, 14),
        footprint=2.0,
        costs=CostSettings(clearance_weight=20.0, inflation_radius=12.0, cost_scaling_factor=0.2),
    )
    route = plan(problem)
    rounded = smooth(problem, route, turning_radius=8.0)
    assert rounded.bound is not None
    assert rounded.cost > route.cost
    assert rounded.bound == pytest.approx(rounded.cost / route.cost)
    none = smooth(problem, replace(route, bound=None), turning_radius=8.0)
    assert none.bound is None


@pytest.mark.parametrize("turning_radius", [2.0, 6.0, 20.0])
def test_where_unknown_is_allowed_it_stays_on_the_map(turning_radius: float) -> None:
    z = free_field(64, 64)
    z[:63, 30] = BLOCKED
    problem = PlanningProblem(
        grid_of(z), start=(20.5, 50.5), goal=(40.5, 50.5), footprint=0.4, unknown="allow"
    )
    try:
        rounded = smooth(problem, plan(problem), turning_radius=turning_radius)
    except SmoothingError:
        rounded = None
    assert (rounded is None) == (turning_radius == 20.0)
    if rounded is not None:
        assert rounded.waypoints.max() <= 66.0


# Curvature


@given(st.floats(0.1, 10), st.integers(8, 200), st.floats(0.2, 6))
def test_points_on_an_arc_have_its_curvature(radius: float, number: int, angle: float) -> None:
    turns = np.linspace(0.0, angle, number)
    arc = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    half = angle / (number - 1) / 2
    assert max_curvature(arc) == pytest.approx(1 / (radius * math.cos(half)))
    assert max_curvature(np.repeat(arc, 2, axis=0)) == pytest.approx(max_curvature(arc))


def test_sharp_corners_and_turning_back_are_seen() -> None:
    corner = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 1.0]])
    assert max_curvature(corner) == pytest.approx(2.0)
    assert max_curvature(np.array([[0.0, 0.0], [4.0, 0.0], [1.0, 0.0]])) > 1e12
    assert max_curvature(corner[:2]) == 0.0
    assert max_curvature(corner[[0, 0]]) == 0.0


# The kernels


@given(masks(side=12), rngs, st.sampled_from([0.5, 3.0, math.inf]))
@settings(max_examples=60)
def test_the_nearest_place_is_shapelys(
    blocked: Bools, rng: np.random.Generator, limit: float
) -> None:
    x, y = rng.uniform(-1, np.array(blocked.shape[::-1]) + 1)
    squares = union_of_squares(blocked)
    distance, *place = nearest(blocked, x, y, limit)
    expected = shapely.distance(shapely.Point(x, y), squares)
    assert distance == pytest.approx(min(expected, limit))
    if expected < limit:
        assert shapely.distance(shapely.Point(place), squares) == pytest.approx(0.0, abs=1e-12)
        assert math.dist((x, y), place) == pytest.approx(expected)


@given(masks(side=12), rngs, st.floats(0.0, 2.0), st.floats(0.5, 5.0))
@settings(max_examples=60)
def test_discs_are_free_and_hold_their_points(
    blocked: Bools, rng: np.random.Generator, need: float, most: float
) -> None:
    points = rng.uniform(0, blocked.shape[::-1], (20, 2))
    squares = union_of_squares(blocked)
    away = shapely.distance(shapely.points(points), squares)
    discs = free_discs(blocked, points, need, most)
    centres = shapely.points(discs[:, :2])
    spare = shapely.distance(centres, squares) - need
    assert (discs[:, 2] <= np.maximum(spare, 0.0) + 1e-9).all()
    moved = np.hypot(*(discs[:, :2] - points).T)
    assert (moved <= most).all()
    fits = away >= need
    assert (moved[fits] <= discs[fits, 2] + 1e-9).all()
    assert (discs[fits, 2] >= np.minimum(away[fits] - need, 2 * most) - 1e-9).all()


def test_a_disc_beside_a_wall_grows_away_from_it() -> None:
    blocked: Bools = np.zeros((30, 30), dtype=np.bool_)
    blocked[:, 0] = True
    x, y, radius = free_discs(blocked, np.array([[3.0, 15.5]]), 2.0, 8.0)[0]
    assert (x, y, radius) == (pytest.approx(11.0, abs=0.1), 15.5, pytest.approx(8.0, abs=0.1))


@given(rngs, st.integers(1, 2), st.integers(1, 2))
@settings(max_examples=30)
def test_relaxation_agrees_with_numpy(rng: np.random.Generator, low: int, behind: int) -> None:
    points = np.cumsum(rng.normal(size=(15, 2)), axis=0)
    discs = np.column_stack([points + rng.normal(size=(15, 2)) / 4, rng.uniform(0, 1, 15)])
    got = relax(points, discs, 0.3, low, 15 - behind, 20)
    np.testing.assert_allclose(
        got, relaxed(points, discs, 0.3, range(low, 15 - behind), rounds=20), atol=1e-9
    )


def relaxed(points: Floats, discs: Floats, bend: float, moving: range, *, rounds: int) -> Floats:
    """Return what `relax` does, with dense matrices."""
    n = len(points)
    step, second = np.diff(np.eye(n), axis=0), np.diff(np.eye(n), n=2, axis=0)
    system = np.eye(n) + TENSION * step.T @ step + STIFF * second.T @ second
    move = np.array(moving)
    held = np.setdiff1d(np.arange(n), move)
    x, bends, places = points.copy(), second @ points, points.copy()
    bends_off, places_off = np.zeros_like(bends), np.zeros_like(places)
    for _ in range(rounds):
        right = places - places_off + STIFF * second.T @ (bends - bends_off)
        x[move] = np.linalg.solve(
            system[np.ix_(move, move)], right[move] - system[np.ix_(move, held)] @ x[held]
        )
        wish = 1.6 * x - 0.6 * places + places_off
        places = cut(wish, discs[:, :2], discs[:, 2])
        places_off = wish - places
        wish = 1.6 * second @ x - 0.6 * bends + bends_off
        bends = cut(wish, np.zeros(2), np.full(n - 2, bend))
        bends_off = wish - bends
    return x


def cut(values: Floats, centres: Floats, radii: Floats) -> Floats:
    off = values - centres
    away = np.hypot(*off.T)
    result: Floats = (
        centres + off * np.where(away > radii, radii / np.maximum(away, radii), 1)[:, None]
    )
    return result


def test_relaxing_ends_at_the_optimum() -> None:
    points = np.array([[0.0, 0.0], [1, 0], [2, 0], [3, 0], [3, 1], [3, 2], [3, 3]])
    discs = np.column_stack([points, np.full(7, 0.6)])

    def bends(x: Floats) -> Floats:
        line = np.concatenate([points[:1], x.reshape(-1, 2), points[-1:]])
        squared: Floats = (np.diff(line, n=2, axis=0) ** 2).sum(axis=1)
        return squared

    def off(x: Floats) -> Floats:
        squared: Floats = ((x.reshape(-1, 2) - discs[1:-1, :2]) ** 2).sum(axis=1)
        return squared

    def length(x: Floats) -> float:
        line = np.concatenate([points[:1], x.reshape(-1, 2), points[-1:]])
        return float((np.diff(line, axis=0) ** 2).sum())

    expected = minimize(
        length,
        points[1:-1].ravel(),
        method="SLSQP",
        constraints=[NonlinearConstraint(bends, 0, 0.4**2), NonlinearConstraint(off, 0, 0.6**2)],
    )
    got = relax(points, discs, 0.4, 1, 6, 100_000)[1:-1].ravel()
    assert expected.success
    assert np.sqrt(bends(got)).max() <= 0.4 + 1e-3
    assert np.sqrt(off(got)).max() <= 0.6 + 1e-3
    assert length(got) == pytest.approx(expected.fun, rel=1e-2)


# What is refused


@pytest.mark.parametrize("turning_radius", [0.0, -1.0, math.nan, math.inf])
def test_a_turning_radius_that_is_none_is_refused(turning_radius: float) -> None:
    problem = PlanningProblem(grid_of(free_field(64, 64)), start=(5, 5), goal=(9, 9), footprint=1)
    with pytest.raises(ProblemError, match=r"turning_radius: expected a radius from 0\.01 to 1000"):
        smooth(problem, plan(problem), turning_radius=turning_radius)


def test_a_spacing_out_of_range_is_refused() -> None:
    problem = PlanningProblem(grid_of(free_field(64, 64)), start=(5, 5), goal=(9, 9), footprint=1)
    for spacing in (0.0, 1.1, math.nan):
        with pytest.raises(ProblemError, match="spacing: expected above 0 and at most 1 m, half"):
            smooth(problem, plan(problem), turning_radius=2.0, spacing=spacing)
    with pytest.raises(
        ProblemError, match=r"spacing: expected at least .* m, for at most 1000000 waypoints"
    ):
        smooth(problem, plan(problem), turning_radius=2.0, spacing=1e-7)


def test_a_smoothed_route_is_not_smoothed_again() -> None:
    z = free_field(64, 64)
    z[:40, 30] = BLOCKED
    problem = PlanningProblem(grid_of(z), start=(6, 4), goal=(56, 14), footprint=4.0)
    rounded = smooth(problem, plan(problem), turning_radius=8.0)
    with pytest.raises(ProblemError, match=r"with planned headings \(astar\)"):
        smooth(problem, rounded, turning_radius=4.0)


def test_a_turning_radius_of_a_kilometre_ends_in_time() -> None:
    z = free_field(64, 64)
    z[:40, 30] = BLOCKED
    problem = PlanningProblem(grid_of(z), start=(10, 10), goal=(50, 10), footprint=1.0)
    with pytest.raises(SmoothingError, match=r"with a turning radius of 1000.00 m"):
        smooth(problem, plan(problem), turning_radius=1000.0, time_limit=None)
    with pytest.raises(TimeLimitError, match="smooth: no route within time_limit = 0 s"):
        smooth(problem, plan(problem), turning_radius=2.0, time_limit=0.0)


def test_the_curvature_of_an_invalid_line_is_refused() -> None:
    with pytest.raises(InputError, match=r"waypoints: expected finite numbers, got nan"):
        max_curvature(np.array([(0.0, 0.0), (math.nan, 1.0), (2.0, 2.0)]))
