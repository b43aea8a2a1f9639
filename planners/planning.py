"""`plan`: from a problem and the name of a planner to an audited route."""

from __future__ import annotations

from typing import Any

from planners.costmap.endpoint_check import check_on_map, space_of
from planners.costmap.voxel_map import Voxels
from planners.errors import ProblemError
from planners.problem.problem import PlanningProblem
from planners.registry import Planner, get_planner
from planners.route.route import Route
from planners.route.solve import solve
from planners.search.astar3d import AStar3D
from planners.search.base import Cancel, OnImproved, check_cancel, now

SPATIAL = ("astar", "auto")  # planners that plan on 3-D maps, too


def plan(
    problem: PlanningProblem,
    planner: str = "astar",
    *,
    on_improved: OnImproved | None = None,
    cancel: Cancel | None = None,
    **settings: Any,
) -> Route:
    """Return a route that the audit passed, or raise an exception that says why there is none.

    Parameters
    ----------
    problem : PlanningProblem
    planner : str, default "astar"
        A name in `PLANNERS`.
    on_improved : callable, optional
        Called with an `Improvement` for the first route and every better one, while the search
        goes on. If it returns True, it hears no more, and the search ends. Only "ara" and sampling
        planners tell.
    cancel : Cancel, optional
        Such as a `threading.Event`: once another thread sets it, the search ends, with the best
        route so far. Only "ara" and sampling planners look at it.
    **settings
        The planner's settings, such as `planners.AStarSettings`.

    Raises
    ------
    ProblemError
        No planner of that name, or one that can neither tell nor be cancelled.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).
    OutsideMapError, NonFreeError, UnknownSpaceError
        Start or goal is no place for the footprint.
    EnclosedError
        No route joins them.
    TimeLimitError
        Time ran out.
    CancelledError
        The search was cancelled before there was a route.
    UnsolvedError
        A sampling planner ended without a route.
    AuditError
        The planner's route keeps not what was asked: a bug in the planner.

    Examples
    --------
    >>> import numpy as np
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> route = plan(PlanningProblem(grid, start=(2, 2), goal=(30, 6), footprint=0.9))
    >>> route.waypoints.tolist()[0], route.min_clearance, route.audit
    ([2.0, 2.0], 2.0, 'clean')
    """
    entry = get_planner(planner)
    began = now()
    chosen = entry.settings(**settings)
    watch = _watch(planner, entry, on_improved=on_improved, cancel=cancel)
    check_on_map(problem, goal=not chosen.takes_other_goals)
    space = space_of(problem)
    if isinstance(space, Voxels) and not entry.spatial:
        return solve(space, _engine_3d(space, planner), chosen, began=began)
    headings = entry.headings and chosen.uses_headings(problem)
    return solve(space, entry.engine(space), chosen, began=began, headings=headings, watch=watch)


def _watch(planner: str, entry: Planner, **watch: Any) -> dict[str, Any]:
    """Return what an anytime planner is to tell of or to look at; others have no such thing."""
    asked = {name: value for name, value in watch.items() if value is not None}
    if asked and not entry.anytime:
        expected = "none, or an anytime planner: 'ara' or a sampling one"
        raise ProblemError(next(iter(asked)), expected, repr(planner))
    if "on_improved" in asked and not callable(asked["on_improved"]):
        raise ProblemError("on_improved", "a callable", repr(asked["on_improved"]))
    check_cancel(asked.get("cancel"))
    return asked


def _engine_3d(space: Voxels, planner: str) -> AStar3D:
    if planner not in SPATIAL:
        expected = f"one that plans on 3-D maps: {', '.join(SPATIAL)}, or a sampling one"
        raise ProblemError("planner", expected, repr(planner))
    return AStar3D(space)
