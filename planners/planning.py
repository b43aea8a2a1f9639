"""`plan`: from a problem and the name of a planner to an audited route."""

from __future__ import annotations

from typing import Any

from planners.costmap.endpoint_check import check_on_map, space_of
from planners.errors import ProblemError
from planners.problem.problem import PlanningProblem
from planners.registry import Planner, get_planner, make_engine
from planners.route.route import Route
from planners.route.solve import solve
from planners.search.base import Cancel, OnImproved, check_cancel, now


def plan(
    problem: PlanningProblem,
    planner: str = "astar",
    *,
    on_improved: OnImproved | None = None,
    cancel: Cancel | None = None,
    **settings: Any,
) -> Route:
    """Return an audited route, or raise an exception with the reason why there is none.

    Parameters
    ----------
    problem : PlanningProblem
    planner : str, default "astar"
        A name in `PLANNERS`.
    on_improved : callable, optional
        Called with an `Improvement` for the first route and every better one during the search.
        If it returns True, it is not called again and the search ends. Only supported by "ara" and
        sampling planners.
    cancel : Cancel, optional
        Such as a `threading.Event`: once another thread sets it, the search ends with the best
        route so far. Only supported by "ara" and sampling planners.
    **settings
        The planner's settings, such as `planners.AStarSettings`.

    Raises
    ------
    ProblemError
        No planner of that name, or one that does not support an option.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).
    OutsideMapError, NonFreeError, UnknownSpaceError
        The footprint does not fit at the start or the goal.
    EnclosedError
        No route connects them.
    TimeLimitError
        Time ran out.
    CancelledError
        The search was cancelled before a route was found.
    UnsolvedError
        A sampling planner ended without a route.
    AuditError
        The route violates the requested clearance or endpoints: a bug in the planner.

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
    engine = make_engine(space, planner)
    headings = entry.headings and chosen.uses_headings(problem)
    return solve(space, engine, chosen, began=began, headings=headings, watch=watch)


def _watch(planner: str, entry: Planner, **watch: Any) -> dict[str, Any]:
    """Return the options of the search of an anytime planner; others have none."""
    options = {name: value for name, value in watch.items() if value is not None}
    if options and not entry.anytime:
        expected = "no such option, or an anytime planner: 'ara' or a sampling planner"
        raise ProblemError(next(iter(options)), expected, repr(planner))
    if "on_improved" in options and not callable(options["on_improved"]):
        raise ProblemError("on_improved", "a callable", repr(options["on_improved"]))
    check_cancel(options.get("cancel"))
    return options
