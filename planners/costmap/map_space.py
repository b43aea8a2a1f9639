"""The part of a costmap and of a voxel map that does not depend on the dimension."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Counts, Floats, Floats32, Ints, Ints32
from groundmap.grid.window import CellFrame
from planners.costmap.imposed import keep_out_cells, recent_cells
from planners.costmap.kernels.distance import (
    NOWHERE,
    squared_distances,
    squared_distances_3d,
)
from planners.costmap.layers import metres
from planners.costmap.moves import squared_need
from planners.geometry.kernels import clearance, clearance3d
from planners.geometry.rounding import slack_at
from planners.problem.problem import PlanningProblem

FIRST_REACH = 64  # [cells] initial search distance around cells
SQUARED_DISTANCES = {2: squared_distances, 3: squared_distances_3d}
LINE_CLEARANCE = {2: clearance.line_clearance, 3: clearance3d.line_clearance}


def _segment_clearance_2d(blocked: Bools, a: Floats, b: Floats, limit: float) -> float:
    return float(clearance.segment_clearance(blocked, a[0], a[1], b[0], b[1], limit))


SEGMENT_CLEARANCE: dict[int, Callable[[Bools, Floats, Floats, float], float]] = {
    2: _segment_clearance_2d,
    3: clearance3d.segment_clearance,
}


@dataclass(frozen=True, eq=False)
class MapSpace(ABC):
    """The cells of a map under the rules of a problem: a `Costmap`, or `Voxels` on a 3-D map.

    Attributes
    ----------
    problem : PlanningProblem
    window : GridWindow, or CellBox on a 3-D map
        The observed tiles, surrounded by a ring of unknown cells that also encloses the cleared
        start. The ring stands for all unknown space outside.
    blocked, nonfree, cleared : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
        Cells that the footprint must not touch; the non-free ones among them, with those of
        keep-out areas and those that the newest views saw as non-free; unknown cells that count as
        free because they are near the start.
    """

    problem: PlanningProblem
    window: CellFrame
    blocked: Bools
    nonfree: Bools
    cleared: Bools

    @property
    @abstractmethod
    def traversable(self) -> Bools:
        """Cells on whose centre the footprint's centre may be, shape as `blocked`."""

    @abstractmethod
    def evidence_at(self, cells: Ints) -> tuple[Floats32, Counts]:
        """Return the confidence and the count of cells, given by their indices, shape (n,) each."""

    @property
    @abstractmethod
    def uniform(self) -> bool:
        """Whether all cells have the same cost."""

    @abstractmethod
    def weights_at(self, cells: Ints) -> Floats:
        """Return what a metre costs in cells, given by their indices, shape (n,) [m/m]."""

    @property
    def radius(self) -> float:
        """Distance that the footprint's centre keeps from blocked cells [m]."""
        return self.problem.radius

    @property
    def slack(self) -> float:
        """Shortfall of the radius that is attributed to rounding between start and goal [m]."""
        return slack_at(self.problem.start_xy, self.problem.goal_xy)

    @cached_property
    def kept_out(self) -> Bools | None:
        """Cells that a keep-out area reaches into, shape as `blocked`, or None without any."""
        return keep_out_cells(self.problem, self.window)

    @cached_property
    def recent(self) -> Bools | None:
        """Cells that the newest views saw as non-free, shape as `blocked`, or None without any."""
        return recent_cells(self.problem, self.window)

    @cached_property
    def all_squared(self) -> Ints32:
        """Squared distance from cell centres to the nearest blocked cell [(half cells)²]."""
        return SQUARED_DISTANCES[self.blocked.ndim](self.blocked, NOWHERE)

    @cached_property
    def clearance(self) -> Floats:
        """Distance from cell centres to the nearest blocked cell, shape as `blocked` [m]."""
        return metres(self.all_squared, self.window.resolution)

    def traversable_for(self, radius: float) -> Bools:
        """Return where the centre of a disc or ball of another radius [m] may be."""
        return ~self.blocked & (self.all_squared >= squared_need(radius, self.window.resolution))

    def clearance_at(self, cells: Ints) -> Floats:
        """Return the clearance of the centres of cells, given by their indices, shape (n,) [m]."""
        known = "all_squared" in vars(self)
        squared = self.all_squared[tuple(cells.T)] if known else self._squared_at(cells)
        return metres(squared, self.window.resolution)

    def _squared_at(self, cells: Ints) -> Ints32:
        """Return `all_squared` at cells, computed only in as large a box around them as needed."""
        first, last, reach = cells.min(axis=0), cells.max(axis=0) + 1, FIRST_REACH
        while True:
            low = np.maximum(first - reach, 0)
            high = np.minimum(last + reach, self.blocked.shape)
            box = self.blocked[tuple(map(slice, low, high))]
            squared: Ints32 = SQUARED_DISTANCES[box.ndim](box, NOWHERE)[tuple((cells - low).T)]
            # Cells outside the box are more than `reach` cells away from all of the cells.
            if squared.max() <= (2 * reach) ** 2 or box.shape == self.blocked.shape:
                return squared
            reach *= 4

    def to_cells(self, points: npt.ArrayLike) -> Floats:
        """Return positions [m, map] in cells from the window's outer corner, shape (n, d)."""
        shifted: Floats = np.atleast_2d(np.asarray(points, dtype=np.float64)) - self.window.origin
        return shifted / self.window.resolution

    def area_of(self, cells: Bools) -> float:
        """Return the area of the cells of a mask [m²], on a 3-D map their volume [m³]."""
        return float(cells.sum()) * self.window.resolution**cells.ndim

    def segment_clearance(self, a: Sequence[float], b: Sequence[float], limit: float) -> float:
        """Return the distance from a segment to the nearest blocked cell, at most `limit` [cells].

        Parameters
        ----------
        a, b : sequence of float, x first [cells]
            Ends of the segment.
        limit : float [cells]
            Largest distance to search.
        """
        points = np.array(a, dtype=np.float64), np.array(b, dtype=np.float64)
        segment_clearance = SEGMENT_CLEARANCE[self.blocked.ndim]
        return segment_clearance(self.blocked, *points, limit)

    def clearance_of(
        self, points: npt.ArrayLike, *, to: Bools | None = None, limit: float = math.inf
    ) -> float:
        """Return the exact distance of a point or a polyline to the nearest blocked cell [m].

        Parameters
        ----------
        points : array_like, shape (d,) or (n, d) [m, map]
        to : ndarray of bool, shape as `blocked`, optional
            Cells to measure to; default: the blocked ones.
        limit : float, default inf [m]
            Largest distance to search.
        """
        mask, size = self.blocked if to is None else to, self.window.resolution
        line_clearance = LINE_CLEARANCE[mask.ndim]
        return float(line_clearance(mask, self.to_cells(points), limit / size)) * size

    def with_problem(self, problem: PlanningProblem) -> Self:
        """Return the space of another query on the same map, with all cached results."""
        twin = replace(self, problem=problem)
        vars(twin).update(vars(self) | {"problem": problem})
        return twin
