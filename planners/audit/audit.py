"""The last check of every route, by code that no planner uses: NumPy on the map itself."""

from __future__ import annotations

import math

import numpy as np
import shapely
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.grid.window import CellState, GridWindow
from planners.audit.keep_out_audit import audit_keep_out
from planners.audit.obstacles import (
    KEEP_OUT,
    RECENT,
    TOLERANCE,
    Obstacles,
    gaps,
    lengths,
    segment_boxes,
)
from planners.audit.swept_audit import SweptObstacles, swept_audit
from planners.errors import AuditError
from planners.problem.problem import PlanningProblem

PIECE = 16  # [cells] longest piece of the line whose surroundings are read as one box
MOST_CELLS = 2**22  # that are read as one box, unless a single piece needs more
BATCH = 512  # pieces that are checked at once, which bounds the memory


def audit(problem: PlanningProblem, waypoints: Floats, *, headings: Floats | None = None) -> None:
    """Check that a route joins start and goal and keeps its clearance everywhere.

    The distance from the line to every cell that the footprint must not touch (its square; on a
    3-D map its cube) is at least the footprint's radius, up to a nanometre, and the line enters no
    such cell. `obstacles_near` defines these cells.

    The same holds for the polygons of keep-out areas themselves.

    With headings, a polygon footprint is swept along the poses instead of the disc around it, and
    must not enter such a cell by more than a nanometre.

    Parameters
    ----------
    problem : PlanningProblem
    waypoints : ndarray, shape (n, 2), on a 3-D map (n, 3), n >= 2 [m, map]
    headings : ndarray, shape (n,), optional [rad, map]
        From planners that plan headings.

    Raises
    ------
    AuditError

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=1.0, origin=(0, 0, 0))
    >>> z = np.full((16, 16, 16), -1.0, dtype=np.float32)
    >>> z[4, 4, 4] = 1.0
    >>> grid.fuse(np.array([0, 0, 0]), z)
    >>> problem = PlanningProblem(grid, start=(2, 4.5, 6), goal=(8, 4.5, 6), footprint=1.5)
    >>> audit(problem, np.array([problem.start, problem.goal]))
    Traceback (most recent call last):
        ...
    planners.errors.AuditError: audit: the route comes too close to a non-free cell at \
(4.00, 4.50, 6.00): expected 1.5 m, got 1 m.
    """
    _check_ends(problem, waypoints, headings)
    tolerance = TOLERANCE + 4.0 * float(np.spacing(np.abs(waypoints).max()))
    pieces = _pieces_of(waypoints, PIECE * problem.grid.resolution)
    audit_keep_out(problem, waypoints, headings, tolerance)
    obstacles = obstacles_near(problem, pieces, tolerance)
    if len(obstacles.states) == 0:
        return
    if headings is None or problem.shape.polygon is None:
        _check_distance(problem.radius, pieces, obstacles, tolerance)
    else:
        squares = shapely.box(*obstacles.lower.T, *obstacles.upper.T)
        areas = SweptObstacles(squares, obstacles.name)
        swept_audit(problem.shape.polygon, waypoints, headings, areas, tolerance)


def _check_ends(problem: PlanningProblem, waypoints: Floats, headings: Floats | None) -> None:
    if not (np.isfinite(waypoints).all() and (headings is None or np.isfinite(headings).all())):
        raise AuditError("is not finite", problem.start_xy, got=np.nan, needed=0.0)
    for name, pose, end in (("start", problem.start, 0), ("goal", problem.goal, -1)):
        place, axes = tuple(waypoints[end].tolist()), waypoints.shape[1]
        off = math.dist(place, pose[:axes])
        if off > TOLERANCE:
            raise AuditError(f"misses the {name}", place, got=off, needed=0.0)
        if headings is not None and len(pose) > axes:
            off = abs(math.remainder(float(headings[end]) - float(pose[axes]), math.tau))
            if off > TOLERANCE:
                fault = f"misses the yaw of the {name}"
                raise AuditError(fault, place, got=off, needed=0.0, unit="rad")


def _check_distance(
    radius: float, pieces: tuple[Floats, Floats], obstacles: Obstacles, tolerance: float
) -> None:
    a, b = pieces
    size = obstacles.upper[0] - obstacles.lower[0]
    tree = cKDTree((obstacles.lower + obstacles.upper) / 2.0)
    reach = lengths(b - a) / 2.0 + radius + float(lengths(size)) / 2.0 + tolerance
    for begin in range(0, len(a), BATCH):
        batch = slice(begin, begin + BATCH)
        near = tree.query_ball_point((a[batch] + b[batch]) / 2.0, reach[batch])
        piece = begin + np.repeat(np.arange(len(near)), [len(cells) for cells in near])
        cell = np.concatenate(near).astype(np.int64)
        _check_pairs(radius, (a[piece], b[piece]), obstacles, cell, tolerance)


