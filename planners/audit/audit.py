"""The last check of every route, by code that no planner uses: shapely on the map itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.grid.window import CellState, GridWindow
from planners.errors import AuditError
from planners.problem.problem import PlanningProblem

TOLERANCE = 1e-9  # [m]
PIECE = 16  # [cells] the line is cut into pieces of that length, to look at few cells around it
MITRE = 5.0  # [bulges] sharp corners of grown areas are cut off that far out


class Swept(NamedTuple):
    """What holds all that a polygon covers between each two poses, once it is grown."""

    hulls: npt.NDArray[np.object_]  #: shape (n,): of a convex part's places at either pose
    bulges: Floats  #: shape (n,): by how much a turn makes a corner bulge out of that [m]


def audit(problem: PlanningProblem, waypoints: Floats, *, headings: Floats | None = None) -> None:
    """Check that a route joins start and goal and keeps its distance everywhere.

    The distance of the line to the square of every cell that the footprint must not touch is at
    least the footprint's radius, up to a nanometre, and the line enters no such square. These
    cells are the non-free ones and, unless the problem allows them, the unknown and contested
    ones, all that lies outside the map included, apart from unknown ones near the start.

    With headings, a polygon footprint is swept along the poses instead of the disc around it: it
    enters no such square, up to a nanometre.

    Parameters
    ----------
    problem : PlanningProblem
    waypoints : ndarray, shape (n, 2), n >= 2 [m, map]
    headings : ndarray, shape (n,), optional [rad, map]
        From planners that decide on them.

    Raises
    ------
    AuditError
    """
    _check_ends(problem, waypoints, headings)
    line = _line(waypoints)
    tolerance = TOLERANCE + 4.0 * float(np.spacing(np.abs(waypoints).max()))
    reach = problem.radius + 2.0 * problem.grid.resolution
    low, high = waypoints.min(axis=0) - reach, waypoints.max(axis=0) + reach
    window = problem.grid.window(np.concatenate([low, high]))
    cells = _cells_near(window, line, reach)
    states = window.states(epsilon=problem.epsilon)[tuple(cells.T)]
    cells, states = cells[states != CellState.FREE], states[states != CellState.FREE]
    squares = _squares(window, cells)
    forbidden = _forbidden(problem, states, squares, tolerance)
    squares, states = squares[forbidden], states[forbidden]
    if headings is None or problem.shape.polygon is None:
        _check_distance(problem.radius, line, squares, states, tolerance)
    else:
        swept = swept_hulls(problem.shape.polygon, waypoints, headings)
        _check_swept(swept, squares, states, tolerance)


def swept_hulls(polygon: Floats, waypoints: Floats, headings: Floats) -> Swept:
    """Return what holds all that a polygon covers between each two poses.

    Of each convex part, the hull of its two places, to be grown by as much as a turn makes a
    corner bulge out of a straight piece.

    Parameters
    ----------
    polygon : ndarray, shape (n, 2) [m, base_link]
    waypoints : ndarray, shape (m, 2) [m, map]
    headings : ndarray, shape (m,) [rad, map]

    Returns
    -------
    Swept
        Of parts · (m - 1) hulls.
    """
    outline = shapely.Polygon(polygon)
    convex = outline.convex_hull.area - outline.area <= TOLERANCE**2
    parts = [outline] if convex else outline_parts(outline)
    cos, sin = np.cos(headings), np.sin(headings)
    turns = np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1)
    turned = np.abs(np.angle(np.exp(1j * np.diff(headings))))
    bulges = np.hypot(*polygon.T).max() * (1.0 - np.cos(turned / 2.0))
    hulls = []
    for part in parts:
        corners = shapely.get_coordinates(part)[:-1]
        placed = np.einsum("mij,nj->mni", turns, corners) + waypoints[:, None]
        pairs = np.concatenate([placed[:-1], placed[1:]], axis=1)
        hulls.append(shapely.convex_hull(shapely.linestrings(pairs)))
    return Swept(np.concatenate(hulls), np.tile(bulges, len(parts)))


def outline_parts(outline: shapely.Polygon) -> list[shapely.Geometry]:
    """Return triangles that make up a polygon."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(outline))
    return list(triangles)


def _check_ends(problem: PlanningProblem, waypoints: Floats, headings: Floats | None) -> None:
    turns = np.zeros(2) if headings is None else headings
    if not (np.isfinite(waypoints).all() and np.isfinite(turns).all()):
        raise AuditError("is not finite", problem.start_xy, got=np.nan, needed=0.0)
    for name, asked, got in (
        ("start", problem.start_xy, waypoints[0]),
        ("goal", problem.goal_xy, waypoints[-1]),
    ):
        off = float(np.hypot(*(got - asked)))
        if off > TOLERANCE:
            fault = f"misses the {name}"
            raise AuditError(fault, (float(got[0]), float(got[1])), got=off, needed=0.0)
    if headings is not None:
        _check_yaw("start", problem.start, waypoints[0], float(headings[0]))
        _check_yaw("goal", problem.goal, waypoints[-1], float(headings[-1]))


