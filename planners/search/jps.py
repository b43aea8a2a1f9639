"""Jump point search: the routes of A* where all metres cost the same, found by fewer steps."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from groundmap.arrays import Bools, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import Ends, ends_of, waypoints_through
from planners.problem.problem import Pose
from planners.search.base import Clock, SearchResult, SearchSettings, check_uniform
from planners.search.kernels.astar import (
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    ROOT,
    SIZE,
    TARGET,
)
from planners.search.kernels.astar import estimate as estimated
from planners.search.kernels.heap import push
from planners.search.kernels.jps import CAME, MARK, advance, trace
from planners.search.kernels.jps_jumps import Jumps
from planners.search.kernels.jps_table import fill_table

SLICE = 10_000  # expansions between two looks at the clock: about 10 ms
FIRST_ROOM = 1 << 14  # heap entries to begin with


class JPSSettings(SearchSettings):
    """What jump point search can be told."""


class JPSPlusSettings(SearchSettings):
    """What jump point search with a table can be told."""


class JPS:
    """Jump point search over A*'s moves (Harabor and Grastien 2011), 64 cells at a time (2014).

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(5.5, 5.5), goal=(9.5, 8.5), footprint=2.0)
    >>> found = JPS(Costmap.of(problem)).search(problem.start, problem.goal, JPSSettings())
    >>> found.waypoints.tolist(), found.expanded
    ([[5.5, 5.5], [8.5, 8.5], [9.5, 8.5]], 2)
    """

    name: ClassVar[str] = "jps"

    def __init__(self, costmap: Costmap) -> None:
        check_uniform(self.name, costmap)
        self.costmap = costmap
        self.labels = np.zeros((costmap.traversable.size, 2), dtype=np.int64)
        self.query = 0
        self.heap = np.empty((FIRST_ROOM, 2), dtype=np.int64)
        self.jumps: Jumps | None = None

    def twin(self) -> Self:
        """Return an engine for another thread: what jumps are looked up in is shared."""
        if self.jumps is None:
            self.jumps = self.look_up()
        other = type(self)(self.costmap)
        other.jumps = self.jumps
        return other

    def look_up(self) -> Jumps:
        """Return what jumps are looked up in: made for the first search, kept for the others."""
        return stops_of(self.costmap.traversable)

    def search(self, start: Pose, goal: Pose, settings: SearchSettings) -> SearchResult | None:
        """Return the shortest route from start to goal, or None if there is none.

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        ends = ends_of(self.costmap, start, goal)
        if ends.direct:
            return SearchResult(
                waypoints_through(self.costmap, start, goal, np.empty((0, 2), int)), 0
            )
        if self.jumps is None:
            self.jumps = self.look_up()
        state = self._seed(ends)
        status = -1
        while status not in (FOUND, EXHAUSTED):
            clock.check(int(state[EXPANDED]))
            status = self._advance(self.jumps, ends.targets, state)
        if status == EXHAUSTED:
            return None
        turns = trace(self.labels, self.costmap.width, int(state[TARGET]))[::-1]
        cells = np.column_stack(np.divmod(turns, self.costmap.width))
        waypoints = waypoints_through(self.costmap, start, goal, cells)
        return SearchResult(waypoints, int(state[EXPANDED]))

    def _seed(self, ends: Ends) -> Ints:
        """Begin a query: put the sources on an empty heap."""
        self.query += 1
        fresh = MARK * self.query
        state = np.array([0, FAR, -1, 0, fresh], dtype=np.int64)
        for row, col, cost in ends.sources.tolist():
            node = row * self.costmap.width + col
            self.labels[node] = cost, fresh + (ROOT << CAME)
            h = estimated(row, col, ends.targets)
            state[SIZE] = push(self.heap, state[SIZE], cost + h, h, node)
        return state

    def _advance(self, jumps: Jumps, targets: Ints, state: Ints) -> int:
        status = advance(self.costmap.moves, jumps, targets, self.labels, self.heap, state, SLICE)
        if status == HEAP_FULL:
            self.heap = np.concatenate([self.heap, np.empty_like(self.heap)])
        return status


class JPSPlus(JPS):
    """Jump point search with a table of all jumps (Rabin 2015), for many queries on one map.

    The first search makes the table: 16 bytes for each cell.
    """

    name = "jps+"

    def look_up(self) -> Jumps:
        """Return the table of jumps."""
        moves = self.costmap.moves
        kind = np.int16 if max(moves.shape) <= np.iinfo(np.int16).max else np.int32
        table: Jumps = np.empty((*moves.shape, 8), dtype=kind)
        fill_table(moves, table)
        return table


def stops_of(traversable: Bools) -> Ints:
    """Return the bitmap of stops that is described in `planners.search.kernels.jps_jumps`.

    Parameters
    ----------
    traversable : ndarray of bool, shape (rows, cols)

    Examples
    --------
    >>> stops_of(np.array([[False, True, False], [True, True, True]]))[1].tolist()
    [-6, -8]
    """
    ways = [traversable, traversable[:, ::-1], traversable.T, traversable[::-1].T]
    return np.concatenate([_stops_ahead(lines) for lines in ways])


def _stops_ahead(lines: Bools) -> Ints:
    """Return stops and walls on the way along axis 1, shape (words, 2)."""
    count, length = lines.shape
    padded = np.zeros((count, (length // 64 + 1) * 64), dtype=np.bool_)
    padded[:, :length] = lines
    traversable = np.packbits(padded, axis=1, bitorder="little").view("<u8")
    before = traversable << np.uint64(1)
    before[:, 1:] |= traversable[:, :-1] >> np.uint64(63)
    opens = traversable & ~before  # a cell after a wall: what stands beside it is a jump point
    stops = ~traversable
    stops[1:] |= opens[:-1]
    stops[:-1] |= opens[1:]
    pairs = np.stack([stops, ~traversable], axis=-1)
    return pairs.astype(np.uint64).view(np.int64).reshape(-1, 2)
