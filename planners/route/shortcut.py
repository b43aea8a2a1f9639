"""Shortening a route: the best chain of straight legs through points of its line."""

from __future__ import annotations

import math
import time

import numpy as np

from groundmap.arrays import Floats, Ints, is_number
from planners.costmap.costmap import Costmap
from planners.errors import ProblemError
from planners.geometry.polyline import length_of, merge_collinear
from planners.geometry.rounding import rounding_at
from planners.problem.costs import MAX_NON_OBSTACLE
from planners.problem.problem import PlanningProblem
from planners.route.kernels.shortcut import best_chain, leg_cost
from planners.route.route import Route
from planners.route.solve import build_route
from planners.search.base import SearchResult

AHEAD, AHEAD_DENSE = 128, 16  # points that a leg may span: bounds the time on long routes
PASSES = 12
GAIN = 2e-4  # share of the cost; a pass that saves less is the last
PRICE = 1e-2  # [cells] least saving of an additional leg
TIE = 1e-9  # [cells] the same for non-uniform costs, so that no line becomes more expensive
SAME_PLACE = 1e-9  # [m]
TURNED = 1e-6  # [rad] headings that deviate more from the line were planned


def shortcut(problem: PlanningProblem, route: Route, *, clearance: float | None = None) -> Route:
    """Return the shortened route: never longer, never more expensive, with the same ends.

    Straight legs replace parts of the line where they keep the footprint's radius exactly (for a
    radius of 0, where they touch no blocked cell). The legs connect waypoints or points along the
    line, which are denser near turns. The best of such chains is shortened again until nothing is
    saved; with non-uniform costs, the best is the cheapest. The result may pass obstacles on
    another side than the shortest route.

    Parameters
    ----------
    problem : PlanningProblem
        The problem of the route, on a 2-D map.
    route : Route
        From any planner that does not plan headings.
    clearance : float, optional [m]
        Distance that new legs keep where the replaced part kept it; elsewhere they keep at least
        the distance of that part. Default: only the footprint's radius.

    Returns
    -------
    Route
        Measured again, and audited. `bound` is unchanged; `seconds` includes the shortening.

    Raises
    ------
    ProblemError
        A route of another problem or with planned headings; a 3-D map; a clearance that is
        negative or not a number.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners import plan
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(2, 2), goal=(30, 6), footprint=0.9)
    >>> route = plan(problem)
    >>> tight = shortcut(problem, route)
    >>> tight.waypoints.tolist(), round(route.length, 3), round(tight.length, 3)
    ([[2.0, 2.0], [30.0, 6.0]], 29.657, 28.284)
    """
    began = time.perf_counter()
    if clearance is not None and not (is_number(clearance) and clearance >= 0):
        raise ProblemError("clearance", "a distance of 0 or more [m]", repr(clearance))
    costmap = costmap_for(problem, route)
    kept = None if clearance is None else float(clearance)
    line = tighten(costmap, route.waypoints, clearance=kept)
    saved = cost_of(costmap, route.waypoints) - cost_of(costmap, line)
    cost = length_of(line) if costmap.uniform else route.cost - saved
    result = SearchResult(line, route.expanded, bound=route.bound, cost=cost)
    seconds = route.seconds + time.perf_counter() - began
    return build_route(costmap, result, planner=route.planner, seconds=seconds)


def costmap_for(problem: PlanningProblem, route: Route) -> Costmap:
    """Return the costmap of a problem after checking that the route's line may be changed.

    Parameters
    ----------
    problem : PlanningProblem
    route : Route

    Raises
    ------
    ProblemError
        See `shortcut`.
    """
    problem.check_dimensions(2)
    ends = np.array([problem.start_xy, problem.goal_xy])
    if np.abs(route.waypoints[[0, -1]] - ends).max() > SAME_PLACE + rounding_at(ends):
        got = " to ".join(f"({x:.2f}, {y:.2f})" for x, y in route.waypoints[[0, -1]].tolist())
        raise ProblemError("route", "one from the problem's start to its goal", f"one from {got}")
    if _has_planned_headings(route):
        raise ProblemError(
            "route",
            "one without planned headings",
            f"one with planned headings ({route.planner})",
            hint="Use the route unchanged: another line would need other headings.",
        )
    costmap = Costmap.of(problem)
    kept = costmap.clearance_of(route.waypoints)
    if kept < costmap.radius - 2.0 * costmap.slack:
        raise ProblemError(
            "route",
            f"one that keeps {costmap.radius:.2f} m, the radius of a disc around the footprint",
            f"one that keeps {kept:.2f} m",
            hint="Use a route with the headings of a polygon unchanged.",
        )
    return costmap


