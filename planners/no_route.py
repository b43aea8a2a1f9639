"""Why there is no route: the enclosed area, the nearest reachable cell, the narrowest passage."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from groundmap.arrays import Bools
from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import (
    check_start_is_known,
    costmap_of,
    find_way_out,
    region_around,
    space_of,
)
from planners.costmap.map_space import MapSpace
from planners.costmap.regions import nearest_cells
from planners.error_messages import Place, Point, Turning
from planners.errors import EnclosedError
from planners.problem.footprint import Footprint
from planners.problem.problem import PlanningProblem
from planners.search.widest_path import LATTICE_SLACK, WidestRoute, widest_path


def explain_no_route(space: MapSpace, *, headings: bool = False) -> EnclosedError:
    """Return the exception that explains why start and goal are not connected.

    Parameters
    ----------
    space : Costmap or Voxels
    headings : bool, default False
        Whether the planner plans headings: only the disc within the footprint is then certain to
        need its width. Otherwise the disc that holds the footprint at every heading needs it.

    Raises
    ------
    UnknownSpaceError
        The start is an island in unknown space.
    """
    problem = space.problem
    radius = problem.shape.inscribed_radius if headings else problem.radius
    free = space.traversable if radius == space.radius else space.traversable_for(radius)
    from_start = region_around(space, free, problem.start_xy, radius=radius)
    check_start_is_known(space)
    from_goal = region_around(space, free, problem.goal_xy, radius=radius)
    place: Place = "start" if from_start.sum() < from_goal.sum() else "goal"
    nearest, distance = _nearest(space, from_start)
    width, bottleneck = _widest(space, place)
    turning: Turning = "none" if problem.shape.is_disc else "any"
    return EnclosedError(
        place,
        area=space.area_of(from_start if place == "start" else from_goal),
        nearest=nearest,
        distance=distance,
        widest_gap=width,
        bottleneck=bottleneck,
        needed=2.0 * radius,
        slack=LATTICE_SLACK * space.window.resolution,
        turning="planned" if headings else turning,
        way_out=find_way_out(space),
        without=_separators(problem, radius),
    )


def _separators(problem: PlanningProblem, radius: float) -> tuple[str, ...]:
    """Return what separates start and goal that the map does not know, by the problem's fields."""
    given = [("keep_out", bool(problem.keep_out_areas)), ("recent", len(problem.recent_set) > 0)]
    names = tuple(name for name, some in given if some)
    for without in [*((name,) for name in names), names] if names else ():
        open_problem = replace(
            problem,
            keep_out=None if "keep_out" in without else problem.keep_out,
            recent=None if "recent" in without else problem.recent,
        )
        space = space_of(open_problem)
        free = space.traversable_for(radius)
        start, goal = (
            region_around(space, free, place, radius=radius)
            for place in (problem.start_xy, problem.goal_xy)
        )
        if (start & goal).any():
            return without
    return ()


def widest_route(problem: PlanningProblem) -> WidestRoute:
    """Return the widest route from start to goal: the one that the widest robot could follow.

    It follows the half-cell lattice; a slanted passage may be wider by up to 0.71 cells. The
    footprint only matters for the unknown cells that are cleared around the start.

    Parameters
    ----------
    problem : PlanningProblem
        On a 2-D map.

    Raises
    ------
    OutsideMapError, NonFreeError, UnknownSpaceError
        Not even a point fits at the start or the goal.
    EnclosedError
        No passage connects them, however narrow.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), -1.0, dtype=np.float32)
    >>> field[:, 30:32] = 1.0  # a wall
    >>> field[40:43, 30:32] = -1.0  # and a gap of 1.5 m in it
    >>> grid.fuse(np.array([0, 0]), field)
    >>> route = widest_route(PlanningProblem(grid, start=(4, 9), goal=(28, 9), footprint=0.9))
    >>> route.width, route.bottleneck, len(route.waypoints)
    (1.5, (15.5, 20.75), 8)
    """
    point = replace(problem, footprint=Footprint.of(0.0), clear_start_radius=problem.clear_radius)
    costmap = costmap_of(point)
    widest = widest_path(costmap)
    if widest is None:
        raise explain_no_route(costmap)
    return widest


def _widest(space: MapSpace, place: Place) -> tuple[float, Point | None]:
    """Return width and bottleneck of the widest passage; NaN and None on a 3-D map."""
    if not isinstance(space, Costmap):
        return math.nan, None
    widest = widest_path(space, seen_from=place)
    return (0.0, None) if widest is None else (widest.width, widest.bottleneck)


def _nearest(space: MapSpace, reached: Bools) -> tuple[Point, float]:
    """Return the reached cell centre nearest to the goal and its distance; else the start's."""
    start, goal = space.problem.start_xy, space.problem.goal_xy
    nearest, distance = nearest_cells(space.window, reached, goal)
    if distance < math.inf:
        return tuple(nearest.tolist()), distance
    return start, float(np.hypot.reduce(np.subtract(start, goal)))
