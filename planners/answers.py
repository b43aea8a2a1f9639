"""What every way to plan shares: places are checked before, routes are measured and audited."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from groundmap.arrays import Floats
from planners.audit import audit
from planners.costmap import SLACK, Costmap
from planners.engine import Found
from planners.errors import NonFreeError, OutsideMapError, Place, Point, UnknownSpaceError
from planners.kernels.clearance import line_clearance
from planners.problem import PlanningProblem
from planners.route import Route


def costmap_of(problem: PlanningProblem) -> Costmap:
    """Return the costmap of a problem whose start and goal are places for the footprint.

    Raises
    ------
    OutsideMapError, NonFreeError, UnknownSpaceError
    """
    check_on_map(problem)
    costmap = Costmap.of(problem)
    check_space(costmap, "start", problem.start_xy)
    check_space(costmap, "goal", problem.goal_xy)
    return costmap


def answer(costmap: Costmap, found: Found, *, planner: str, seconds: float) -> Route:
    """Return what a planner found as a route that the audit passed.

    Raises
    ------
    AuditError
        It keeps not what was asked: a bug in the planner.
    """
    audit(costmap.problem, found.waypoints, headings=found.headings)
    return Route.along(costmap, found, planner=planner, seconds=seconds)


def check_on_map(problem: PlanningProblem) -> None:
    """Check that start and goal lie on touched tiles.

    A start whose surroundings are cleared may stand beside them, as long as its footprint (or a
    cell) reaches them: poses at the border of a tile are off by rounding.

    Raises
    ------
    OutsideMapError
    """
    grid = problem.grid
    reach = max(problem.radius, grid.resolution) if problem.clear_start else 0.0
    places: tuple[tuple[Place, Point, float], ...] = (
        ("start", problem.start_xy, reach),
        ("goal", problem.goal_xy, 0.0),
    )
    for place, xy, margin in places:
        if not _touches_tile(problem, xy, margin):
            if not any(True for _ in grid.tiles()):
                raise OutsideMapError(place, xy, bounds=())
            nearest = nearest_place(Costmap.of(replace(problem, clear_start=False)), xy)
            raise OutsideMapError(place, xy, bounds=tuple(grid.bounds().tolist()), nearest=nearest)


def check_space(costmap: Costmap, place: Place, xy: Point) -> None:
    """Check that the footprint fits: the state of the place itself comes before what is near.

    Raises
    ------
    NonFreeError, UnknownSpaceError
    """
    col, row = np.floor(costmap.to_cells(xy)[0]).astype(np.int64)
    unknown = costmap.blocked & ~costmap.nonfree
    checks = [(costmap.nonfree, NonFreeError), (unknown, UnknownSpaceError)]
    if unknown[row, col]:
        checks.reverse()
    for blocked, error in checks:
        distance = line_clearance(blocked, costmap.to_cells(xy)) * costmap.window.resolution
        if distance < costmap.radius - SLACK or blocked[row, col]:
            raise error(
                place,
                xy,
                clearance=distance,
                needed=costmap.radius,
                nearest=nearest_place(costmap, xy),
            )


def nearest_place(costmap: Costmap, xy: Point) -> Point | None:
    """Return the cell centre nearest to a place where the footprint fits, or None [m, map]."""
    cells = np.argwhere(costmap.stand)
    if len(cells) == 0:
        return None
    centres: Floats = costmap.window.cell_to_world(cells)
    x, y = centres[np.hypot(*(centres - xy).T).argmin()].tolist()
    return x, y


def _touches_tile(problem: PlanningProblem, xy: Point, margin: float) -> bool:
    grid = problem.grid
    side = grid.tile_shape[0] * grid.resolution
    x, y = (np.array(xy) - grid.origin) / side
    for (row, col), _ in grid.tiles():
        dx, dy = max(col - x, 0.0, x - col - 1), max(row - y, 0.0, y - row - 1)
        if math.hypot(dx, dy) * side <= margin:
            return True
    return False
