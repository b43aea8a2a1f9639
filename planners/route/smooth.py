"""Smoothing a route: rounding its corners to a bounded curvature while keeping its clearance."""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, as_floats, check_finite, is_number
from planners.costmap.costmap import Costmap
from planners.error_messages import Point
from planners.errors import ProblemError, SmoothingError
from planners.geometry.polyline import length_of
from planners.problem.problem import PlanningProblem
from planners.route.kernels.smooth import free_discs, relax
from planners.route.route import Route
from planners.route.shortcut import cost_of, costmap_for, tighten
from planners.route.solve import build_route
from planners.search.base import Clock, SearchResult, check_limit

ROUNDS, INNER = 24, 100  # updates of the discs, and iterations of the relaxation between them
FEWEST, MOST = 8, 1_000_000  # pieces of a line
# Distances that the centres of discs move in successive rounds, in turning radii: large discs
# leave tight places, small ones use the available clearance.
REACH = (0.25, 0.05, 0.05, 0.05)
FIRST, TIGHTER, TIGHTEST = 1.03, 1.05, 1.1  # factors by which the bound on bends is tightened
WIDER = 0.05  # [cells] largest increase of the required clearance after a round that missed it
STRAIGHT = 1e-9  # [rad]
TINY = 1e-12  # [m] least length of a step in a curvature
SMALLEST, LARGEST = 0.01, 1000.0  # [m] turning radius
SHARES = (0.8, 0.6, 0.4, 0.2)  # of the turning radius, tried to report a possible one


class _Goals(NamedTuple):
    """Constraints on a line."""

    turning_radius: float  #: [m]
    spacing: float  #: [m]
    yaws: tuple[float | None, float | None]  #: requested at start and goal


def smooth(
    problem: PlanningProblem,
    route: Route,
    *,
    turning_radius: float,
    spacing: float | None = None,
    time_limit: float | None = 30.0,
) -> Route:
    """Return the route with rounded corners, for a robot that can't turn on the spot.

    The route is shortened (`planners.shortcut`) and resampled densely. Its points are then moved
    within discs of free space until no bend exceeds the bound (convex elastic smoothing, after
    Zhu, Schmerling and Pavone 2015). The result is returned only if it keeps the exact clearance
    and the curvature everywhere. Costs of cells are not taken into account.

    Parameters
    ----------
    problem : PlanningProblem
        The problem of the route. The line begins and ends along the yaw of start and goal, if
        they have one.
    route : Route
        From any planner that does not plan headings.
    turning_radius : float [m]
        Smallest radius of the line's bends, from 0.01 to 1000.
    spacing : float, optional [m]
        Approximate distance of waypoints, at most half the turning radius. Default: the smaller
        of half a cell and a quarter of the turning radius.
    time_limit : float or None, default 30 [s]
        Time for the smoothing; None for no limit.

    Returns
    -------
    Route
        ``max_curvature(waypoints) <= 1 / turning_radius``, with headings along the line; measured
        again, and audited. A straight route is returned unchanged. If the cost has increased,
        `bound` has increased by the same factor.

    Raises
    ------
    SmoothingError
        The clearance does not allow the turning radius, or the relaxation did not converge.
    TimeLimitError
        Time ran out.
    ProblemError
        See `planners.shortcut`; a turning radius or spacing out of range.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners import plan
    >>> z = np.full((64, 64), -1.0, dtype=np.float32)
    >>> z[:40, 30] = 1.0
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), z)
    >>> problem = PlanningProblem(grid, start=(6, 4), goal=(26, 4), footprint=1.0)
    >>> rounded = smooth(problem, plan(problem), turning_radius=4.0)
    >>> max_curvature(rounded.waypoints) <= 0.25, rounded.min_clearance >= 1.0
    (True, True)
    """
    began = time.perf_counter()
    limit = check_limit(time_limit)
    costmap = costmap_for(problem, route)
    goals = _goals(costmap, route, turning_radius, spacing)
    line = tighten(costmap, route.waypoints)
    if _is_straight(line, goals.yaws):
        result = SearchResult(line, route.expanded)
    else:
        line = _round_corners(costmap, line, goals, Clock("smooth", limit))
        result = SearchResult(line, route.expanded, headings=_headings(line, goals.yaws))
    grown = cost_of(costmap, line) - cost_of(costmap, route.waypoints)
    cost = None if costmap.uniform else route.cost + grown
    bound = route.bound
    if bound is not None and grown > 0:
        bound *= (route.cost + grown) / route.cost
    seconds = route.seconds + time.perf_counter() - began
    result = result._replace(bound=bound, cost=cost)
    return build_route(costmap, result, planner=route.planner, seconds=seconds)


