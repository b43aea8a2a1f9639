"""Why there is no route: the enclosed area, the nearest reachable cell, the narrowest gap."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy import ndimage

from groundmap.arrays import Bools
from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import check_start_is_known, costmap_of
from planners.costmap.voxel_map import Voxels
from planners.error_messages import Place, Point, Turning
from planners.errors import EnclosedError
from planners.problem.footprint import Footprint
from planners.problem.problem import PlanningProblem
from planners.search.distance_field import reachable
from planners.search.widest_path import LATTICE_SLACK, WidestRoute, widest_path


def explain_enclosure(costmap: Costmap, *, needed: float | None = None) -> EnclosedError:
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
    widest = widest_path(costmap, seen_from=place)
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
    widest = widest_path(costmap)
    if widest is None:
        raise explain_enclosure(costmap)
    return widest


def _nearest(costmap: Costmap, reached: Bools) -> tuple[Point, float]:
    """Return the reached centre nearest to the goal, else the start, and its distance."""
    centres = costmap.window.cell_to_world(np.argwhere(reached))
    places = centres if len(centres) else np.array([costmap.problem.start_xy])
    distances = np.hypot(*(places - costmap.problem.goal_xy).T)
    i = int(distances.argmin())
    return (float(places[i, 0]), float(places[i, 1])), float(distances[i])


def explain_enclosure_3d(voxels: Voxels) -> EnclosedError:
    """Return the exception that says why start and goal are not joined.

    Raises
    ------
    UnknownSpaceError
        The start is an island in unknown space.
    """
    problem, resolution = voxels.problem, voxels.window.resolution
    # All voxels of a move's box must be free: whoever gets anywhere gets there over faces.
    parts, _ = ndimage.label(voxels.traversable)
    from_start, from_goal = (
        _around(voxels, parts, xyz) for xyz in (problem.start_xy, problem.goal_xy)
    )
    check_start_is_known(voxels)
    place: Place = "start" if from_start.sum() < from_goal.sum() else "goal"
    fenced = from_start if place == "start" else from_goal
    centres = voxels.window.cell_to_world(np.argwhere(from_start))
    places = centres if len(centres) else np.array([problem.start_xy])
    distances = np.linalg.norm(places - problem.goal_xy, axis=1)
    nearest = int(distances.argmin())
    return EnclosedError(
        place,
        area=float(fenced.sum()) * resolution**3,
        nearest=tuple(places[nearest].tolist()),
        distance=float(distances[nearest]),
        widest_gap=math.nan,
        needed=2.0 * problem.radius,
    )


def _around(voxels: Voxels, parts: Bools, xyz: Point) -> Bools:
    """Return the voxels that can be reached from those around a place."""
    position = voxels.to_cells(xyz)[0][::-1] - 0.5
    low, high = np.floor(position).astype(int), np.ceil(position).astype(int)
    box = tuple(slice(max(i, 0), j + 1) for i, j in zip(low, high, strict=True))
    near = np.unique(parts[box])
    reached: Bools = np.isin(parts, near[near > 0])
    return reached
