"""Planners by name, and `plan`, the one way to a route."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from groundmap.settings import Settings
from planners.astar import AStarSettings, Found, astar
from planners.audit import audit
from planners.costmap import SLACK, Costmap
from planners.enclosure import enclosed
from planners.errors import NonFreeError, OutsideMapError, Place, ProblemError, UnknownSpaceError
from planners.kernels.clearance import line_clearance
from planners.problem import PlanningProblem
from planners.route import Route


class Planner(NamedTuple):
    """A planner, and the class of its settings."""

    search: Callable[[Costmap, Any], Found | None]
    settings: type[Settings]


PLANNERS: dict[str, Planner] = {"astar": Planner(astar, AStarSettings)}


def plan(problem: PlanningProblem, planner: str = "astar", **settings: Any) -> Route:
    """Return a route that the audit passed, or raise an exception that says why there is none.

    Parameters
    ----------
    problem : PlanningProblem
    planner : str, default "astar"
        A name in `PLANNERS`.
    **settings
        The planner's settings, such as `planners.astar.AStarSettings`.

    Raises
    ------
    ProblemError
        No planner of that name.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).
    OutsideMapError, NonFreeError, UnknownSpaceError
        Start or goal is no place for the footprint.
    EnclosedError
        No route joins them.
    TimeLimitError
        Time ran out.
    AuditError
        The planner's route keeps not what was asked: a bug in the planner.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> route = plan(PlanningProblem(grid, start=(2, 2), goal=(30, 6), footprint=0.9))
    >>> route.waypoints.tolist()[0], route.min_clearance, route.audit
    ([2.0, 2.0], 2.0, 'clean')
    """
    began = time.perf_counter()
    if planner not in PLANNERS:
        raise ProblemError("planner", f"one of {', '.join(sorted(PLANNERS))}", repr(planner))
    search, settings_class = PLANNERS[planner]
    chosen = settings_class(**settings)
    _check_on_map(problem)
    costmap = Costmap.of(problem)
    _check_space(costmap, "start")
    _check_space(costmap, "goal")
    found = search(costmap, chosen)
    if found is None:
        raise enclosed(costmap)
    seconds = time.perf_counter() - began
    audit(problem, found.waypoints)
    return Route.along(
        costmap, found.waypoints, planner=planner, expanded=found.expanded, seconds=seconds
    )


def _check_on_map(problem: PlanningProblem) -> None:
    """Check that start and goal lie on touched tiles.

    A start whose surroundings are cleared may stand beside them, as long as its footprint (or a
    cell) reaches them: poses at the border of a tile are off by rounding.
    """
    grid = problem.grid
    reach = max(problem.footprint, grid.resolution) if problem.clear_start else 0.0
    places: tuple[tuple[Place, tuple[float, float], float], ...] = (
        ("start", problem.start_xy, reach),
        ("goal", problem.goal_xy, 0.0),
    )
    for place, xy, margin in places:
        if not _touches_tile(problem, xy, margin):
            bounds = tuple(grid.bounds().tolist()) if any(True for _ in grid.tiles()) else ()
            raise OutsideMapError(place, xy, bounds=bounds)


def _touches_tile(problem: PlanningProblem, xy: tuple[float, float], margin: float) -> bool:
    grid = problem.grid
    side = grid.tile_shape[0] * grid.resolution
    x, y = (np.array(xy) - grid.origin) / side
    for (row, col), _ in grid.tiles():
        dx, dy = max(col - x, 0.0, x - col - 1), max(row - y, 0.0, y - row - 1)
        if math.hypot(dx, dy) * side <= margin:
            return True
    return False


def _check_space(costmap: Costmap, place: Place) -> None:
    """Check that the footprint fits: the state of the place itself comes before what is near."""
    problem = costmap.problem
    xy = problem.start_xy if place == "start" else problem.goal_xy
    col, row = np.floor(costmap.to_cells(xy)[0]).astype(np.int64)
    unknown = costmap.blocked & ~costmap.nonfree
    checks = [(costmap.nonfree, NonFreeError), (unknown, UnknownSpaceError)]
    if unknown[row, col]:
        checks.reverse()
    for blocked, error in checks:
        distance = line_clearance(blocked, costmap.to_cells(xy)) * costmap.window.resolution
        if distance < problem.footprint - SLACK or blocked[row, col]:
            raise error(place, xy, clearance=distance, needed=problem.footprint)
