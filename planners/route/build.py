"""From a search's result to a route that the audit passed."""

from __future__ import annotations

from dataclasses import replace

from planners.audit.audit import audit
from planners.audit.audit3d import audit3d
from planners.costmap.costmap import Costmap
from planners.costmap.voxel_map import Voxels
from planners.route.route import Route
from planners.search.base import SearchResult


def build_route(
    space: Costmap | Voxels,
    result: SearchResult,
    *,
    planner: str,
    seconds: float,
    audited: bool = True,
) -> Route:
    """Return what a planner found as a route that the audit passed.

    Raises
    ------
    AuditError
        It keeps not what was asked: a bug in the planner.
    """
    if audited and space.problem.grid.ndim == 3:
        audit3d(space.problem, result.waypoints)
    elif audited:
        audit(space.problem, result.waypoints, headings=result.headings)
    route = Route.along(space, result, planner=planner, seconds=seconds)
    return route if audited else replace(route, audit="skipped")
