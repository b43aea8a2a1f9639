"""The last check of routes against the polygons of keep-out areas, by code that no planner uses."""

from __future__ import annotations

import numpy as np
import shapely

from groundmap.arrays import Floats
from planners.audit.swept_audit import SweptObstacles, swept_audit
from planners.errors import AuditError
from planners.problem.problem import PlanningProblem


def audit_keep_out(
    problem: PlanningProblem, waypoints: Floats, headings: Floats | None, tolerance: float
) -> None:
    """Check that a route keeps its clearance from the polygons of keep-out areas.

    Parameters
    ----------
    problem : PlanningProblem
    waypoints : ndarray, shape (n, 2), on a 3-D map (n, 3) [m, map]
    headings : ndarray, shape (n,), or None [rad, map]
        From planners that plan headings.
    tolerance : float [m]
        Shortfall, or overlap, that is attributed to rounding.

    Raises
    ------
    AuditError
    """
    areas = np.array(problem.keep_out_areas.areas, dtype=object)
    if len(areas) == 0:
        return
    line = shapely.LineString(waypoints[:, :2])
    near = shapely.dwithin(areas, line, problem.radius + tolerance)
    if not near.any():
        return
    if headings is not None and problem.shape.polygon is not None:
        obstacles = SweptObstacles(areas[near], lambda index: "a keep-out area")
        swept_audit(problem.shape.polygon, waypoints, headings, obstacles, tolerance)
        return
    distances = shapely.distance(areas[near], line)
    # With a radius of 0, a line may run along the border of an area, but not inside.
    entered = shapely.intersects(shapely.buffer(areas[near], -2.0 * tolerance), line)
    wrong = (distances < problem.radius - tolerance) | entered
    if wrong.any():
        worst = int(np.where(wrong, distances, np.inf).argmin())
        place = shapely.get_coordinates(shapely.shortest_line(line, areas[near][worst]))[0]
        fault = "comes too close to a keep-out area"
        got, needed = float(distances[worst]), problem.radius
        raise AuditError(fault, tuple(place.tolist()), got=got, needed=needed)
