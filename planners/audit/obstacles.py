"""The cells near a route that the footprint must not touch, read from the map itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats
from groundmap.grid.window import CellState
from planners.audit.boxes import gaps, lengths
from planners.problem.problem import PlanningProblem

TOLERANCE = 1e-9  # [m]
PIECE = 16  # [cells] longest piece of the line whose surroundings are read as one box

NAMES = {
    CellState.NONFREE: "a non-free cell",
    CellState.UNKNOWN: "an unknown cell",
    CellState.CONTESTED: "a contested cell",
}


class Obstacles(NamedTuple):
    """Cells that the footprint must not touch: squares, on a 3-D map cubes."""

    lower: Floats  #: shape (n, d) [m, map]: lower corners
    upper: Floats  #: shape (n, d) [m, map]: upper corners
    states: Bytes  #: shape (n,)

    def name(self, index: int) -> str:
        """Return what a cell is called in messages."""
        return NAMES[CellState(int(self.states[index]))]


def pieces_of(waypoints: Floats, longest: float) -> tuple[Floats, Floats]:
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

    These are the non-free cells and, where the problem avoids unknown space, the unknown and
    contested ones, including everything outside the map and excluding unknown cells near the start
    that `PlanningProblem.clear_start` clears.

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
    cells = np.argwhere(near & (states != CellState.FREE))
    lower = window.origin + cells[:, ::-1] * window.resolution
    upper = window.origin + (cells[:, ::-1] + 1) * window.resolution
    obstacles = Obstacles(lower, upper, states[tuple(cells.T)])
    kept = _forbidden(problem, obstacles, tolerance)
    return Obstacles(lower[kept], upper[kept], obstacles.states[kept])


def _forbidden(problem: PlanningProblem, cells: Obstacles, tolerance: float) -> Bools:
    """Return which cells that are not free the footprint must not touch."""
    if not problem.avoids_unknown:
        nonfree: Bools = cells.states == CellState.NONFREE
        return nonfree
    if not problem.clear_start:
        return np.ones(len(cells.states), dtype=np.bool_)
    away = lengths(gaps(np.array(problem.clear_place), cells.lower, cells.upper))
    cleared = (cells.states == CellState.UNKNOWN) & (away <= problem.clear_radius + tolerance)
    forbidden: Bools = ~cleared
    return forbidden
