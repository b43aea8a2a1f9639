"""From an engine to a route: ends are checked, reasons are given, routes are audited."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeVar

from planners.answers import answer, check_space
from planners.astar3d import AStar3D
from planners.costmap import Costmap
from planners.enclosure import enclosed
from planners.enclosure3d import enclosed_3d
from planners.engine import Engine, Pose, clock_from, now
from planners.errors import AuditError, ProblemError
from planners.problem import PlanningProblem
from planners.route import Route
from planners.voxels import Voxels
from planners.wording import Place

MapSpace = TypeVar("MapSpace", bound=Costmap | Voxels)


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
        When the work for this route began, by `planners.engine.now`: the time limit counts from
        then.
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
        found = engine.search(start, goal, settings, **(watch or {}))
    if found is None:
        if isinstance(space, Voxels):
            raise enclosed_3d(space)
        raise enclosed(space, needed=2.0 * problem.shape.inscribed_radius if headings else None)
    if found.goal is not None:
        axes = problem.grid.ndim
        if audited and not settings.will_do(found.goal, goal, axes=axes):
            off = math.dist(found.goal[:axes], goal[:axes])
            raise AuditError("ends at no goal", found.goal[:axes], got=off, needed=0.0)
        space = posed(space, replace(problem, goal=found.goal, cleared_at=problem.clear_place))
    seconds = now() - began
    return answer(space, found, planner=engine.name, seconds=seconds, audited=audited)


def posed(space: MapSpace, problem: PlanningProblem) -> MapSpace:
    """Return the space of another query, with all that was worked out about the map."""
    twin = replace(space, problem=problem)
    vars(twin).update(vars(space) | {"problem": problem})
    return twin
