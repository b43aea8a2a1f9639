"""A* in 3-D: the shortest route over the moves between neighbouring voxels."""

from __future__ import annotations

import itertools
import math

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.endpoints import Ends, centres_around
from planners.costmap.kernels.moves import ONE
from planners.costmap.voxel_map import Voxels
from planners.geometry.kernels.clearance3d import segment_clearance
from planners.geometry.polyline import SAME
from planners.geometry.rounding import rounding_at
from planners.problem.problem import Pose
from planners.search.grid_search import GridQuery, GridSearch
from planners.search.kernels.astar import FAR, TARGET
from planners.search.kernels.astar3d import MARK, ROOT, advance, plates_of, seed, trace


class AStar3D(GridSearch):
    """A* over the 26 moves between voxel centres; every voxel of a move's box must be free.

    Start and goal are joined to the up to eight centres around them by straight pieces.

    Parameters
    ----------
    voxels : Voxels

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> from planners.search.base import SearchSettings
    >>> grid = ConfidenceGrid(resolution=1.0, origin=(0, 0, 0))
    >>> grid.fuse(np.array([0, 0, 0]), np.full((16, 16, 16), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(3.5, 3.5, 3.5), goal=(9.5, 7.5, 5.5), footprint=2)
    >>> astar = AStar3D(Voxels.of(problem))
    >>> astar.search(problem.start, problem.goal, SearchSettings()).waypoints.tolist()
    [[3.5, 3.5, 3.5], [5.5, 5.5, 5.5], [7.5, 7.5, 5.5], [9.5, 7.5, 5.5]]
    """

    name = "astar"

    def __init__(self, voxels: Voxels) -> None:
        super().__init__()
        self.voxels = voxels
        self.traversable = np.pad(voxels.traversable, 1)  # so that no move leaves the arrays
        _, rows, self.width = self.traversable.shape
        self.slab = rows * self.width
        self.plates = plates_of(self.traversable)
        self.labels = np.zeros((self.traversable.size, 2), dtype=np.int64)
        self.queries = 0

    def _join(self, start: Pose, goal: Pose) -> Ends:
        a, b = self.voxels.to_cells([start[:3], goal[:3]])
        direct = self._is_clear(a, b)
        sources, targets = (self._voxels_around(place) for place in (start, goal))
        if len(sources) == 0 or len(targets) == 0:
            sources, targets = sources[:0], targets[:0]
        return Ends(sources, targets, direct)

    def _seed(self, query: GridQuery) -> None:
        self.queries += 1
        mark = MARK * self.queries + ROOT
        size = seed(*query.ends[:2], self.width, self.slab, mark, self.labels, self.heap)
        self.state = np.array([size, FAR, -1, 0], dtype=np.int64)

    def _advance(self, query: GridQuery) -> int:
        return advance(
            self.plates,
            self.width,
            self.slab,
            query.ends.targets,
            self.labels,
            self.queries,
            self.heap,
            self.state,
            self.slice_size,
        )

    def _trace(self) -> Ints:
        turns = trace(self.labels, self.width, self.slab, int(self.state[TARGET]))[::-1]
        return np.column_stack(np.unravel_index(turns, self.traversable.shape)) - 1

    def _line(self, query: GridQuery, cells: Ints) -> Floats:
        centres = self.voxels.window.cell_to_world(cells)
        return _merge_collinear(np.concatenate([[query.start[:3]], centres, [query.goal[:3]]]))

    def _voxels_around(self, place: Pose) -> Ints:
        """Return the padded voxels that a place [m, map] is joined to, shape (n, 4).

        Layer, row, column and cost.
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
        """Whether the piece a-b [voxels] spans at most 2 x 2 x 2 voxels and keeps its clearance."""
        low, high = np.floor(np.minimum(a, b)).astype(int), np.floor(np.maximum(a, b)).astype(int)
        blocked = self.voxels.blocked
        if (low < 0).any() or (high[::-1] >= blocked.shape).any() or (high - low > 1).any():
            return False
        box = tuple(slice(i, j + 1) for i, j in zip(low[::-1], high[::-1], strict=True))
        if blocked[box].any():
            return False
        need = (self.voxels.radius - self.voxels.slack) / self.voxels.window.resolution
        return need <= 0 or segment_clearance(blocked, a, b, need) >= need


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
        last, step = kept[-1] - kept[-2], point - kept[-1]
        if not np.cross(last, step).any() and last @ step > 0:
            kept.pop()
    kept.append(point)


def _same(a: Floats, b: Floats) -> bool:
    return bool(np.abs(a - b).max() < SAME + rounding_at(a, b))
