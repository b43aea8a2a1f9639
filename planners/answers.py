"""What every way to plan shares: places are checked before, routes are measured and audited."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from groundmap.arrays import Bools, Floats
from planners.audit import audit
from planners.audit3d import audit3d
from planners.costmap import Costmap
from planners.engine import Found, Pose
from planners.errors import NonFreeError, OutsideMapError, ProblemError, UnknownSpaceError
from planners.kernels.footprint import pose_clear
from planners.problem import PlanningProblem
from planners.rounding import slack_at
from planners.route import Route
from planners.space import Space
from planners.voxels import Voxels
from planners.wording import Place, Point


def costmap_of(problem: PlanningProblem) -> Costmap:
    """Return the costmap of a problem on a 2-D map whose start and goal are places for its disc.

    Raises
    ------
    ProblemError
        A 3-D map.
    OutsideMapError, NonFreeError, UnknownSpaceError
    """
    if problem.grid.ndim != 2:
        raise ProblemError("grid", "a 2-D map", f"one of {problem.grid.ndim}-D")
    check_on_map(problem)
    costmap = Costmap.of(problem)
    check_space(costmap, "start", problem.start_xy)
    check_space(costmap, "goal", problem.goal_xy)
    return costmap


def answer(
    space: Costmap | Voxels, found: Found, *, planner: str, seconds: float, audited: bool = True
) -> Route:
    """Return what a planner found as a route that the audit passed.

    Raises
    ------
    AuditError
        It keeps not what was asked: a bug in the planner.
    """
    if audited and space.problem.grid.ndim == 3:
        audit3d(space.problem, found.waypoints)
    elif audited:
        audit(space.problem, found.waypoints, headings=found.headings)
    route = Route.along(space, found, planner=planner, seconds=seconds)
    return route if audited else replace(route, audit="skipped")


def check_on_map(problem: PlanningProblem, *, goal: bool = True) -> None:
    """Check that start and, unless told, goal lie on touched tiles.

    A start whose surroundings are cleared may stand beside them, as long as its footprint (or a
    cell) reaches them: poses at the border of a tile are off by rounding.

    Raises
    ------
    OutsideMapError
    """
    grid = problem.grid
    reach = max(problem.radius, grid.resolution) if problem.clears_its_start else 0.0
    places: tuple[tuple[Place, Point, float], ...] = (
        ("start", problem.start_xy, reach),
        ("goal", problem.goal_xy, 0.0),
    )
    for place, xy, margin in places if goal else places[:1]:
        if not _touches_tile(problem, xy, margin):
            if not any(True for _ in grid.tiles()):
                raise OutsideMapError(place, xy, bounds=())
            nearest = nearest_place(space_of(replace(problem, clear_start=False)), xy)
            raise OutsideMapError(place, xy, bounds=tuple(grid.bounds().tolist()), nearest=nearest)


def check_space(space: Space, place: Place, pose: Pose, *, headings: bool = False) -> None:
    """Check that the footprint fits: the state of the place itself comes before what is near.

    Parameters
    ----------
    space : Costmap or Voxels
    place : {"start", "goal"}
        For the sentence.
    pose : tuple of float
        x, y (in 3-D: x, y, z) [m, map] and, if `headings`, yaw [rad].
    headings : bool, default False
        Whether an outline is looked at as it is turned, or the disc around it.

    Raises
    ------
    NonFreeError, UnknownSpaceError
    """
    xy, yaw = _place_and_yaw(space, pose, headings=headings)
    cell = tuple(np.floor(space.to_cells(xy)[0]).astype(np.int64)[::-1])
    unknown = space.blocked & ~space.nonfree
    checks = [(space.nonfree, NonFreeError), (unknown, UnknownSpaceError)]
    if unknown[cell]:
        checks.reverse()
    for blocked, error in checks:
        if not _fits(space, blocked, xy, yaw):
            raise error(
                place,
                xy,
                clearance=space.clearance_of(xy, to=blocked),
                needed=space.radius,
                nearest=nearest_place(space, xy, yaw=yaw),
                yaw=yaw,
            )


def nearest_place(space: Space, xy: Point, *, yaw: float | None = None) -> Point | None:
    """Return the cell centre nearest to a place where the footprint fits, or None [m, map].

    With a yaw [rad], the outline fits that is turned so; else, the disc around it.
    """
    open_cells = space.stand if yaw is None else ~space.blocked
    centres: Floats = space.window.cell_to_world(np.argwhere(open_cells))
    away = np.hypot.reduce(centres - xy, axis=1)
    if yaw is None:
        return tuple(centres[away.argmin()].tolist()) if len(away) else None
    for index in np.argsort(away, kind="stable"):
        centre: Point = tuple(centres[index].tolist())
        if _fits(space, space.blocked, centre, yaw):
            return centre
    return None


def _place_and_yaw(space: Space, pose: Pose, *, headings: bool) -> tuple[Point, float | None]:
    ndim = space.blocked.ndim
    turned = headings and not space.problem.shape.is_disc and len(pose) > ndim
    return pose[:ndim], pose[ndim] if turned else None


def _fits(space: Space, blocked: Bools, xy: Point, yaw: float | None) -> bool:
    polygon = space.problem.shape.polygon
    position = space.to_cells(xy)[0]
    if yaw is None or polygon is None:
        cell = tuple(np.floor(position).astype(np.int64)[::-1])
        least = space.radius - slack_at(xy)
        return not blocked[cell] and space.clearance_of(xy, to=blocked, limit=space.radius) >= least
    x, y = position.tolist()
    size = space.window.resolution
    touch = slack_at(xy) / size
    return bool(pose_clear(blocked, polygon / size, x, y, math.cos(yaw), math.sin(yaw), touch))


def space_of(problem: PlanningProblem) -> Costmap | Voxels:
    """Return the map as a problem sees it: a costmap, or voxels."""
    return Costmap.of(problem) if problem.grid.ndim == 2 else Voxels.of(problem)


def _touches_tile(problem: PlanningProblem, xy: Point, margin: float) -> bool:
    grid = problem.grid
    side = grid.tile_shape[0] * grid.resolution
    position = (np.array(xy) - grid.origin) / side
    for index, _ in grid.tiles():
        first = np.array(index)[::-1]
        away = np.maximum(np.maximum(first - position, position - first - 1), 0.0)
        if math.hypot(*away) * side <= margin:
            return True
    return False
