"""Which cells are traversable, and their costs: a pure function of map and problem."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Bytes, Counts, Floats, Floats32, Ints, Ints32
from groundmap.grid.window import GridWindow
from planners.costmap.extent import padded_box
from planners.costmap.kernels.moves import DIAGONAL, ONE
from planners.costmap.layers import Layers, cap, layers_of
from planners.costmap.map_space import MapSpace
from planners.costmap.moves import allowed_moves
from planners.errors import ProblemError
from planners.problem.costs import MAX_NON_OBSTACLE
from planners.problem.problem import PlanningProblem

MOST_COST = 2**30  # [cells] of a route: leaves the same range for weighted estimates


@dataclass(frozen=True, eq=False)
class Costmap(MapSpace):
    """Which cells are blocked, where the footprint's centre may be, and at which cost.

    Attributes
    ----------
    problem : PlanningProblem
    window : GridWindow
        The observed tiles, surrounded by a ring of unknown cells that also encloses the cleared
        start. The ring stands for all unknown space outside.
    blocked, nonfree, cleared : ndarray of bool, shape (rows, cols)
        Cells that the footprint may not touch; those among them that are non-free; unknown cells
        that count as free because they are near the start.
    squared : ndarray of int32, shape (rows, cols) [(half cells)²]
        Squared distance from cell centres to the nearest blocked square, cut to the larger of the
        footprint's radius and the inflation radius.
    costs : ndarray of uint8, shape (rows, cols)
        On Nav2's scale: 0 to 252 on traversable cells, 253 where the footprint would touch a
        blocked cell, 254 on non-free cells, 255 on other blocked ones.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(9, 9), goal=(60, 60), footprint=1.5)
    >>> costmap = Costmap.of(problem)
    >>> costmap.blocked.shape, float(costmap.clearance.max()), costmap.costs[:5, 30].tolist()
    ((68, 68), 31.5, [255, 255, 253, 0, 0])
    """

    window: GridWindow
    squared: Ints32
    costs: Bytes

    @classmethod
    def of(cls, problem: PlanningProblem) -> Costmap:
        """Return the costmap of a problem on a 2-D map whose start is on the map.

        Raises
        ------
        ProblemError
            A 3-D map, or one with too many cells.
        """
        problem.check_dimensions(2)
        window = problem.grid.read(padded_box(problem))
        return cls(problem, window, *layers_of(problem, window))

    def with_changes(self, changed: npt.ArrayLike) -> Costmap:
        """Return the costmap after cells of its map have changed.

        Only the affected part is updated: the cells themselves, and the distances and costs of
        cells within the footprint's and the inflation radius.

        Parameters
        ----------
        changed : array_like of int, shape (n, 2)
            Cells [row, col] of the grid whose confidence, count or drop-offs changed. If the map
            has grown since, the whole costmap is computed.

        Raises
        ------
        ProblemError
            An array of another shape, or not of integers.
        """
        cells = whole_cells(changed) - self.lower_cell
        if len(cells) == 0:
            return self
        shape = np.array(self.blocked.shape)
        # Cells in the ring around the map, or outside it, mean that the map has grown.
        tiles = np.array(self.problem.grid.cell_bounds()) - self.lower_cell
        reached = np.concatenate([cells, tiles - [[0], [1]]])
        if (reached < 1).any() or (reached >= shape - 1).any():
            return Costmap.of(self.problem)
        reach = math.isqrt(cap(self.problem)) // 2 + 2
        first = np.maximum(cells.min(axis=0) - reach, 0)
        last = np.minimum(cells.max(axis=0) + reach + 1, shape)
        outer = np.maximum(first - reach, 0), np.minimum(last + reach, shape)
        part = self._read(*outer)
        here, inner = _slices(first, last), _slices(first - outer[0], last - outer[0])
        renewed = {name: getattr(self, name).copy() for name in Layers._fields}
        for name, values in layers_of(self.problem, part)._asdict().items():
            renewed[name][here] = values[inner]
        return Costmap(self.problem, _patch(self.window, part, _slices(*outer)), **renewed)

    def _read(self, first: Ints, last: Ints) -> GridWindow:
        """Return the current cells of the map from [row, col] `first` up to `last`."""
        size = self.window.resolution
        low, high = first[::-1] + 0.5, last[::-1] - 0.5
        return self.problem.grid.window(
            np.concatenate([self.window.origin + low * size, self.window.origin + high * size])
        )

    @property
    def width(self) -> int:
        """Cells in a row."""
        return int(self.blocked.shape[1])

    @property
    def lower_cell(self) -> Ints:
        """Cell [row, col] of the grid that cell (0, 0) of the costmap is."""
        grid = self.problem.grid
        corner = (self.window.origin - grid.origin) / grid.resolution
        return np.rint(corner).astype(np.int64)[::-1]

    @property
    def top(self) -> float:
        """Extra cost of a metre in a cell of cost 252 [m/m]."""
        return self.problem.costs.top(penalise=self.problem.unknown == "penalise")

    @property
    def uniform(self) -> bool:
        """Whether all cells have the same cost."""
        return self.top == 0.0

    def evidence_at(self, cells: Ints) -> tuple[Floats32, Counts]:
        """Return the confidence and the count of cells, given by their indices, shape (n,) each."""
        at = tuple(cells.T)
        return self.window.confidence[at], self.window.count[at]

    def weights_at(self, cells: Ints) -> Floats:
        """Return what a metre costs in cells, given by their indices, shape (n,) [m/m]."""
        weights: Floats = 1.0 + self.costs[tuple(cells.T)] * (self.top / MAX_NON_OBSTACLE)
        return weights

    @cached_property
    def steps(self) -> Ints:
        """Costs of moves, indexed by the sum of the costs of their two cells, shape (2, 505).

        The first row holds orthogonal moves, the second diagonal ones; `ONE` is the side of a
        cell. Each half of a move is weighted by its own cell, so both directions cost the same.

        Raises
        ------
        ProblemError
            The cost of a route could exceed the integer range of a search.
        """
        self._check_sums()
        factors = 1.0 + self.top * np.arange(2 * MAX_NON_OBSTACLE + 1) / (2.0 * MAX_NON_OBSTACLE)
        steps: Ints = np.rint(np.array([[ONE], [DIAGONAL]]) * factors).astype(np.int64)
        return steps

    def _check_sums(self) -> None:
        """Check that no route can cost more than `MOST_COST`.

        A route visits a cell once, with two halves of moves that are weighted by the cell.
        """
        most = MOST_COST * ONE / DIAGONAL
        if self.traversable.size * (1.0 + self.top) <= most:
            return
        factors = 1.0 + self.top * np.arange(MAX_NON_OBSTACLE + 1) / MAX_NON_OBSTACLE
        counts = np.bincount(self.costs[self.traversable], minlength=len(factors))
        total = float(counts @ factors)
        if total > most:
            raise ProblemError(
                "costs",
                f"a total cost of the {counts.sum()} traversable cells of at most {most:.3g}",
                f"{total:.3g}",
                hint="Use smaller weights, or a map with larger cells.",
            )

    @cached_property
    def traversable(self) -> Bools:
        """Cells on whose centre the footprint's centre may be, shape (rows, cols)."""
        return self.costs <= MAX_NON_OBSTACLE

    @cached_property
    def moves(self) -> Bytes:
        """Allowed moves between traversable cells as bits, shape (rows, cols)."""
        return allowed_moves(self.traversable)


def whole_cells(changed: npt.ArrayLike) -> Ints:
    """Return cells [row, col] as an integer array, shape (n, 2).

    Raises
    ------
    ProblemError
        Another shape, or not integers.
    """
    expected = "whole numbers [row, col], shape (n, 2)"
    try:
        cells = np.asarray(changed)
    except ValueError as error:
        raise ProblemError("changed", expected, repr(changed)[:60]) from error
    if cells.size == 0:
        return np.empty((0, 2), dtype=np.int64)
    if cells.ndim != 2 or cells.shape[1] != 2 or cells.dtype.kind not in "iu":
        got = f"shape {cells.shape} of {cells.dtype}"
        raise ProblemError("changed", expected, got)
    return cells.astype(np.int64)


def _slices(first: Ints, last: Ints) -> tuple[slice, slice]:
    rows, cols = map(slice, first.tolist(), last.tolist())
    return rows, cols


def _patch(window: GridWindow, part: GridWindow, box: tuple[slice, slice]) -> GridWindow:
    """Return a copy of a window in which a part is replaced."""
    names = ("confidence", "count")
    arrays = {name: getattr(window, name).copy() for name in names}
    for name in names:
        arrays[name][box] = getattr(part, name)
    return replace(window, **arrays)