def _check_pairs(
    radius: float, ends: tuple[Floats, Floats], obstacles: Obstacles, cell: Ints, tolerance: float
) -> None:
    """Check the distance from each piece to its cell, given by the cell's index."""
    a, b = ends
    lower, upper = obstacles.lower[cell], obstacles.upper[cell]
    distance, nearest = segment_boxes(a, b, lower, upper)
    wrong = distance < radius - tolerance
    # With a radius of 0, a line may run along the border of a cell, but not inside.
    touch = np.flatnonzero(distance <= tolerance)
    shrunk = lower[touch] + 2.0 * tolerance, upper[touch] - 2.0 * tolerance
    wrong[touch] |= segment_boxes(a[touch], b[touch], *shrunk)[0] < tolerance
    if wrong.any():
        worst = int(np.where(wrong, distance, np.inf).argmin())
        fault = f"comes too close to {obstacles.name(cell[worst])}"
        place = tuple(nearest[worst].tolist())
        raise AuditError(fault, place, got=float(distance[worst]), needed=radius)


def _pieces_of(waypoints: Floats, longest: float) -> tuple[Floats, Floats]:
    """Return the two ends of straight pieces that together are the line, each of shape (k, d).

    Parameters
    ----------
    waypoints : ndarray, shape (n, d), n >= 2 [m, map]
    longest : float [m]
        Largest extent of a piece along any axis.
    """
    steps = np.diff(waypoints, axis=0)
    counts = np.maximum(1, np.ceil(np.abs(steps).max(axis=1) / longest)).astype(np.int64)
    leg = np.repeat(np.arange(len(steps)), counts)
    nth = np.arange(len(leg)) - np.repeat(np.cumsum(counts) - counts, counts)
    shares = np.column_stack([nth, nth + 1]) / counts[leg, None]
    begin, end = (waypoints[leg] + share[:, None] * steps[leg] for share in shares.T)
    end[shares[:, 1] == 1.0] = waypoints[1:]
    return begin, end


def obstacles_near(
    problem: PlanningProblem, pieces: tuple[Floats, Floats], tolerance: float
) -> Obstacles:
    """Return the cells within reach of the footprint along a line that it must not touch.

    A cell near several parts of a long line may be returned more than once.

    These are the non-free cells, those that the newest views saw as non-free, those that are kept
    out and, where the problem avoids unknown space, the unknown and contested ones, including
    everything outside the map and excluding unknown cells near the start that
    `PlanningProblem.clear_start` clears.

    Parameters
    ----------
    problem : PlanningProblem
    pieces : tuple of ndarray, each of shape (k, d) [m, map]
        Ends of the line's pieces.
    tolerance : float [m]
        Added to the radius of the cleared area.
    """
    low, high = np.minimum(*pieces), np.maximum(*pieces)
    reach = problem.radius + 2.0 * problem.grid.resolution
    sides = high.max(axis=0) - low.min(axis=0) + 2.0 * reach
    if len(low) > 1 and np.prod(sides / problem.grid.resolution) > MOST_CELLS:
        halves = zip(*(np.array_split(ends, 2) for ends in pieces), strict=True)
        parts = [obstacles_near(problem, half, tolerance) for half in halves]
        return Obstacles(*map(np.concatenate, zip(*parts, strict=True)))
    window = problem.grid.window(
        np.concatenate([low.min(axis=0) - reach, high.max(axis=0) + reach])
    )
    first = np.maximum(window.world_to_cell(low - reach), 0)
    boxes = np.column_stack([first, window.world_to_cell(high + reach) + 1])
    differ = np.append(True, (np.diff(boxes, axis=0) != 0).any(axis=1))  # waypoints may be dense
    near = np.zeros(window.count.shape, dtype=np.bool_)
    for box in boxes[differ].reshape(-1, 2, near.ndim):
        near[tuple(map(slice, *box.tolist()))] = True
    states = window.states(epsilon=problem.epsilon)
    _impose(problem, window, states)
    cells = np.argwhere(near & (states != CellState.FREE))
    lower = window.origin + cells[:, ::-1] * window.resolution
    upper = window.origin + (cells[:, ::-1] + 1) * window.resolution
    obstacles = Obstacles(lower, upper, states[tuple(cells.T)])
    kept = _forbidden(problem, obstacles, tolerance)
    return Obstacles(lower[kept], upper[kept], obstacles.states[kept])


def _impose(problem: PlanningProblem, window: GridWindow, states: Bytes) -> None:
    """Mark the cells that are not to be entered whatever the map says, in place."""
    for which, state in ((problem.recent_set, RECENT), (problem.keep_out_areas.cells, KEEP_OUT)):
        if len(which):
            cells = window.world_to_cell(which.centres())
            states[tuple(cells[window.contains(cells)].T)] = state


def _forbidden(problem: PlanningProblem, cells: Obstacles, tolerance: float) -> Bools:
    """Return which cells that are not free the footprint must not touch."""
    if not problem.avoids_unknown:
        return np.isin(cells.states, (CellState.NONFREE, RECENT, KEEP_OUT))
    if not problem.clear_start:
        return np.ones(len(cells.states), dtype=np.bool_)
    away = lengths(gaps(np.array(problem.clear_place), cells.lower, cells.upper))
    cleared = (cells.states == CellState.UNKNOWN) & (away <= problem.clear_radius + tolerance)
    forbidden: Bools = ~cleared
    return forbidden
