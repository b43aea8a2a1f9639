"""From a search engine to a route: endpoints are checked, failures explained, routes audited."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from planners.audit.audit import audit
from planners.costmap.endpoint_check import check_space
from planners.costmap.map_space import MapSpace
from planners.error_messages import Place
from planners.errors import AuditError, ProblemError
from planners.no_route import explain_no_route
from planners.problem.problem import Pose
from planners.route.route import Route
from planners.search.base import Engine, SearchResult, clock_from, now


def solve(
    space: MapSpace,
    engine: Engine,
    settings: Any,
    *,
    began: float,
    headings: bool = False,
    audited: bool = True,
    watch: dict[str, Any] | None = None,
) -> Route:
    """Return the engine's route for the problem of a space, or raise the reason for failure.

    Parameters
    ----------
    space : Costmap or Voxels
        Of the problem; the engine searches its cells.
    engine : Engine
    settings : SearchSettings
        The engine's.
    began : float [s]
        When the work for this route began, by `planners.search.base.now`. The time limit counts
        from then.
    headings : bool, default False
        Whether the planner plans headings, so that an outline turns with the robot.
    audited : bool, default True
        Whether the route is audited.
    watch : dict, optional
        Further options of the search of an anytime engine: "on_improved", "cancel".

    Raises
    ------
    ProblemError
        A start or a goal without a yaw, for a planner that plans headings.
    NonFreeError, UnknownSpaceError, EnclosedError, TimeLimitError, CancelledError, UnsolvedError
    AuditError
    """
    problem = space.problem
    start, goal = tuple(map(float, problem.start)), tuple(map(float, problem.goal))
    places: tuple[tuple[Place, Pose], ...] = ("start", start), ("goal", goal)
    for place, pose in places[:1] if settings.takes_other_goals else places:
        if headings and len(pose) == 2:
            expected = f"x, y [m] and yaw [rad] for {engine.name}"
            raise ProblemError(place, expected, str(pose))
        check_space(space, place, pose, headings=headings)
    with clock_from(began):
        result = engine.search(start, goal, settings, **(watch or {}))
    if result is None:
        raise explain_no_route(space, headings=headings)
    if result.goal is not None:
        axes = len(problem.goal_xy)
        if audited and not settings.accepts_end(result.goal, goal, axes=axes):
            off = math.dist(result.goal[:axes], problem.goal_xy)
            raise AuditError("does not end at a goal", result.goal[:axes], got=off, needed=0.0)
        space = space.with_problem(
            replace(problem, goal=result.goal, cleared_at=problem.clear_place)
        )
    seconds = now() - began
    return build_route(space, result, planner=engine.name, seconds=seconds, audited=audited)


def build_route(
    space: MapSpace, result: SearchResult, *, planner: str, seconds: float, audited: bool = True
) -> Route:
    """Return a search result as a route that passed the audit.

    Parameters
    ----------
    space : Costmap or Voxels
    result : SearchResult
    planner : str
        Name of the planner.
    seconds : float [s]
        Time that planning took.
    audited : bool, default True
        Whether the route is audited.

    Raises
    ------
    AuditError
        The result violates the required clearance or the endpoints: a bug in the planner.
    """
    if audited:
        audit(space.problem, result.waypoints, headings=result.headings)
    route = Route.along(space, result, planner=planner, seconds=seconds)
    return route if audited else replace(route, audit="skipped")
