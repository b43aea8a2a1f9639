"""The last check of outlines that turn with the robot, by code that no planner uses: shapely."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Floats
from planners.audit.obstacles import TOLERANCE
from planners.errors import AuditError

MITRE = 5.0  # [bulges] sharp corners of grown areas are cut off at this distance


class SweptHulls(NamedTuple):
    """Convex areas which, once grown, hold everything that a polygon covers between its poses."""

    hulls: npt.NDArray[np.object_]  #: shape (n,): of a convex part at two consecutive poses
    bulges: Floats  #: shape (n,): how far a turn moves a corner out of its hull [m]


class SweptObstacles(NamedTuple):
    """Areas that a polygon must not enter."""

    areas: npt.NDArray[np.object_]  #: shape (n,): polygons of shapely [m, map]
    name: Callable[[int], str]  #: what one is called in messages, by its index


def swept_audit(
    polygon: Floats,
    waypoints: Floats,
    headings: Floats,
    obstacles: SweptObstacles,
    tolerance: float,
) -> None:
    """Check that a polygon, moved along poses, enters no obstacle.

    Parameters
    ----------
    polygon : ndarray, shape (n, 2) [m, base_link]
    waypoints : ndarray, shape (m, 2) [m, map]
    headings : ndarray, shape (m,) [rad, map]
    obstacles : SweptObstacles
    tolerance : float [m]
        Overlap that is attributed to rounding.

    Raises
    ------
    AuditError
    """
    squares = obstacles.areas
    swept = swept_hulls(polygon, waypoints, headings)
    # Growing hulls takes most of the time, so only those near a square are grown. A mitre that is
    # cut off ends in an edge, whose ends are farther out than its middle.
    reach = (MITRE + 1.0) * swept.bulges
    hull, square = shapely.STRtree(squares).query(swept.hulls, predicate="dwithin", distance=reach)
    hulls, bulges = swept.hulls[hull], swept.bulges[hull]
    grown = shapely.buffer(hulls, bulges, join_style="mitre", mitre_limit=MITRE)
    areas = shapely.union(hulls, grown)  # growing by a rounding error may return an empty area
    shrunk = shapely.buffer(squares[square], -tolerance, join_style="mitre")
    hits = np.flatnonzero(shapely.intersects(areas, shrunk))
    if hits.size:
        hit = hits[0]
        overlap = shapely.intersection(areas[hit], shrunk[hit])
        place = tuple(shapely.get_coordinates(shapely.point_on_surface(overlap))[0].tolist())
        fault = f"sweeps {obstacles.name(square[hit])}"
        covered = float(shapely.area(overlap))
        raise AuditError(fault, place, got=covered, needed=0.0, unit="m²")


def swept_hulls(polygon: Floats, waypoints: Floats, headings: Floats) -> SweptHulls:
    """Return convex areas which, once grown, hold everything a polygon covers between its poses.

    Each is the hull of a convex part at two consecutive poses. It has to be grown by the distance
    that a turn moves a corner out of the straight line between its two places.

    Parameters
    ----------
    polygon : ndarray, shape (n, 2) [m, base_link]
    waypoints : ndarray, shape (m, 2) [m, map]
    headings : ndarray, shape (m,) [rad, map]

    Returns
    -------
    SweptHulls
        With parts · (m - 1) hulls.
    """
    outline = shapely.Polygon(polygon)
    convex = outline.convex_hull.area - outline.area <= TOLERANCE**2
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(outline))
    cos, sin = np.cos(headings), np.sin(headings)
    rotations = np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1)
    turns = np.abs(np.angle(np.exp(1j * np.diff(headings))))
    bulges = np.hypot(*polygon.T).max() * (1.0 - np.cos(turns / 2.0))
    hulls = []
    for part in [outline] if convex else triangles:
        corners = shapely.get_coordinates(part)[:-1]
        placed = np.einsum("mij,nj->mni", rotations, corners) + waypoints[:, None]
        pairs = np.concatenate([placed[:-1], placed[1:]], axis=1)
        hulls.append(shapely.convex_hull(shapely.linestrings(pairs)))
    return SweptHulls(np.concatenate(hulls), np.tile(bulges, len(hulls)))
