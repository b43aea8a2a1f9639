"""A* in 3-D: the shortest route over the moves between neighbouring voxels."""

from __future__ import annotations

import mmap

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.endpoints import Ends, ends_of, waypoints_through
from planners.costmap.voxel_map import Voxels
from planners.problem.problem import Pose
from planners.search.grid_search import GridQuery, GridSearch
from planners.search.kernels.astar import TARGET
from planners.search.kernels.astar3d import CHUNK, USED, advance, seed, trace
from planners.search.kernels.voxel_moves import bits_of

SMALL_PAGES = getattr(mmap, "MADV_NOHUGEPAGE", None)
BORDER = np.array([1, 1, 1, 0])  # indices of the search count its border; costs do not


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
        self.bits = bits_of(voxels.traversable)  # with a border, so that no move leaves it
        layers, rows, cols = (side + 2 for side in voxels.blocked.shape)
        self.width, self.slab = cols, rows * cols
        chunks = -(-layers * self.slab // CHUNK)
        self.labels = zeros_on_demand(chunks * CHUNK)
        self.touched = np.zeros(chunks, dtype=np.bool_)
        self.chunks = np.zeros(chunks, dtype=np.int64)
        self.state = np.zeros(USED + 1, dtype=np.int64)

    def _join(self, start: Pose, goal: Pose) -> Ends:
        sources, targets, direct = ends_of(self.voxels, start, goal)
        return Ends(sources + BORDER, targets + BORDER, direct)

    def _seed(self, query: GridQuery) -> None:
        seed(
            query.ends.sources,
            query.ends.targets,
            self.width,
            self.slab,
            self.labels,
            self.touched,
            self.chunks,
            self.heap,
            self.state,
        )

    def _advance(self, query: GridQuery) -> int:
        plane, stride = self.bits.strides[:2]
        return advance(
            self.bits.ravel(),
            plane,
            stride,
            self.width,
            self.slab,
            query.ends.targets,
            self.labels,
            self.touched,
            self.chunks,
            self.heap,
            self.state,
            self.slice_size,
        )

    def _trace(self) -> Ints:
        turns = trace(self.labels, self.width, self.slab, int(self.state[TARGET]))[::-1]
        shape = [side + 2 for side in self.voxels.blocked.shape]
        return np.column_stack(np.unravel_index(turns, shape)) - 1

    def _line(self, query: GridQuery, cells: Ints) -> Floats:
        return waypoints_through(self.voxels, query.start, query.goal, cells)


def zeros_on_demand(count: int) -> Ints:
    """Return zeros that take memory only where they are written, in the system's smallest pages.

    NumPy asks for huge pages, of which a route across a map would touch most.

    Examples
    --------
    >>> zeros_on_demand(3)
    array([0, 0, 0])
    """
    size = 8 * count
    if SMALL_PAGES is None:
        return np.zeros(count, dtype=np.int64)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    memory.madvise(SMALL_PAGES)
    return np.frombuffer(memory, dtype=np.int64)