def max_curvature(waypoints: Floats) -> float:
    """Return the largest curvature of the curve that a polyline approximates [1/m].

    At each inner point, it is that of the arc which is tangent to both pieces and begins half-way
    along the shorter one: a line of such arcs and straight pieces can be driven. For points spaced
    equally along an arc, it equals that of the arc up to the square of the spacing.

    Parameters
    ----------
    waypoints : ndarray, shape (n, 2) [m]

    Examples
    --------
    >>> turns = np.linspace(0.0, np.pi, 100)
    >>> round(max_curvature(2.0 * np.column_stack([np.cos(turns), np.sin(turns)])), 3)
    0.5
    >>> max_curvature(np.array([[0.0, 0.0], [3.0, 0.0], [9.0, 0.0]]))
    0.0
    """
    line = as_floats("waypoints", waypoints, (None, 2))
    check_finite("waypoints", line)
    steps = np.diff(line, axis=0)
    curvatures = _curvatures(steps[np.hypot(*steps.T) > 0.0])
    return float(curvatures.max(initial=0.0))


def _goals(costmap: Costmap, route: Route, turning_radius: float, spacing: float | None) -> _Goals:
    if not (is_number(turning_radius) and SMALLEST <= turning_radius <= LARGEST):
        expected = f"a radius from {SMALLEST:g} to {LARGEST:g} [m]"
        raise ProblemError("turning_radius", expected, repr(turning_radius))
    if spacing is None:
        spacing = min(costmap.window.resolution / 2.0, turning_radius / 4.0)
    elif not (is_number(spacing) and 0 < spacing <= turning_radius / 2.0):
        expected = f"above 0 and at most {turning_radius / 2.0:g} m, half the turning radius"
        raise ProblemError("spacing", expected, repr(spacing))
    if route.length / spacing > MOST:
        expected = f"at least {route.length / MOST:g} m, for at most {MOST} waypoints"
        hint = "The default is a quarter of the turning radius."
        raise ProblemError("spacing", expected, f"{spacing:g} m", hint=hint)
    yaws = costmap.problem.start_yaw, costmap.problem.goal_yaw
    return _Goals(turning_radius, spacing, yaws)


def _round_corners(costmap: Costmap, line: Floats, goals: _Goals, clock: Clock) -> Floats:
    """Return the line with rounded corners.

    Raises
    ------
    SmoothingError
    """
    bent, good = _bend(costmap, line, goals, clock)
    if good:
        return bent
    place = _worst_place(costmap, bent, goals.turning_radius)
    possible = 0.0
    for share in SHARES:
        radius = share * goals.turning_radius
        less = goals._replace(turning_radius=radius, spacing=min(goals.spacing, radius / 2.0))
        tried, good = _bend(costmap, line, less, clock)
        if good:
            possible = min(1.0 / max_curvature(tried), goals.turning_radius)
            break
    raise SmoothingError(place, turning_radius=goals.turning_radius, possible=possible)


def _bend(costmap: Costmap, line: Floats, goals: _Goals, clock: Clock) -> tuple[Floats, bool]:
    """Return the smoothed line, and whether it satisfies the constraints.

    Each round determines the discs around the points and relaxes the line within them. The result
    is close to its bounds, on either side, so each missed bound is tightened for the next round.
    """
    size, radius = costmap.window.resolution, goals.turning_radius
    need = max(costmap.radius - costmap.slack, costmap.slack)
    low, high = (1 if yaw is None else 2 for yaw in goals.yaws)  # fixed points
    strictness = FIRST
    # The chord of two points may come closer to a corner than the points.
    margin = math.hypot(costmap.radius, goals.spacing / 2.0) - costmap.radius
    longest = length_of(line)  # discs farther from the line are useless
    for k in range(ROUNDS):
        clock.check(k)
        line, step = _resample(line, goals)
        cells = costmap.to_cells(line)
        reach = min(REACH[k % len(REACH)] * radius, longest)
        discs = free_discs(costmap.blocked, cells, (costmap.radius + margin) / size, reach / size)
        discs = _on_map(costmap, discs)
        bend = step * step / (radius * strictness * size)
        cells = relax(cells, discs, bend, low, len(line) - high, INNER)
        inner = cells[low:-high] * size + costmap.window.origin
        line = np.concatenate([line[:low], inner, line[-high:]])
        curvature, clearance = max_curvature(line), costmap.clearance_of(line)
        if curvature <= 1.0 / radius and clearance >= need and _is_on_map(costmap, line):
            return line, True
        if curvature > 1.0 / radius:
            tighter = strictness * min(TIGHTER, math.sqrt(curvature * radius))
            strictness = min(tighter, TIGHTEST)
        if clearance < need:
            margin += min(need - clearance, WIDER * size)
    return line, False


