"""D* Lite: incremental search, which repairs the previous search after changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from groundmap.arrays import Bools, Bytes, Ints
from planners.costmap.costmap import Costmap
from planners.problem.problem import Pose
from planners.search.base import SearchSettings
from planners.search.grid_search import CostmapSearch, GridQuery, enlarge, kernel_arrays
from planners.search.kernels.astar import EXPANDED, FAR, SIZE, estimate
from planners.search.kernels.dstar_lite import SHIFT, advance, compact, touch, trace

SPARE = 9  # entries that one step of the search adds at most
NODE = 0xFFFFFFFF  # the bits of a heap entry that hold the node


class DStarLiteSettings(SearchSettings):
    """Settings of D* Lite."""


class DStarLite(CostmapSearch):
    """D* Lite, which keeps its search from one query to the next (Koenig & Likhachev 2002).

    It searches from the goal to the start. A query with the same goal repairs the previous search:
    it handles the start's motion and all changes since, which `update` takes. A query with another
    goal searches from scratch, one after a `TimeLimitError` continues.

    Parameters
    ----------
    costmap : Costmap

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(5.5, 9.5), goal=(49.5, 9.5), footprint=2.0)
    >>> costmap = Costmap.of(problem)
    >>> engine = DStarLite(costmap)
    >>> engine.search(problem.start, problem.goal, DStarLiteSettings()).expanded
    45
    >>> grid.fuse(np.array([9, 20]), np.full((1, 1), 1.0, dtype=np.float32))
    >>> engine.update(costmap.with_changes([[9, 20]]))
    >>> result = engine.search((15.5, 9.5), problem.goal, DStarLiteSettings())
    >>> round(result.cost, 2), result.waypoints.tolist()[-1]
    (36.49, [49.5, 9.5])
    """

    name = "dstar_lite"

    def __init__(self, costmap: Costmap) -> None:
        super().__init__(costmap)
        self._begin_on(costmap)

    def update(self, costmap: Costmap) -> None:
        """Replace the costmap by one of the same cells, and possibly of others around them.

        Search results are kept where both agree. The next `search` repairs cells that differ, and
        their neighbours.

        Parameters
        ----------
        costmap : Costmap
            For example from `Costmap.updated`. If its resolution, its origin or its weight of costs
            differs, the next search starts from scratch.
        """
        before = self.costmap
        if self.goal is None or not _continues(before, costmap):
            self._begin_on(costmap)
            return
        offset = before.lower_cell - costmap.lower_cell
        shape = costmap.traversable.shape
        moves = _reshape(before.moves, shape, offset, 0)
        if before.traversable.shape != shape or offset.any():
            self._move(shape, offset)
        self.costmap = costmap
        affected = moves != costmap.moves
        if not costmap.uniform:
            costs = _reshape(before.costs, shape, offset, 0)
            cost_changes = (costs != costmap.costs) & costmap.traversable
            affected |= ndimage.binary_dilation(cost_changes, np.ones((3, 3), dtype=np.bool_))
        self._touch(np.flatnonzero(affected))

    def _begin_on(self, costmap: Costmap) -> None:
        self.costmap = costmap
        self.labels = np.empty((costmap.traversable.size, 2), dtype=np.int64)
        self.goal: Pose | None = None
        self.sources = self.targets = np.empty((0, 3), dtype=np.int64)

    def _seed(self, query: GridQuery) -> None:
        """Set start and goal: only another goal invalidates the previous search."""
        goal, ends = query.goal[:2], query.ends
        if goal != self.goal:
            self.goal, self.targets = goal, np.empty((0, 3), dtype=np.int64)
            self.labels.fill(FAR)
            self.state[[SIZE, SHIFT]] = 0
        else:
            # No estimate decreases by more than this. Entries of the heap keep their places: their
            # f values are at worst too small.
            falls = [estimate(row, col, self.sources) - cost for row, col, cost in ends.sources]
            self.state[SHIFT] += max(0, *falls)
        self.sources = ends.sources
        self.state[EXPANDED] = 0
        if not np.array_equal(self.targets, ends.targets):
            either = np.concatenate([self.targets, ends.targets])
            self.targets = ends.targets
            self._touch(np.unique(either[:, 0] * self.costmap.width + either[:, 1]))

    def _touch(self, nodes: Ints) -> None:
        """Recompute the costs of cells whose moves, costs or final cost changed."""
        self._make_room(len(nodes))
        touch(nodes, *self._arrays, self.heap, self.state)

    def _advance(self, query: GridQuery) -> int:
        return advance(*self._arrays, self.heap, self.state, self.slice_size)

    @property
    def _arrays(self) -> tuple[Bytes, Bytes, Ints, int, Ints, Ints, Ints]:
        return *kernel_arrays(self.costmap), self.sources, self.targets, self.labels

    def _grow(self) -> None:
        self._make_room(SPARE)

    def _make_room(self, entries: int) -> None:
        """Drop outdated entries if the heap is full; grow it if more than half of it remains."""
        if self.state[SIZE] + entries <= len(self.heap):
            return
        compact(self.costmap.width, self.sources, self.labels, self.heap, self.state)
        if self.state[SIZE] + entries > len(self.heap) // 2:
            self.heap = enlarge(self.heap, by=len(self.heap) + entries)

    def _move(self, shape: tuple[int, ...], offset: Ints) -> None:
        """Renumber the cells for a window that grew, shrank or moved."""
        width = self.costmap.width
        labels = self.labels.reshape(*self.costmap.traversable.shape, 2)
        self.labels = _reshape(labels, (*shape, 2), offset, FAR).reshape(-1, 2)
        waiting = self.heap[: self.state[SIZE]]
        cells = np.column_stack(np.divmod(waiting[:, 1] & NODE, width)) + offset
        inside = _inside(cells, shape)
        nodes = cells[:, 0] * shape[1] + cells[:, 1]
        moved = np.column_stack([waiting[:, 0], (waiting[:, 1] & ~NODE) | nodes])[inside]
        self.state[SIZE] = len(moved)
        # Sorted rows are a heap.
        self.heap[: len(moved)] = moved[np.lexsort((moved[:, 1], moved[:, 0]))]
        shift = np.array([*offset, 0])
        self.sources, self.targets = self.sources + shift, self.targets + shift
        self.targets = self.targets[_inside(self.targets[:, :2], shape)]

    def _trace(self) -> Ints:
        return self._cells(trace(*self._arrays))


def _continues(before: Costmap, after: Costmap) -> bool:
    """Whether two costmaps have the same lattice of cells and the same weight of costs."""
    grids = before.problem.grid, after.problem.grid
    same_cells = all(
        np.array_equal(getattr(grids[0], name), getattr(grids[1], name))
        for name in ("resolution", "origin")
    )
    return same_cells and before.top == after.top


def _reshape(
    array: npt.NDArray[Any], shape: tuple[int, ...], offset: Ints, fill: int
) -> npt.NDArray[Any]:
    """Return an array of another shape with the part of `array` that fits, shifted by `offset`."""
    if array.shape == shape and not offset.any():
        return array
    reshaped = np.full(shape, fill, dtype=array.dtype)
    first = np.maximum(offset, 0)
    last = np.minimum(offset + array.shape[:2], shape[:2])
    if (first < last).all():
        source, target = first - offset, last - offset
        reshaped[first[0] : last[0], first[1] : last[1]] = array[
            source[0] : target[0], source[1] : target[1]
        ]
    return reshaped


def _inside(cells: Ints, shape: tuple[int, ...]) -> Bools:
    within = (cells >= 0) & (cells < np.array(shape))
    inside: Bools = np.logical_and.reduce(within, axis=1)
    return inside
