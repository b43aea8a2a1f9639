"""What can be driven on: a pure function of the map and the problem."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.window import CellState, GridWindow
from planners.errors import ProblemError
from planners.kernels.clearance import line_clearance
from planners.lattice import NOWHERE, allowed_moves, squared_clearance, squared_need
from planners.problem import PlanningProblem

MOST_CELLS = 2**25  # of a costmap: its lattice takes about 100 bytes for each
SLACK = 5e-10  # [m] shortfall of clearance that is put down to the rounding of coordinates


@dataclass(frozen=True, eq=False)
class Costmap:
    """Which cells are blocked, how far away they are, and which moves that allows.

    Attributes
    ----------
    problem : PlanningProblem
    window : GridWindow
        The touched tiles, and a ring of unknown cells around them and around the cleared start:
        the nearest of all that is unknown outside.
    blocked, nonfree, cleared : ndarray of bool, shape (rows, cols)
        Cells that the footprint may not touch; those among them that are non-free; unknown cells
        that count as free because they are near the start.
    squared : ndarray of int64, shape (2 rows + 1, 2 cols + 1) [(half cells)²]
        Squared clearance on the half-cell lattice.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(9, 9), goal=(60, 60), footprint=1.5)
    >>> costmap = Costmap.of(problem)
    >>> costmap.blocked.shape, float(costmap.clearance.max())
    ((68, 68), 31.5)
    """

    problem: PlanningProblem
    window: GridWindow
    blocked: Bools
    nonfree: Bools
    cleared: Bools
    squared: Ints

    @classmethod
    def of(cls, problem: PlanningProblem) -> Costmap:
        """Return the costmap of a problem whose start is on the map."""
        window = _padded_window(problem)
        states = window.states(epsilon=problem.epsilon)
        nonfree = states == CellState.NONFREE
        cleared = _cleared(problem, window) & (states == CellState.UNKNOWN)
        free = (states == CellState.FREE) | cleared
        blocked = nonfree if problem.unknown == "allow" else ~free
        return cls(problem, window, blocked, nonfree, cleared, squared_clearance(blocked))

    @property
    def width(self) -> int:
        """Cells in a row."""
        return int(self.blocked.shape[1])

    @cached_property
    def clearance(self) -> Floats:
        """Distance from cell centres to the nearest blocked square, shape (rows, cols) [m]."""
        squared = self.squared[1::2, 1::2]
        half = self.window.resolution / 2.0
        return np.where(squared == NOWHERE, np.inf, np.sqrt(squared) * half)

    @cached_property
    def moves(self) -> Bytes:
        """Allowed moves for the footprint, shape (rows, cols)."""
        return self.moves_for(squared_need(self.problem.footprint, self.window.resolution))

    def moves_for(self, need: int) -> Bytes:
        """Return the moves that keep a squared clearance [(half cells)²], shape (rows, cols)."""
        return allowed_moves(self.blocked, self.squared, need)

    def to_cells(self, points: npt.ArrayLike) -> Floats:
        """Return positions [m, map] in cells from the window's outer corner, shape (n, 2)."""
        shifted: Floats = np.atleast_2d(np.asarray(points, dtype=np.float64)) - self.window.origin
        return shifted / self.window.resolution

    def clearance_of(self, points: npt.ArrayLike) -> float:
        """Return the exact distance of a point or a polyline to the nearest blocked square [m].

        Parameters
        ----------
        points : array_like, shape (2,) or (n, 2) [m, map]
        """
        return line_clearance(self.blocked, self.to_cells(points)) * self.window.resolution


def _padded_window(problem: PlanningProblem) -> GridWindow:
    grid = problem.grid
    bounds = grid.bounds()
    if problem.clear_start:
        start = np.array(problem.start_xy)
        bounds[:2] = np.minimum(bounds[:2], start - problem.clear_radius)
        bounds[2:] = np.maximum(bounds[2:], start + problem.clear_radius)
    # One cell and a half: borders that rounding moves by a cell must not swallow the ring.
    ring = 1.5 * grid.resolution * np.array([-1, -1, 1, 1])
    cells = float(np.prod((bounds[2:] - bounds[:2]) / grid.resolution))
    if cells > MOST_CELLS:
        raise ProblemError(
            "footprint",
            f"one that leaves {MOST_CELLS} cells of map and cleared start at most",
            f"radius {problem.footprint:g} m, which makes {cells:.3g}",
            hint="Give a smaller footprint or clear_start_radius, or map with larger cells.",
        )
    return grid.window(bounds + ring)


def _cleared(problem: PlanningProblem, window: GridWindow) -> Bools:
    """Return which cells' squares come within the clear radius of the start."""
    if not problem.clear_start:
        return np.zeros(window.count.shape, dtype=np.bool_)
    rows, cols = window.count.shape
    x, y = (np.array(problem.start_xy) - window.origin) / window.resolution
    col, row = np.arange(cols), np.arange(rows)
    dx = np.maximum(np.maximum(col - x, x - col - 1), 0.0)
    dy = np.maximum(np.maximum(row - y, y - row - 1), 0.0)
    near: Bools = np.hypot(dx, dy[:, None]) * window.resolution <= problem.clear_radius
    return near
