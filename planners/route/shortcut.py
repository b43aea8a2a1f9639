"""Pulling a route tight: the best chain of straight legs through points of its line."""

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

AHEAD, AHEAD_DENSE = 128, 16  # points that a leg may skip: bounds the time on routes of many turns
PASSES = 12
GAIN = 2e-4  # share of the cost; a pass that wins less is the last
PRICE = 1e-2  # [cells] a leg more must win at least as much
TIE = 1e-9  # [cells] the same where cells cost extra, so that no line gets dearer
SAME_PLACE = 1e-9  # [m]
TURNED = 1e-6  # [rad] headings that are off the line by more were decided on


def shortcut(problem: PlanningProblem, route: Route, *, clearance: float | None = None) -> Route:
    """Return the route pulled tight: never longer, never dearer, with the same ends.

    Straight legs replace parts of the line wherever they keep the footprint's radius exactly
    (a footprint without a radius: wherever they touch nothing). The legs join waypoints, or
    points along the line that are the denser the nearer a turn is; among such chains the best is
    found, and the line of the best is tightened again until that wins nothing. Where cells cost
    extra, the best is the cheapest. The result may still turn around obstacles on a side that
    another planner wouldn't choose.

    Parameters
    ----------
    problem : PlanningProblem
        What the route answers.
    route : Route
        From any planner that does not decide on headings.
    clearance : float, optional [m]
        Distance that new legs keep where what they replace kept it; where that kept less, they
        keep no less than that. Only the footprint's radius unless told.

    Returns
    -------
    Route
        Measured anew, and audited. `bound` holds as before; `seconds` has grown by the time this
        took.

    Raises
    ------
    ProblemError
        A route that isn't one of the problem, or whose headings were decided on; a map that is
        not 2-D; a clearance that is negative or no number.

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
    """Return the costmap of a route whose line may be changed.

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
    if _decides_on_headings(route):
        raise ProblemError(
            "route",
            "one that only says where to drive",
            f"one whose headings were decided on ({route.planner})",
            hint="Its poses can be driven as they are; a changed line would need other headings.",
        )
    costmap = Costmap.of(problem)
    kept = costmap.clearance_of(route.waypoints)
    if kept < costmap.radius - 2.0 * costmap.slack:
        raise ProblemError(
            "route",
            f"one that keeps {costmap.radius:.2f} m, the radius of a disc around the footprint",
            f"one that keeps {kept:.2f} m",
            hint="Of a route that is planned with a polygon's headings, leave the line as it is.",
        )
    return costmap


def tighten(costmap: Costmap, line: Floats, *, clearance: float | None = None) -> Floats:
    """Return the line pulled tight, shape (n, 2) [m, map].

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
    """Return the length of a line, the metres in dear cells counted more [m]."""
    if costmap.uniform:
        return length_of(line)
    factors, cells = factors_of(costmap), costmap.to_cells(line)
    legs = np.column_stack([cells[:-1], cells[1:]]).tolist()
    return sum(leg_cost(factors, *leg) for leg in legs) * costmap.window.resolution


def factors_of(costmap: Costmap) -> Floats:
    """Return what a metre costs in each cell, shape (rows, cols); empty if all cost the same."""
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
    """Return places along each leg, from 0 to 1: half a cell from its ends, 2, 8, 32 ..."""
    lengths = np.hypot(*np.diff(line, axis=0).T) / resolution
    places = []
    for length in lengths.tolist():
        away = 0.5 * 4.0 ** np.arange(math.ceil(math.log2(max(length, 1.0)) / 2.0))
        near = away[away < length / 2.0] / length
        places.append(np.concatenate([near, [0.5], 1.0 - near[::-1]]))
    return places


def _with_points(line: Floats, places: list[Floats]) -> tuple[Floats, Ints, Ints]:
    """Return the line with points added, and of each point the leg from it and the leg to it."""
    points, begins, ends = [line[:1]], [0], [-1]
    for k, along in enumerate(places):
        points += [line[k] + along[:, None] * (line[k + 1] - line[k]), line[k + 1 : k + 2]]
        begins += [k] * len(along) + [k + 1]
        ends += [k] * (len(along) + 1)
    return np.concatenate(points), np.array(begins), np.array(ends)


def _decides_on_headings(route: Route) -> bool:
    """Whether the headings are others than those along the line."""
    steps = np.diff(route.waypoints, axis=0)
    moved = np.hypot(*steps.T) > SAME_PLACE + rounding_at(route.waypoints)
    off = route.headings[:-1] - np.arctan2(steps[:, 1], steps[:, 0])
    return bool((np.abs(np.angle(np.exp(1j * off[moved]))) > TURNED).any())
