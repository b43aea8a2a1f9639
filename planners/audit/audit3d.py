"""The last check of every 3-D route, by code that no planner uses: NumPy on the map itself."""

from __future__ import annotations

from itertools import pairwise
from typing import TypeAlias

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats
from groundmap.grid.window import CellState, GridWindow
from planners.errors import AuditError
from planners.problem.problem import PlanningProblem

Piece: TypeAlias = tuple[Floats, Floats]  #: its ends, each of shape (3,) [m, map]

TOLERANCE = 1e-9  # [m]
PIECE = 16  # [voxels] the line is cut into pieces of that length, to look at few voxels around it


def audit3d(problem: PlanningProblem, waypoints: Floats) -> None:
    """Check that a route joins start and goal and keeps its distance everywhere.

    The distance of the line to the cube of every voxel that the footprint must not touch is at
    least the footprint's radius, up to a nanometre, and the line enters no such cube. These voxels
    are those that `planners.audit.audit.audit` calls so in the plane.

    Parameters
    ----------
    problem : PlanningProblem
        On a 3-D map.
    waypoints : ndarray, shape (n, 3), n >= 2 [m, map]

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
    >>> audit3d(problem, np.array([problem.start, problem.goal]))
    Traceback (most recent call last):
        ...
    planners.errors.AuditError: audit: the route comes too near to nonfree space (z 6.00 m) at \
(4.00, 4.50): expected 1.5 m, got 1 m.
    """
    _check_ends(problem, waypoints)
    tolerance = TOLERANCE + 4.0 * float(np.spacing(np.abs(waypoints).max()))
    reach = problem.radius + 2.0 * problem.grid.resolution
    corners = [waypoints.min(axis=0) - reach, waypoints.max(axis=0) + reach]
    window = problem.grid.window(np.concatenate(corners))
    states = window.states(epsilon=problem.epsilon)
    for piece in _pieces(waypoints, PIECE * window.resolution):
        _check_piece(problem, window, states, piece, tolerance=tolerance)


def segment_boxes(a: Floats, b: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return how far boxes are from a segment, and where on the segment that is.

    The squared distance is convex and quadratic between the parameters at which a coordinate
    passes a box's border; its slope is linear there. So the two of these between which the slope
    changes sign give the minimum by interpolation.

    Parameters
    ----------
    a, b : ndarray, shape (3,)
        The segment's ends.
    lower, upper : ndarray, shape (n, 3)
        The boxes' corners.

    Returns
    -------
    ndarray, shape (n,)
        Distances.
    ndarray, shape (n, 3)
        The points of the segment.

    Examples
    --------
    >>> box = np.array([[0.0, 0.0, 0.0]]), np.array([[1.0, 1.0, 1.0]])
    >>> distance, nearest = segment_boxes(np.array([0.0, 3, 0.5]), np.array([3.0, 0, 0.5]), *box)
    >>> distance.round(3).tolist(), nearest.tolist()
    ([0.707], [[1.5, 1.5, 0.5]])
    """
    step = b - a
    moving = step != 0
    kinks = [np.zeros((len(lower), 1)), np.ones((len(lower), 1))]
    for borders in (lower, upper):
        kinks.append(np.clip((borders - a)[:, moving] / step[moving], 0.0, 1.0))
    t = np.sort(np.concatenate(kinks, axis=1), axis=1)
    slope = _gaps(a + t[..., None] * step, lower[:, None], upper[:, None]) @ step
    last = np.maximum((slope < 0).sum(axis=1), 1)  # the slope grows along t
    first = last - 1
    boxes = np.arange(len(lower))
    last = np.minimum(last, t.shape[1] - 1)
    before, after = slope[boxes, first], slope[boxes, last]
    share = np.divide(-before, after - before, out=np.zeros_like(before), where=after > before)
    share = np.clip(share, 0.0, 1.0)
    best = t[boxes, first] + share * (t[boxes, last] - t[boxes, first])
    nearest = a + best[:, None] * step
    distance: Floats = np.sqrt((_gaps(nearest, lower, upper) ** 2).sum(axis=1))
    return distance, nearest


def _gaps(points: Floats, lower: Floats, upper: Floats) -> Floats:
    """Return how far coordinates are beyond intervals: negative below them."""
    gaps: Floats = np.minimum(points - lower, 0.0) + np.maximum(points - upper, 0.0)
    return gaps


def _check_ends(problem: PlanningProblem, waypoints: Floats) -> None:
    start, goal = problem.start_xy, problem.goal_xy
    if not np.isfinite(waypoints).all():
        raise AuditError("is not finite", start, got=np.nan, needed=0.0)
    for name, xy, asked, got in (
        ("start", start, problem.start[:3], waypoints[0]),
        ("goal", goal, problem.goal[:3], waypoints[-1]),
    ):
        off = float(np.linalg.norm(got - np.array(asked)))
        if off > TOLERANCE:
            raise AuditError(f"misses the {name}", xy, got=off, needed=0.0)


def _pieces(waypoints: Floats, longest: float) -> list[Piece]:
    pieces: list[Piece] = []
    for a, b in pairwise(waypoints):
        count = max(1, int(np.ceil(np.abs(b - a).max() / longest)))
        pieces += pairwise(a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a))
    return pieces


def _check_piece(
    problem: PlanningProblem,
    window: GridWindow,
    states: Bytes,
    piece: Piece,
    *,
    tolerance: float,
) -> None:
    a, b = piece
    reach = problem.radius + window.resolution
    first = np.maximum(window.world_to_cell(np.minimum(a, b) - reach)[0], 0)
    last = window.world_to_cell(np.maximum(a, b) + reach)[0]
    part = states[tuple(map(slice, first, last + 1))]
    voxels = np.argwhere(part != CellState.FREE)
    kinds = part[tuple(voxels.T)]
    lower = window.origin + (voxels + first)[:, ::-1] * window.resolution
    forbidden = _forbidden(problem, kinds, lower, lower + window.resolution, tolerance)
    kinds, lower = kinds[forbidden], lower[forbidden]
    upper = lower + window.resolution
    distance, nearest = segment_boxes(a, b, lower, upper)
    # With a radius of 0, a line may run along a cube's border, but not inside.
    depth, _ = segment_boxes(a, b, lower + 2.0 * tolerance, upper - 2.0 * tolerance)
    wrong = np.flatnonzero((distance < problem.radius - tolerance) | (depth < tolerance))
    if len(wrong):
        worst = wrong[distance[wrong].argmin()]
        x, y, z = nearest[worst].tolist()
        kind = CellState(kinds[worst]).name.lower()
        fault = f"comes too near to {kind} space (z {z:.2f} m)"
        raise AuditError(fault, (x, y), got=float(distance[worst]), needed=problem.radius)


def _forbidden(
    problem: PlanningProblem, kinds: Bytes, lower: Floats, upper: Floats, tolerance: float
) -> Bools:
    if not problem.avoids_unknown:
        nonfree: Bools = kinds == CellState.NONFREE
        return nonfree
    forbidden: Bools = np.ones(len(kinds), dtype=np.bool_)
    if problem.clear_start:
        gaps = _gaps(np.array(problem.clear_place), lower, upper)
        near = np.sqrt((gaps**2).sum(axis=1)) <= problem.clear_radius + tolerance
        forbidden &= ~((kinds == CellState.UNKNOWN) & near)
    return forbidden