def tighten(costmap: Costmap, line: Floats, *, clearance: float | None = None) -> Floats:
    """Return the shortened line, shape (n, 2) [m, map].

    Parameters
    ----------
    costmap : Costmap
    line : ndarray, shape (m, 2) [m, map]
    clearance : float, optional [m]
        As for `shortcut`.
    """
    line = _tighten_once(costmap, merge_collinear(line), clearance=clearance)
    cost = cost_of(costmap, line)
    for _ in range(PASSES):
        if len(line) == 2:
            break
        line = _tighten_once(costmap, line, clearance=clearance, dense=True)
        before, cost = cost, cost_of(costmap, line)
        if before - cost < GAIN * before:
            break
    return line


def cost_of(costmap: Costmap, line: Floats) -> float:
    """Return the length of a line, weighted by the cost of the cells [m].

    Parameters
    ----------
    costmap : Costmap
    line : ndarray, shape (n, 2) [m, map]
    """
    if costmap.uniform:
        return length_of(line)
    factors, cells = factors_of(costmap), costmap.to_cells(line)
    legs = np.column_stack([cells[:-1], cells[1:]]).tolist()
    return sum(leg_cost(factors, *leg) for leg in legs) * costmap.window.resolution


def factors_of(costmap: Costmap) -> Floats:
    """Return the cost of a metre in each cell, shape (rows, cols); empty for uniform costs."""
    if costmap.uniform:
        return np.empty((0, 0))
    costs = np.minimum(costmap.costs, MAX_NON_OBSTACLE)
    return 1.0 + costs * (costmap.top / MAX_NON_OBSTACLE)


def _tighten_once(
    costmap: Costmap, line: Floats, *, clearance: float | None, dense: bool = False
) -> Floats:
    """Return the best chain through waypoints of the line and, if dense, points between them."""
    resolution = costmap.window.resolution
    places = _grade(line, resolution) if dense else [np.empty(0)] * (len(line) - 1)
    points, begins, ends = _with_points(line, places)
    need = max(costmap.radius - costmap.slack, costmap.slack) / resolution
    wanted = max(need, (0.0 if clearance is None else clearance) / resolution)
    chain = best_chain(
        costmap.blocked,
        costmap.all_squared,
        factors_of(costmap),
        costmap.to_cells(points),
        begins,
        ends,
        need,
        wanted,
        PRICE if costmap.uniform else TIE,
        AHEAD_DENSE if dense else AHEAD,
    )
    return merge_collinear(points[chain])


def _grade(line: Floats, resolution: float) -> list[Floats]:
    """Return positions along each leg, from 0 to 1: 0.5, 2, 8, 32 ... cells from its ends."""
    lengths = np.hypot(*np.diff(line, axis=0).T) / resolution
    places = []
    for length in lengths.tolist():
        away = 0.5 * 4.0 ** np.arange(math.ceil(math.log2(max(length, 1.0)) / 2.0))
        near = away[away < length / 2.0] / length
        places.append(np.concatenate([near, [0.5], 1.0 - near[::-1]]))
    return places


def _with_points(line: Floats, places: list[Floats]) -> tuple[Floats, Ints, Ints]:
    """Return the line with added points, and the legs that begin and end at each point."""
    points, begins, ends = [line[:1]], [0], [-1]
    for k, along in enumerate(places):
        points += [line[k] + along[:, None] * (line[k + 1] - line[k]), line[k + 1 : k + 2]]
        begins += [k] * len(along) + [k + 1]
        ends += [k] * (len(along) + 1)
    return np.concatenate(points), np.array(begins), np.array(ends)


def _has_planned_headings(route: Route) -> bool:
    """Whether the headings deviate from the direction of the line."""
    steps = np.diff(route.waypoints, axis=0)
    moved = np.hypot(*steps.T) > SAME_PLACE + rounding_at(route.waypoints)
    off = route.headings[:-1] - np.arctan2(steps[:, 1], steps[:, 0])
    return bool((np.abs(np.angle(np.exp(1j * off[moved]))) > TURNED).any())
