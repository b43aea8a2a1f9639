"""D* Lite: the first search costs what A* costs, the next only what changed since."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from groundmap.arrays import Bools, Bytes, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import Ends, ends_of, waypoints_through
from planners.costmap.kernels.moves import ONE
from planners.geometry.polyline import length_of
from planners.problem.problem import Pose
from planners.search.base import SLICE, Clock, SearchResult, SearchSettings
from planners.search.kernels.astar import FAR, estimate
from planners.search.kernels.dstar_lite import (
    BEST,
    DONE,
    EXPANDED,
    HEAP_FULL,
    SHIFT,
    SIZE,
    SLICE_DONE,
    advance,
    compact,
    touch,
    trace,
)

FIRST_ROOM = 1 << 14  # heap entries to begin with
SPARE = 9  # entries that one step of the search may add
NODE = 0xFFFFFFFF  # the bits of a heap entry that hold the node


class DStarLiteSettings(SearchSettings):
    """What D* Lite can be told."""


class DStarLite:
    """D* Lite, which keeps its search from one query to the next (Koenig & Likhachev 2002).

    It searches from the goal to the start. A query to the same goal repairs the last search: what
    was said with `update` since, and the start's move. A query to another goal begins anew.

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
    >>> engine.update(costmap.updated([[9, 20]]))
    >>> found = engine.search((15.5, 9.5), problem.goal, DStarLiteSettings())
    >>> round(found.cost, 2), found.waypoints.tolist()[-1]
    (36.49, [49.5, 9.5])
    """

    name: ClassVar[str] = "dstar_lite"

    def __init__(self, costmap: Costmap) -> None:
        self.costmap = costmap
        self.heap = np.empty((FIRST_ROOM, 2), dtype=np.int64)
        self.state = np.zeros(4, dtype=np.int64)
        self._begin_on(costmap)

    def search(self, start: Pose, goal: Pose, settings: SearchSettings) -> SearchResult | None:
        """Return the route of least cost from start to goal, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float
            x and y [m, map]; what follows is ignored.
        settings : DStarLiteSettings

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always. The next query goes on where this one ended.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        ends = ends_of(self.costmap, start, goal)
        if ends.direct:
            return SearchResult(
                waypoints_through(self.costmap, start, goal, np.empty((0, 2), int)), 0
            )
        if len(ends.sources) == 0:
            return None
        self._aim(goal[:2], ends)
        status = SLICE_DONE
        while status != DONE:
            clock.check(int(self.state[EXPANDED]))
            status = self._advance()
        return None if self.state[BEST] == FAR else self._to_result(start, goal)

    def update(self, costmap: Costmap) -> None:
        """Go on with another costmap, of the same cells and possibly others around them.

        What was searched is kept where the two agree; cells that differ, and those beside them,
        are looked at again by the next `search`.

        Parameters
        ----------
        costmap : Costmap
            Such as `Costmap.updated` returns it. On one of another resolution, or with other
            prices for the same costs, the next search begins anew.
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
            dearer_or_not = (costs != costmap.costs) & costmap.traversable
            affected |= ndimage.binary_dilation(dearer_or_not, np.ones((3, 3), dtype=np.bool_))
        self._touch(np.flatnonzero(affected))

    def _begin_on(self, costmap: Costmap) -> None:
        self.costmap = costmap
        self.labels = np.empty((costmap.traversable.size, 2), dtype=np.int64)
        self.goal: Pose | None = None
        self.sources = self.targets = np.empty((0, 3), dtype=np.int64)

    def _aim(self, goal: Pose, ends: Ends) -> None:
        """Take over start and goal: only another goal voids what was searched."""
        if goal != self.goal:
            self.goal, self.targets = goal, np.empty((0, 3), dtype=np.int64)
            self.labels.fill(FAR)
            self.state[[SIZE, SHIFT]] = 0
        else:
            # No estimate falls by more than this, so what waits keeps its place: its f's are now
            # too small at worst.
            falls = [estimate(row, col, self.sources) - cost for row, col, cost in ends.sources]
            self.state[SHIFT] += max(0, *falls)
        self.sources = ends.sources
        self.state[EXPANDED] = 0
        if not np.array_equal(self.targets, ends.targets):
            either = np.concatenate([self.targets, ends.targets])
            self.targets = ends.targets
            self._touch(np.unique(either[:, 0] * self.costmap.width + either[:, 1]))

    def _touch(self, nodes: Ints) -> None:
        """Look at cells again whose moves, costs or final cost changed."""
        self._make_room(len(nodes))
        touch(nodes, *self._graph, self.sources, self.targets, self.labels, self.heap, self.state)

    def _advance(self) -> int:
        status = advance(
            *self._graph, self.sources, self.targets, self.labels, self.heap, self.state, SLICE
        )
        if status == HEAP_FULL:
            self._make_room(SPARE)
        return status

    @property
    def _graph(self) -> tuple[Bytes, Bytes, Ints, int]:
        costmap = self.costmap
        return costmap.moves.ravel(), costmap.costs.ravel(), costmap.steps, costmap.width

    def _make_room(self, entries: int) -> None:
        """Drop what is out of date if the heap is full, and grow it unless that halves it."""
        if self.state[SIZE] + entries <= len(self.heap):
            return
        compact(self.costmap.width, self.sources, self.labels, self.heap, self.state)
        if self.state[SIZE] + entries > len(self.heap) // 2:
            more = np.empty((len(self.heap) + entries, 2), dtype=np.int64)
            self.heap = np.concatenate([self.heap, more])

    def _move(self, shape: tuple[int, ...], offset: Ints) -> None:
        """Give every cell the place it has on a map whose window grew, shrank or moved."""
        width = self.costmap.width
        labels = self.labels.reshape(*self.costmap.traversable.shape, 2)
        self.labels = _reshape(labels, (*shape, 2), offset, FAR).reshape(-1, 2)
        waiting = self.heap[: self.state[SIZE]]
        cells = np.column_stack(np.divmod(waiting[:, 1] & NODE, width)) + offset
        inside = _inside(cells, shape)
        nodes = cells[:, 0] * shape[1] + cells[:, 1]
        moved = np.column_stack([waiting[:, 0], (waiting[:, 1] & ~NODE) | nodes])[inside]
        self.state[SIZE] = len(moved)
        # In the order in which they come out, rows are a heap.
        self.heap[: len(moved)] = moved[np.lexsort((moved[:, 1], moved[:, 0]))]
        shift = np.array([*offset, 0])
        self.sources, self.targets = self.sources + shift, self.targets + shift
        self.targets = self.targets[_inside(self.targets[:, :2], shape)]

    def _to_result(self, start: Pose, goal: Pose) -> SearchResult:
        turns = trace(*self._graph, self.sources, self.targets, self.labels)
        cells = np.column_stack(np.divmod(turns, self.costmap.width))
        waypoints = waypoints_through(self.costmap, start, goal, cells)
        cost = float(self.state[BEST]) / ONE * self.costmap.window.resolution
        # Where all metres are alike, the line's own length: merging end pieces may shorten it.
        cost = length_of(waypoints) if self.costmap.uniform else cost
        return SearchResult(waypoints, int(self.state[EXPANDED]), cost=cost)


def _continues(before: Costmap, after: Costmap) -> bool:
    """Whether cells and prices of two costmaps are the same, whatever the cells hold."""
    grids = before.problem.grid, after.problem.grid
    same_cells = all(
        np.array_equal(getattr(grids[0], name), getattr(grids[1], name))
        for name in ("resolution", "origin")
    )
    return same_cells and before.top == after.top


def _reshape(
    array: npt.NDArray[Any], shape: tuple[int, ...], offset: Ints, fill: int
) -> npt.NDArray[Any]:
    """Return an array of another shape that holds what fits of `array`, moved by rows and cols."""
    if array.shape == shape and not offset.any():
        return array
    placed = np.full(shape, fill, dtype=array.dtype)
    first = np.maximum(offset, 0)
    last = np.minimum(offset + array.shape[:2], shape[:2])
    if (first < last).all():
        source, target = first - offset, last - offset
        placed[first[0] : last[0], first[1] : last[1]] = array[
            source[0] : target[0], source[1] : target[1]
        ]
    return placed


def _inside(cells: Ints, shape: tuple[int, ...]) -> Bools:
    within = (cells >= 0) & (cells < np.array(shape))
    inside: Bools = np.logical_and.reduce(within, axis=1)
    return inside
