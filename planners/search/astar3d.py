"""A* in 3-D: the shortest route over the moves between neighbouring voxels."""

from __future__ import annotations

import itertools
import math
from typing import ClassVar

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.endpoints import centres_around
from planners.costmap.kernels.moves import ONE
from planners.costmap.voxel_map import Voxels
from planners.geometry.kernels.clearance3d import segment_clearance
from planners.geometry.polyline import SAME, length_of
from planners.geometry.rounding import rounding_at
from planners.problem.problem import Pose
from planners.search.base import SLICE, Clock, SearchResult, SearchSettings
from planners.search.kernels.astar import EXHAUSTED, FAR, FOUND, HEAP_FULL
from planners.search.kernels.astar3d import (
    EXPANDED,
    MARK,
    ROOT,
    SIZE,
    TARGET,
    advance,
    estimate,
    plates_of,
    trace,
)
from planners.search.kernels.heap import push

FIRST_ROOM = 1 << 14  # heap entries to begin with


class AStar3D:
    """A* over the 26 moves between voxel centres; every voxel of a move's box must be free.

    Start and goal are joined to the up to eight centres around them by straight pieces. Arrays
    are allocated once, and never cleared.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0, origin=(0, 0, 0))
    >>> grid.fuse(np.array([0, 0, 0]), np.full((16, 16, 16), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(3.5, 3.5, 3.5), goal=(9.5, 7.5, 5.5), footprint=2)
    >>> astar = AStar3D(Voxels.of(problem))
    >>> astar.search(problem.start, problem.goal, SearchSettings()).waypoints.tolist()
    [[3.5, 3.5, 3.5], [5.5, 5.5, 5.5], [7.5, 7.5, 5.5], [9.5, 7.5, 5.5]]
    """

    name: ClassVar[str] = "astar"

    def __init__(self, voxels: Voxels) -> None:
        self.voxels = voxels
        self.traversable = np.pad(voxels.traversable, 1)  # so that no move leaves the arrays
        _, rows, self.width = self.traversable.shape
        self.slab = rows * self.width
        self.plates = plates_of(self.traversable)
        self.labels = np.zeros((self.traversable.size, 2), dtype=np.int64)
        self.query = 0
        self.heap = np.empty((FIRST_ROOM, 2), dtype=np.int64)

    def search(self, start: Pose, goal: Pose, settings: SearchSettings) -> SearchResult | None:
        """Return the shortest route from start to goal, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float
            x, y and z [m, map]; what follows is ignored.
        settings : SearchSettings

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        a, b = self.voxels.to_cells([start[:3], goal[:3]])
        if self._is_clear(a, b):
            return _to_result(np.array([start[:3], goal[:3]]), 0)
        sources, targets = self._join(start), self._join(goal)
        if len(sources) == 0 or len(targets) == 0:
            return None
        state = self._seed(sources, targets)
        status = -1
        while status not in (FOUND, EXHAUSTED):
            clock.check(int(state[EXPANDED]))
            status = self._advance(targets, state)
        if status == EXHAUSTED:
            return None
        turns = trace(self.labels, self.width, self.slab, int(state[TARGET]))[::-1]
        inner = np.column_stack(np.unravel_index(turns, self.traversable.shape)) - 1
        centres = self.voxels.window.cell_to_world(inner)
        line = np.concatenate([[start[:3]], centres, [goal[:3]]])
        return _to_result(_merge_collinear(line), int(state[EXPANDED]))

    def _seed(self, sources: Ints, targets: Ints) -> Ints:
        """Begin a query: put the sources on an empty heap."""
        self.query += 1
        state = np.array([0, FAR, -1, 0], dtype=np.int64)
        for layer, row, col, cost in sources.tolist():
            node = layer * self.slab + row * self.width + col
            self.labels[node] = cost, MARK * self.query + ROOT
            h = estimate(layer, row, col, targets)
            state[SIZE] = push(self.heap, state[SIZE], cost + h, h, node)
        return state

    def _advance(self, targets: Ints, state: Ints) -> int:
        status = advance(
            self.plates,
            self.width,
            self.slab,
            targets,
            self.labels,
            self.query,
            self.heap,
            state,
            SLICE,
        )
        if status == HEAP_FULL:
            self.heap = np.concatenate([self.heap, np.empty_like(self.heap)])
        return status

    def _join(self, place: Pose) -> Ints:
        """Return layer, row, column of the padded voxels that a place is joined to, and the cost.

        The place is x, y and z [m, map].
        """
        position = self.voxels.to_cells(place[:3])[0]
        near = rounding_at(place[:3]) / self.voxels.window.resolution
        around = (centres_around(x, near) for x in position.tolist())
        rows = []
        for x, y, z in itertools.product(*around):
            centre = np.array([x, y, z]) + 0.5
            if self._is_clear(position, centre):
                cost = round(math.dist(position, centre) * ONE)
                rows.append([z + 1, y + 1, x + 1, cost])
        return np.array(rows, dtype=np.int64).reshape(-1, 4)

    def _is_clear(self, a: Floats, b: Floats) -> bool:
        """Whether the straight piece a-b [voxels], within 2 x 2 x 2 voxels, keeps its distance."""
        low, high = np.floor(np.minimum(a, b)).astype(int), np.floor(np.maximum(a, b)).astype(int)
        blocked = self.voxels.blocked
        if (low < 0).any() or (high[::-1] >= blocked.shape).any() or (high - low > 1).any():
            return False
        box = tuple(slice(i, j + 1) for i, j in zip(low[::-1], high[::-1], strict=True))
        if blocked[box].any():
            return False
        need = (self.voxels.radius - self.voxels.slack) / self.voxels.window.resolution
        return need <= 0 or segment_clearance(blocked, a, b, need) >= need


def _to_result(waypoints: Floats, expanded: int) -> SearchResult:
    return SearchResult(waypoints, expanded, cost=length_of(waypoints))


def _merge_collinear(points: Floats) -> Floats:
    """Return the polyline without inner points that repeat or lie exactly on a straight line."""
    kept = [points[0]]
    for point in points[1:-1]:
        if not _same(kept[-1], point):
            _append(kept, point)
    if len(kept) > 1 and _same(kept[-1], points[-1]):
        kept.pop()
    _append(kept, points[-1])
    return np.array(kept)


def _append(kept: list[Floats], point: Floats) -> None:
    if len(kept) > 1:
        before, after = kept[-1] - kept[-2], point - kept[-1]
        if not np.cross(before, after).any() and before @ after > 0:
            kept.pop()
    kept.append(point)


def _same(a: Floats, b: Floats) -> bool:
    return bool(np.abs(a - b).max() < SAME + rounding_at(a, b))
