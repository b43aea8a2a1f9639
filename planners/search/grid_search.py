"""The search over cells that all grid planners share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bytes, Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import Ends, ends_of, waypoints_through
from planners.costmap.kernels.moves import ONE
from planners.errors import ProblemError
from planners.geometry.polyline import length_of
from planners.problem.problem import Pose
from planners.search.base import Clock, SearchResult
from planners.search.kernels.astar import BEST, EXHAUSTED, EXPANDED, FOUND, HEAP_FULL, SLICE_DONE


class GridQuery(NamedTuple):
    """One query of a search: start and goal, and the cells that they are joined to."""

    start: Pose  #: x, y and, in 3-D, z [m, map]; the rest is ignored
    goal: Pose  #: likewise
    ends: Ends
    settings: Any  #: the planner's settings


class GridSearch(ABC):
    """A search over cells by compiled kernels, in slices between checks of the clock.

    A subclass adds the steps of one planner: `_join`, `_seed`, `_advance`, `_trace` and `_line`.
    Arrays are allocated once and reused by all queries.
    """

    name: ClassVar[str]
    slice_size: ClassVar[int] = 100_000  #: expansions between two checks of the clock: about 20 ms
    first_room: ClassVar[int] = 1 << 14  #: heap entries to begin with

    def __init__(self) -> None:
        self.heap = np.empty((self.first_room, 2), dtype=np.int64)
        self.state = np.zeros(4, dtype=np.int64)

    def search(self, start: Pose, goal: Pose, settings: Any) -> SearchResult | None:
        """Return the best route from start to goal, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float
            x, y and, in 3-D, z [m, map]; the rest is ignored.
        settings : SearchSettings
            Settings of the planner.

        Raises
        ------
        TimeLimitError
            The time limit is exceeded; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        query = GridQuery(start, goal, self._join(start, goal), settings)
        if query.ends.direct:
            return self._direct_result(query)
        if len(query.ends.sources) == 0:
            return None
        self._seed(query)
        status = SLICE_DONE
        while status not in (FOUND, EXHAUSTED):
            clock.check(int(self.state[EXPANDED]))
            status = self._search_slice(query)
        return self._to_result(query) if status == FOUND else None

    @abstractmethod
    def _join(self, start: Pose, goal: Pose) -> Ends:
        """Return the cells that start and goal are joined to."""

    @abstractmethod
    def _seed(self, query: GridQuery) -> None:
        """Reset `state`, and put the sources on an empty heap."""

    @abstractmethod
    def _advance(self, query: GridQuery) -> int:
        """Expand up to `slice_size` nodes and return the kernel's status."""

    @abstractmethod
    def _trace(self) -> Ints:
        """Return the cells where the best path begins, turns and ends, in order."""

    @abstractmethod
    def _line(self, query: GridQuery, cells: Ints) -> Floats:
        """Return the waypoints from start to goal through the centres of cells [m, map]."""

    def _bound(self, settings: Any) -> float | None:
        """Return the factor of the least cost that a route costs at most, if there is one."""
        return 1.0

    def _cost(self, waypoints: Floats) -> float:
        """Return the cost of the best path, whose waypoints are given [m]."""
        return length_of(waypoints)

    def _search_slice(self, query: GridQuery) -> int:
        """Search until the slice ends, the search ends or the heap is full, which then grows."""
        status = self._advance(query)
        if status == HEAP_FULL:
            self._grow()
        return status

    def _grow(self) -> None:
        self.heap = enlarge(self.heap, by=len(self.heap))

    def _direct_result(self, query: GridQuery) -> SearchResult:
        """Return the straight piece from start to goal."""
        waypoints = self._line(query, query.ends.sources[:0, :-1])
        return SearchResult(waypoints, 0, cost=length_of(waypoints))

    def _to_result(self, query: GridQuery) -> SearchResult:
        waypoints = self._line(query, self._trace())
        expanded, bound = int(self.state[EXPANDED]), self._bound(query.settings)
        return SearchResult(waypoints, expanded, bound=bound, cost=self._cost(waypoints))


class CostmapSearch(GridSearch):
    """A search over the cells of a costmap.

    Parameters
    ----------
    costmap : Costmap

    Raises
    ------
    ProblemError
        Costs vary over the costmap, and the planner needs uniform ones.
    """

    needs_uniform: ClassVar[bool] = False  #: whether all metres must cost the same

    def __init__(self, costmap: Costmap) -> None:
        super().__init__()
        if self.needs_uniform and not costmap.uniform:
            raise ProblemError(
                "planner",
                f"uniform costs, which {self.name!r} needs",
                "cells that cost more than others",
                hint="Use 'astar', which supports non-uniform costs.",
            )
        self.costmap = costmap

    def _join(self, start: Pose, goal: Pose) -> Ends:
        return ends_of(self.costmap, start, goal)

    def _line(self, query: GridQuery, cells: Ints) -> Floats:
        return waypoints_through(self.costmap, query.start, query.goal, cells)

    def _cost(self, waypoints: Floats) -> float:
        # With uniform costs, the line's own length: merging the end pieces may shorten it.
        if self.costmap.uniform:
            return length_of(waypoints)
        return float(self.state[BEST]) / ONE * self.costmap.window.resolution

    def _cells(self, nodes: Ints) -> Ints:
        """Return rows and columns of nodes, shape (n, 2)."""
        return np.column_stack(np.divmod(nodes, self.costmap.width))


def kernel_arrays(costmap: Costmap) -> tuple[Bytes, Bytes, Ints, int]:
    """Return allowed moves, costs of cells, costs of moves and the width, as kernels take them."""
    return costmap.moves.ravel(), costmap.costs.ravel(), costmap.steps, costmap.width


def enlarge(array: npt.NDArray[Any], *, by: int) -> npt.NDArray[Any]:
    """Return an array with more rows, which are not initialised.

    Parameters
    ----------
    array : ndarray, shape (n, ...)
    by : int
        Number of rows to add.

    Examples
    --------
    >>> enlarge(np.zeros((3, 2)), by=4).shape
    (7, 2)
    """
    return np.concatenate([array, np.empty((by, *array.shape[1:]), dtype=array.dtype)])
