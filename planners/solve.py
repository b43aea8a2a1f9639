"""From an engine to a route: ends are checked, reasons are given, routes are audited."""

from __future__ import annotations

import time
from typing import Any

from planners.answers import answer, check_space
from planners.astar3d import AStar3D
from planners.costmap import Costmap
from planners.enclosure import enclosed
from planners.enclosure3d import enclosed_3d
from planners.engine import Engine, Pose
from planners.errors import ProblemError
from planners.route import Route
from planners.voxels import Voxels
from planners.wording import Place


def solve(
    space: Costmap | Voxels,
    engine: Engine | AStar3D,
    settings: Any,
    *,
    began: float,
    headings: bool = False,
    audited: bool = True,
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
        When the work for this route began, by `time.perf_counter`.
    headings : bool, default False
        Whether the planner heeds headings, so that an outline is turned with the robot.
    audited : bool, default True

    Raises
    ------
    ProblemError
        A start or a goal without a yaw, for a planner that heeds headings.
    NonFreeError, UnknownSpaceError, EnclosedError, TimeLimitError
    """
    problem = space.problem
    start, goal = tuple(map(float, problem.start)), tuple(map(float, problem.goal))
    places: tuple[tuple[Place, Pose], ...] = ("start", start), ("goal", goal)
    for place, pose in places:
        if headings and len(pose) == 2:
            expected = f"x, y [m] and yaw [rad] for {engine.name}"
            raise ProblemError(place, expected, str(pose))
        check_space(space, place, pose, headings=headings)
    found = engine.search(start, goal, settings)
    if found is None:
        if isinstance(space, Voxels):
            raise enclosed_3d(space)
        raise enclosed(space, needed=2.0 * problem.shape.inscribed_radius if headings else None)
    seconds = time.perf_counter() - began
    return answer(space, found, planner=engine.name, seconds=seconds, audited=audited)