def _on_map(costmap: Costmap, discs: Floats) -> Floats:
    """Return discs cut to the costmap, as nothing outside it is blocked if unknown is allowed."""
    most = np.array(costmap.blocked.shape[::-1], dtype=np.float64)
    centres = np.clip(discs[:, :2], 0.0, most)
    border = np.minimum(centres, most - centres).min(axis=1)
    return np.column_stack([centres, np.minimum(discs[:, 2], border)])


def _is_on_map(costmap: Costmap, line: Floats) -> bool:
    cells = costmap.to_cells(line)
    return bool((cells >= 0.0).all() and (cells < costmap.blocked.shape[::-1]).all())


def _resample(line: Floats, goals: _Goals) -> tuple[Floats, float]:
    """Return points along a line at equal distances, and the distance [m].

    If a yaw is requested at an end, the adjacent point is moved onto its direction.
    """
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    pieces = max(FEWEST, math.ceil(along[-1] / goals.spacing))
    at = np.linspace(0.0, along[-1], pieces + 1)
    points = np.column_stack([np.interp(at, along, line[:, k]) for k in range(2)])
    points[[0, -1]] = line[[0, -1]]
    step = float(along[-1]) / pieces
    for yaw, end, sign in zip(goals.yaws, (0, -1), (1, -1), strict=True):
        if yaw is not None:
            points[end + sign] = points[end] + sign * step * np.array(
                [math.cos(yaw), math.sin(yaw)]
            )
    return points, step


def _curvatures(steps: Floats) -> Floats:
    """Return the curvature between each two steps of a line [1/m]."""
    lengths, directions = np.hypot(*steps.T), np.arctan2(steps[:, 1], steps[:, 0])
    turns = np.abs(np.angle(np.exp(1j * np.diff(directions))))
    shorter: Floats = np.maximum(np.minimum(lengths[:-1], lengths[1:]), TINY)
    curvatures: Floats = 2.0 * np.tan(turns / 2.0) / shorter
    return curvatures


def _headings(line: Floats, yaws: tuple[float | None, float | None]) -> Floats:
    """Return the directions of a line at its points, shape (n,) [rad]."""
    across = np.concatenate([line[1:2] - line[:1], line[2:] - line[:-2], line[-1:] - line[-2:-1]])
    headings: Floats = np.arctan2(across[:, 1], across[:, 0])
    for end, yaw in zip((0, -1), yaws, strict=True):
        if yaw is not None:
            headings[end] = yaw
    return headings


def _is_straight(line: Floats, yaws: tuple[float | None, float | None]) -> bool:
    """Whether a line is straight or has no length, and is aligned with the yaws."""
    if len(line) > 2:
        return False
    dx, dy = (line[1] - line[0]).tolist()
    along = math.atan2(dy, dx)
    off = [abs(math.remainder(yaw - along, math.tau)) for yaw in yaws if yaw is not None]
    return dx == dy == 0.0 or max(off, default=0.0) <= STRAIGHT


def _worst_place(costmap: Costmap, line: Floats, turning_radius: float) -> Point:
    """Return where a line bends too much, or else where it has the least clearance."""
    curvatures = _curvatures(np.diff(line, axis=0))
    worst = int(curvatures.argmax())
    if curvatures[worst] * turning_radius <= 1.0:
        worst = int(np.argmin([costmap.clearance_of(point) for point in line[1:-1]]))
    x, y = line[1 + worst].tolist()
    return x, y
