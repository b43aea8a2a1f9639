"""What can be flown through: the 3-D twin of the costmap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats, Ints, Ints32
from groundmap.grid.window import CellState, GridWindow
from planners.costmap.extent import padded_window
from planners.costmap.layers import near_start
from planners.costmap.moves import squared_need
from planners.errors import ProblemError
from planners.geometry.kernels.clearance3d import line_clearance, segment_clearance
from planners.geometry.rounding import slack_at
from planners.problem.problem import PlanningProblem


@dataclass(frozen=True, eq=False)
class Voxels:
    """Which voxels are blocked, and on whose centres the footprint's centre may be.

    The footprint is a ball.

    Attributes
    ----------
    problem : PlanningProblem
    window : GridWindow
        The touched tiles, and a ring of unknown voxels around them and around the cleared start:
        the nearest of all that is unknown outside.
    blocked, nonfree, cleared : ndarray of bool, shape (layers, rows, cols)
        Voxels that the footprint may not touch; those among them that are non-free; unknown
        voxels that count as free because they are near the start.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    >>> grid.fuse(np.array([0, 0, 0]), np.full((16, 16, 16), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(4, 4, 4), goal=(5, 5, 5), footprint=0.8)
    >>> voxels = Voxels.of(problem)
    >>> voxels.blocked.shape, int(voxels.traversable.sum()), voxels.clearance_of((4, 4, 2))
    ((20, 20, 20), 1728, 2.0)
    """

    problem: PlanningProblem
    window: GridWindow
    blocked: Bools
    nonfree: Bools
    cleared: Bools

    @classmethod
    def of(cls, problem: PlanningProblem) -> Voxels:
        """Return the voxels of a problem on a 3-D map, whose start is on the map.

        Raises
        ------
        ProblemError
            A 2-D map, one that is too large, or costs other than length.
        """
        _check(problem)
        window = padded_window(problem)
        states = window.states(epsilon=problem.epsilon)
        nonfree = states == CellState.NONFREE
        cleared = near_start(problem, window) & (states == CellState.UNKNOWN)
        free = (states == CellState.FREE) | cleared
        blocked = ~free if problem.avoids_unknown else nonfree
        return cls(problem, window, blocked, nonfree, cleared)

    @property
    def radius(self) -> float:
        """Distance that the footprint's centre keeps from what is blocked [m]."""
        return self.problem.radius

    @property
    def slack(self) -> float:
        """Shortfall of the radius that is put down to rounding, on lines from start to goal [m]."""
        return slack_at(self.problem.start_xy, self.problem.goal_xy)

    @cached_property
    def traversable(self) -> Bools:
        """Voxels on whose centre the footprint's centre may be, shape (layers, rows, cols)."""
        need = squared_need(self.radius, self.window.resolution)
        traversable: Bools = ~self.blocked
        if need > 0:
            traversable &= squared_distances(self.blocked, need) >= need
        return traversable

    def clearance_at(self, cells: Ints) -> Floats:
        """Return the clearance of voxel centres [layer, row, col], shape (n,) [m]."""
        centres = cells[:, ::-1] + 0.5
        far = math.inf
        clearance = [segment_clearance(self.blocked, centre, centre, far) for centre in centres]
        return np.array(clearance, dtype=np.float64) * self.window.resolution

    def to_cells(self, points: npt.ArrayLike) -> Floats:
        """Return positions [m, map] in voxels from the window's outer corner, shape (n, 3)."""
        shifted: Floats = np.atleast_2d(np.asarray(points, dtype=np.float64)) - self.window.origin
        return shifted / self.window.resolution

    def clearance_of(
        self, points: npt.ArrayLike, *, to: Bools | None = None, limit: float = math.inf
    ) -> float:
        """Return the exact distance of a point or a polyline to the nearest blocked cube [m].

        Parameters
        ----------
        points : array_like, shape (3,) or (n, 3) [m, map]
        to : ndarray of bool, shape (layers, rows, cols), optional
            Other voxels than the blocked ones.
        limit : float, default inf [m]
            Nothing farther away is looked for.
        """
        mask, size = self.blocked if to is None else to, self.window.resolution
        return line_clearance(mask, self.to_cells(points), limit / size) * size


def squared_distances(blocked: Bools, cap: int) -> Ints32:
    """Return the squared distance of every voxel's centre to the nearest blocked cube.

    Along an axis, a cube k voxels away begins 2 k - 1 half voxels away (0 if k is 0), so squared
    distances are integers, and the transform goes axis by axis. Only what is nearer than the cap
    is looked for: its cost grows with the cap's root.

    Parameters
    ----------
    blocked : ndarray of bool, shape (layers, rows, cols)
    cap : int [(half voxels)²]
        Larger ones are cut to this.

    Returns
    -------
    ndarray of int32, shape (layers, rows, cols) [(half voxels)²]

    Examples
    --------
    >>> squared_distances(np.array([[[True, False, False, False]]]), 10)
    array([[[ 0,  1,  9, 10]]], dtype=int32)
    """
    squared: Ints32 = np.where(blocked, 0, cap).astype(np.int32)
    for axis, length in enumerate(blocked.shape):
        before, after = np.moveaxis(squared.copy(), axis, 0), np.moveaxis(squared, axis, 0)
        for k in range(1, length):
            away = (2 * k - 1) ** 2
            if away >= cap:
                break
            np.minimum(after[k:], before[:-k] + away, out=after[k:])
            np.minimum(after[:-k], before[k:] + away, out=after[:-k])
    return squared


def _check(problem: PlanningProblem) -> None:
    if problem.grid.ndim != 3:
        raise ProblemError("grid", "a 3-D map", f"one of {problem.grid.ndim}-D")
    if problem.unknown == "penalise":
        raise ProblemError("unknown", "'avoid' or 'allow' on a 3-D map", "'penalise'")
    if problem.costs.top(penalise=False) > 0:
        raise ProblemError("costs", "none but length on a 3-D map", repr(problem.costs))
