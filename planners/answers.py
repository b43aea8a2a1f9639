"""What every way to plan shares: places are checked before, routes are measured and audited."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from groundmap.arrays import Floats
from planners.audit import audit
from planners.audit3d import audit3d
from planners.costmap import SLACK, Costmap
from planners.engine import Found
from planners.errors import (
    NonFreeError,
    OutsideMapError,
    Place,
    Point,
    ProblemError,
    UnknownSpaceError,
)
from planners.problem import PlanningProblem
from planners.route import Route
from planners.space import Space
from planners.voxels import Voxels


def space_of(problem: PlanningProblem) -> Costmap | Voxels:
    """Return the map as a problem sees it, if start and goal are places for the footprint.

    Raises
    ------
    OutsideMapError, NonFreeError, UnknownSpaceError
    """
    check_on_map(problem)
    space = _seen(problem)
    check_space(space, "start", problem.start_xy)
    check_space(space, "goal", problem.goal_xy)
    return space


def costmap_of(problem: PlanningProblem) -> Costmap:
    """Return the costmap of a problem on a 2-D map, as `space_of` does.

    Raises
    ------
    ProblemError
        A 3-D map.
    OutsideMapError, NonFreeError, UnknownSpaceError
    """
    if problem.grid.ndim != 2:
        raise ProblemError("grid", "a 2-D map", f"one of {problem.grid.ndim}-D")
    space = space_of(problem)
    assert isinstance(space, Costmap)
    return space


def answer(space: Costmap | Voxels, found: Found, *, planner: str, seconds: float) -> Route:
    """Return what a planner found as a route that the audit passed.

    Raises
    ------
    AuditError
        It keeps not what was asked: a bug in the planner.
    """
    if space.problem.grid.ndim == 3:
        audit3d(space.problem, found.waypoints)
    else:
        audit(space.problem, found.waypoints, headings=found.headings)
    return Route.along(space, found, planner=planner, seconds=seconds)


def check_on_map(problem: PlanningProblem) -> None:
    """Check that start and goal lie on touched tiles.

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
    for place, xy, margin in places:
        if not _touches_tile(problem, xy, margin):
            if not any(True for _ in grid.tiles()):
                raise OutsideMapError(place, xy, bounds=())
            nearest = nearest_place(_seen(replace(problem, clear_start=False)), xy)
            raise OutsideMapError(place, xy, bounds=tuple(grid.bounds().tolist()), nearest=nearest)


def check_space(space: Space, place: Place, xy: Point) -> None:
    """Check that the footprint fits: the state of the place itself comes before what is near.

    Raises
    ------
    NonFreeError, UnknownSpaceError
    """
    cell = tuple(np.floor(space.to_cells(xy)[0]).astype(np.int64)[::-1])
    unknown = space.blocked & ~space.nonfree
    checks = [(space.nonfree, NonFreeError), (unknown, UnknownSpaceError)]
    if unknown[cell]:
        checks.reverse()
    for blocked, error in checks:
        distance = space.clearance_of(xy, to=blocked)
        if distance < space.radius - SLACK or blocked[cell]:
            nearest = nearest_place(space, xy)
            raise error(place, xy, clearance=distance, needed=space.radius, nearest=nearest)


def nearest_place(space: Space, xy: Point) -> Point | None:
    """Return the cell centre nearest to a place where the footprint fits, or None [m, map]."""
    cells = np.argwhere(space.stand)
    if len(cells) == 0:
        return None
    centres: Floats = space.window.cell_to_world(cells)
    nearest = centres[np.linalg.norm(centres - xy, axis=1).argmin()]
    return tuple(nearest.tolist())


def _seen(problem: PlanningProblem) -> Costmap | Voxels:
    return Costmap.of(problem) if problem.grid.ndim == 2 else Voxels.of(problem)


def _touches_tile(problem: PlanningProblem, xy: Point, margin: float) -> bool:
    grid = problem.grid
    side = grid.tile_shape[0] * grid.resolution
    position = (np.array(xy) - grid.origin) / side
    for index, _ in grid.tiles():
        first = np.array(index)[::-1]
        away = np.maximum(np.maximum(first - position, position - first - 1), 0.0)
        if np.linalg.norm(away) * side <= margin:
            return True
    return False
