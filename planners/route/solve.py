"""From an engine to a route: ends are checked, reasons are given, routes are audited."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeVar

from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import check_space
from planners.costmap.voxel_map import Voxels
from planners.error_messages import Place
from planners.errors import AuditError, ProblemError
from planners.no_route import explain_enclosure, explain_enclosure_3d
from planners.problem.problem import PlanningProblem, Pose
from planners.route.build import build_route
from planners.route.route import Route
from planners.search.astar3d import AStar3D
from planners.search.base import Engine, clock_from, now

SpaceT = TypeVar("SpaceT", bound=Costmap | Voxels)


def solve(
    space: Costmap | Voxels,
    engine: Engine | AStar3D,
    settings: Any,
    *,
    began: float,
    headings: bool = False,
    audited: bool = True,
    watch: dict[str, Any] | None = None,
) -> Route:
    """Return the engine's route for the problem of a space, or raise why there is none.

    Parameters
    ----------
    space : Costmap or Voxels
        Of the problem; the engine was made on its cells.
    engine : Engine
    settings : Settings
        The engine's.
    began : float [s]
        When the work for this route began, by `planners.search.base.now`: the time limit counts
        from then.
    headings : bool, default False
        Whether the planner heeds headings, so that an outline is turned with the robot.
    audited : bool, default True
    watch : dict, optional
        What an anytime engine's search is given besides: "on_improved", "cancel".

    Raises
    ------
    ProblemError
        A start or a goal without a yaw, for a planner that heeds headings.
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
        if isinstance(space, Voxels):
            raise explain_enclosure_3d(space)
        raise explain_enclosure(
            space, needed=2.0 * problem.shape.inscribed_radius if headings else None
        )
    if result.goal is not None:
        axes = problem.grid.ndim
        if audited and not settings.accepts_end(result.goal, goal, axes=axes):
            off = math.dist(result.goal[:axes], goal[:axes])
            raise AuditError("ends at no goal", result.goal[:axes], got=off, needed=0.0)
        space = with_problem(
            space, replace(problem, goal=result.goal, cleared_at=problem.clear_place)
        )
    seconds = now() - began
    return build_route(space, result, planner=engine.name, seconds=seconds, audited=audited)


def with_problem(space: SpaceT, problem: PlanningProblem) -> SpaceT:
    """Return the space of another query, with all that was worked out about the map."""
    twin = replace(space, problem=problem)
    vars(twin).update(vars(space) | {"problem": problem})
    return twin
