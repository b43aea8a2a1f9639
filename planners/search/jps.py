"""Jump point search: the routes of A* where costs are uniform, with fewer expansions."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np

from groundmap.arrays import Bools, Ints
from planners.costmap.costmap import Costmap
from planners.search.base import SearchSettings
from planners.search.grid_search import CostmapSearch, GridQuery
from planners.search.kernels.astar import FAR, ROOT, TARGET, UNIT, seed
from planners.search.kernels.jps import CAME, MARK, advance, trace
from planners.search.kernels.jps_jumps import Jumps
from planners.search.kernels.jps_table import fill_table


class JPSSettings(SearchSettings):
    """Settings of jump point search."""


class JPSPlusSettings(SearchSettings):
    """Settings of jump point search with a table."""


class JPS(CostmapSearch):
    """Jump point search over A*'s moves (Harabor and Grastien 2011), 64 cells at a time (2014).

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(5.5, 5.5), goal=(9.5, 8.5), footprint=2.0)
    >>> result = JPS(Costmap.of(problem)).search(problem.start, problem.goal, JPSSettings())
    >>> result.waypoints.tolist(), result.expanded
    ([[5.5, 5.5], [8.5, 8.5], [9.5, 8.5]], 2)
    """

    name = "jps"
    needs_uniform = True
    slice_size = 10_000  # about 10 ms

    def __init__(self, costmap: Costmap) -> None:
        super().__init__(costmap)
        self.labels = np.zeros((costmap.traversable.size, 2), dtype=np.int64)
        self.queries = 0

    def twin(self) -> Self:
        """Return an engine for another thread, which shares the jumps."""
        other = type(self)(self.costmap)
        other.jumps = self.jumps
        return other

    @cached_property
    def jumps(self) -> Jumps:
        """The bitmap of stops; the first search makes it."""
        return stops_of(self.costmap.traversable)

    def _seed(self, query: GridQuery) -> None:
        self.queries += 1
        fresh, width = MARK * self.queries, self.costmap.width
        mark = fresh + (ROOT << CAME)
        size = seed(*query.ends[:2], UNIT, width, mark, self.labels, self.heap)
        self.state = np.array([size, FAR, -1, 0, fresh], dtype=np.int64)

    def _advance(self, query: GridQuery) -> int:
        return advance(
            self.costmap.moves,
            self.jumps,
            query.ends.targets,
            self.labels,
            self.heap,
            self.state,
            self.slice_size,
        )

    def _trace(self) -> Ints:
        return self._cells(trace(self.labels, self.costmap.width, int(self.state[TARGET]))[::-1])


class JPSPlus(JPS):
    """Jump point search with a table of all jumps (Rabin 2015), for many queries on one map.

    The first search makes the table: 16 bytes for each cell.
    """

    name = "jps+"

    @cached_property
    def jumps(self) -> Jumps:
        """The table of jumps; the first search makes it."""
        moves = self.costmap.moves
        kind = np.int16 if max(moves.shape) <= np.iinfo(np.int16).max else np.int32
        table: Jumps = np.empty((*moves.shape, 8), dtype=kind)
        fill_table(moves, table)
        return table


def stops_of(traversable: Bools) -> Ints:
    """Return the bitmap of stops; `planners.search.kernels.jps_jumps` describes it.

    Parameters
    ----------
    traversable : ndarray of bool, shape (rows, cols)

    Examples
    --------
    >>> stops_of(np.array([[False, True, False], [True, True, True]]))[1].tolist()
    [-6, -8]
    """
    directions = [traversable, traversable[:, ::-1], traversable.T, traversable[::-1].T]
    return np.concatenate([_stops_ahead(lines) for lines in directions])


def _stops_ahead(lines: Bools) -> Ints:
    """Return the bits of stops and of walls along axis 1, shape (words, 2)."""
    count, length = lines.shape
    padded = np.zeros((count, (length // 64 + 1) * 64), dtype=np.bool_)
    padded[:, :length] = lines
    traversable = np.packbits(padded, axis=1, bitorder="little").view("<u8")
    before = traversable << np.uint64(1)
    before[:, 1:] |= traversable[:, :-1] >> np.uint64(63)
    opens = traversable & ~before  # a cell after a wall: its neighbours beside it are jump points
    stops = ~traversable
    stops[1:] |= opens[:-1]
    stops[:-1] |= opens[1:]
    pairs = np.stack([stops, ~traversable], axis=-1)
    return pairs.astype(np.uint64).view(np.int64).reshape(-1, 2)
