"""Why there is no route: who is fenced in, how far one gets, where the widest way is narrowest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from groundmap.arrays import Bools
from planners.answers import check_start_is_known, costmap_of
from planners.costmap import Costmap
from planners.errors import EnclosedError
from planners.fields import reachable
from planners.footprint import Footprint
from planners.problem import PlanningProblem
from planners.widest import LATTICE_SLACK, WidestRoute, widest_way
from planners.wording import Place, Point, Turning


def enclosed(costmap: Costmap, *, needed: float | None = None) -> EnclosedError:
    """Return the exception that says why start and goal are not joined.

    Parameters
    ----------
    costmap : Costmap
    needed : float, optional [m]
        Width of the disc within the footprint, for planners that heed its heading; unless told,
        that of the disc that holds it however it is turned.

    Raises
    ------
    UnknownSpaceError
        The start is an island in unknown space.
    """
    problem, resolution = costmap.problem, costmap.window.resolution
    radius = costmap.radius if needed is None else needed / 2.0
    from_start = reachable(costmap, problem.start_xy, radius=radius)
    check_start_is_known(costmap)
    from_goal = reachable(costmap, problem.goal_xy, radius=radius)
    place: Place = "start" if from_start.sum() < from_goal.sum() else "goal"
    fenced = from_start if place == "start" else from_goal
    nearest, distance = _nearest(costmap, from_start)
    widest = widest_way(costmap, seen_from=place)
    turning: Turning = "none" if problem.shape.is_disc else "anyhow"
    return EnclosedError(
        place,
        area=float(fenced.sum()) * resolution**2,
        nearest=nearest,
        distance=distance,
        widest_gap=0.0 if widest is None else widest.width,
        bottleneck=None if widest is None else widest.bottleneck,
        needed=2.0 * radius,
        slack=LATTICE_SLACK * resolution,
        turning=turning if needed is None else "heeded",
    )


def widest_route(problem: PlanningProblem) -> WidestRoute:
    """Return the widest route from start to goal: what the widest robot would do.

    It leads along the half-cell lattice; a slanted way may be wider by up to 0.71 cells. The
    footprint does not matter, but for what is cleared around the start.

    Parameters
    ----------
    problem : PlanningProblem

    Raises
    ------
    OutsideMapError, NonFreeError, UnknownSpaceError
        Start or goal is no place even for a point.
    EnclosedError
        No way joins them, however narrow.

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
    widest = widest_way(costmap)
    if widest is None:
        raise enclosed(costmap)
    return widest


def _nearest(costmap: Costmap, reached: Bools) -> tuple[Point, float]:
    """Return the reached centre nearest to the goal, else the start, and its distance."""
    centres = costmap.window.cell_to_world(np.argwhere(reached))
    places = centres if len(centres) else np.array([costmap.problem.start_xy])
    distances = np.hypot(*(places - costmap.problem.goal_xy).T)
    i = int(distances.argmin())
    return (float(places[i, 0]), float(places[i, 1])), float(distances[i])