def _check_yaw(name: str, asked: Sequence[float] | Floats, place: Floats, heading: float) -> None:
    if len(asked) > 2:
        off = abs(math.remainder(heading - float(asked[2]), math.tau))
        if off > TOLERANCE:
            xy = (float(place[0]), float(place[1]))
            raise AuditError(f"misses the yaw of the {name}", xy, got=off, needed=0.0, unit="rad")


def _line(waypoints: Floats) -> shapely.Geometry:
    """Return the route as a line; as a point, if it has no length (a line would be invalid)."""
    if (waypoints == waypoints[0]).all():
        return shapely.Point(waypoints[0])
    return shapely.LineString(waypoints)


def _cells_near(window: GridWindow, line: shapely.Geometry, reach: float) -> Ints:
    """Return the cells [row, col] in boxes around the pieces of the line."""
    points = shapely.get_coordinates(shapely.segmentize(line, PIECE * window.resolution))
    count = max(len(points) - 1, 1)
    a, b = points[:count], points[-count:]
    first = np.maximum(window.world_to_cell(np.minimum(a, b) - reach), 0)
    last = window.world_to_cell(np.maximum(a, b) + reach)
    boxes = np.column_stack([first, last + 1])
    fresh = np.append(True, (np.diff(boxes, axis=0) != 0).any(axis=1))  # poses may be dense
    near = np.zeros(window.count.shape, dtype=np.bool_)
    for row, col, end_row, end_col in boxes[fresh].tolist():
        near[row:end_row, col:end_col] = True
    return np.argwhere(near)


def _squares(window: GridWindow, cells: Ints) -> npt.NDArray[np.object_]:
    lower = window.origin + cells[:, ::-1] * window.resolution
    upper = window.origin + (cells[:, ::-1] + 1) * window.resolution
    squares: npt.NDArray[np.object_] = shapely.box(*lower.T, *upper.T)
    return squares


def _forbidden(
    problem: PlanningProblem,
    states: Bytes,
    squares: npt.NDArray[np.object_],
    tolerance: float,
) -> Bools:
    forbidden: Bools = states != CellState.FREE
    if not problem.avoids_unknown:
        forbidden = states == CellState.NONFREE
    elif problem.clear_start:
        away = shapely.distance(shapely.Point(problem.clear_place), squares)
        near = away <= problem.clear_radius + tolerance
        forbidden &= ~((states == CellState.UNKNOWN) & near)
    return forbidden


def _check_distance(
    radius: float,
    line: shapely.Geometry,
    squares: npt.NDArray[np.object_],
    states: Bytes,
    tolerance: float,
) -> None:
    tree = shapely.STRtree(squares)
    for i in tree.query(line, predicate="dwithin", distance=max(radius, tolerance)):
        distance = float(shapely.distance(line, squares[i]))
        # With a radius of 0, a line may run along a square's border, but not inside.
        inside = shapely.buffer(squares[i], -tolerance, join_style="mitre")
        if distance < radius - tolerance or shapely.relate_pattern(line, inside, "T********"):
            nearest = shapely.get_coordinates(shapely.shortest_line(line, squares[i]))[0]
            fault = f"comes too near to a {_name(states[i])} cell"
            place = (float(nearest[0]), float(nearest[1]))
            raise AuditError(fault, place, got=distance, needed=radius)


def _check_swept(
    swept: Swept,
    squares: npt.NDArray[np.object_],
    states: Bytes,
    tolerance: float,
) -> None:
    # To grow hulls takes longest, so only those are grown that may then reach a square. A mitre
    # that is cut off ends in an edge, whose ends are farther out than its middle.
    reach = (MITRE + 1.0) * swept.bulges
    hull, square = shapely.STRtree(squares).query(swept.hulls, predicate="dwithin", distance=reach)
    hulls, bulges = swept.hulls[hull], swept.bulges[hull]
    grown = shapely.buffer(hulls, bulges, join_style="mitre", mitre_limit=MITRE)
    areas = shapely.union(hulls, grown)  # what is grown by a rounding error may come out empty
    shrunk = shapely.buffer(squares[square], -tolerance, join_style="mitre")
    hits = np.flatnonzero(shapely.intersects(areas, shrunk))
    if hits.size:
        hit = hits[0]
        overlap = shapely.intersection(areas[hit], shrunk[hit])
        x, y = shapely.get_coordinates(shapely.point_on_surface(overlap))[0].tolist()
        covered = float(shapely.area(overlap))
        fault = f"sweeps a {_name(states[square[hit]])} cell"
        raise AuditError(fault, (x, y), got=covered, needed=0.0, unit="m²")


def _name(state: np.uint8) -> str:
    return CellState(int(state)).name.lower()
