"""Where a ball may be that is sampled on a 3-D map, and whether lines between places are clear."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from scipy import ndimage

from groundmap.arrays import Bools, Floats, Ints32
from planners.costmap.kernels.distance import NOWHERE
from planners.costmap.voxel_map import Voxels
from planners.problem.problem import Pose
from planners.sampling.kernels.edges3d import line_clear
from planners.sampling.motion_validator import REACH, SHARE, Bounds, box_of
from planners.sampling.settings import StateSpace

DISTANCE_TOLERANCE = 1e-12  # relative error granted to distances


class MotionValidator3D:
    """The straight lines of a ball among voxels, each checked by one compiled call.

    The 3-D twin of `planners.sampling.motion_validator.MotionValidator`. States are x, y, z [m]
    from the map's outer corner.

    Parameters
    ----------
    voxels : Voxels

    Attributes
    ----------
    voxels, costmap : Voxels
        What `MotionValidator` calls so, too.
    is_clear : callable
        Takes the numbers of two states; whether the ball touches nothing in between.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    >>> field = np.full((16, 16, 16), -1.0, dtype=np.float32)
    >>> field[:6, :, 8] = 1.0
    >>> grid.fuse(np.array([0, 0, 0]), field)
    >>> problem = PlanningProblem(grid, start=(2, 4, 2), goal=(7, 4, 2), footprint=0.9)
    >>> ways = MotionValidator3D(Voxels.of(problem))
    >>> start, goal, over = (ways.state_of(xyz) for xyz in ((2, 4, 2), (7, 4, 2), (4, 4, 6)))
    >>> ways.is_clear(*start, *goal), ways.is_clear(*start, *over), ways.is_clear(*over, *goal)
    (False, True, True)
    >>> ways.room(start, goal)
    (1.5, 1.5, 1.5, 8.5, 8.5, 8.5)
    """

    space: StateSpace = "r3"
    is_clear: Callable[..., bool]

    def __init__(self, voxels: Voxels) -> None:
        self.voxels = self.costmap = voxels
        self.squared = voxels.all_squared
        numbers = voxels.window.resolution, voxels.radius, voxels.slack
        self.is_clear = partial(line_clear, self.squared, *numbers)

    def state_of(self, pose: Pose) -> Pose:
        """Return a pose [map] as a state; a yaw is left out."""
        x, y, z = (np.asarray(pose[:3]) - self.voxels.window.origin).tolist()
        return x, y, z

    def are_clear(self, states: Sequence[Pose]) -> bool:
        """Whether all edges of a path are clear."""
        return all(self.is_clear(*a, *b) for a, b in pairwise(states))

    def region(self, start: Pose) -> Bools:
        """Return the voxels that can be reached from a start, and some more.

        A voxel is left out if the ball is clear at none of its places. So where a goal lies in no
        such voxel, there is no route; where it does, there may be one.

        Returns
        -------
        ndarray of bool, shape (layers, rows, cols)
        """
        first = self._part_of(start)
        region: Bools = np.logical_and(self._parts == first, first > 0)
        return region

    def cell_of(self, state: Pose) -> tuple[int, ...]:
        """Return the voxel [layer, row, col] of a state."""
        size = self.voxels.window.resolution
        return int(state[2] / size), int(state[1] / size), int(state[0] / size)

    def room(self, start: Pose, goal: Pose) -> Bounds | None:
        """Return a box that holds all that can be reached, or None if the goal can't be.

        It is that of the region: low x, y, z, high x, y, z [m, corner].
        """
        first = self._part_of(start)
        if first == 0 or first != self._part_of(goal):
            return None
        return box_of(self._parts == first, self.voxels.window.resolution)

    def reach(self, region: Bools, room: Bounds) -> float:
        """Return how long edges should be at most [m], as `MotionValidator.reach` does."""
        extent = math.dist(room[:3], room[3:])
        halves = float(np.sqrt(self.squared[region]).mean())
        return min(REACH * 0.5 * halves * self.voxels.window.resolution, SHARE * extent)

    def poses(self, states: Sequence[Pose]) -> Floats:
        """Return the places along a path, shape (n, 3) [m, map]."""
        poses: Floats = np.array(states) + self.voxels.window.origin
        return poses

    def _part_of(self, state: Pose) -> int:
        return int(self._parts[self.cell_of(state)])

    @cached_property
    def _parts(self) -> Ints32:
        """Parts of the map that no way joins, numbered from 1; 0 where the ball is never clear."""
        # In half voxels; a corner is √3 of them from the centre, and may be that much clearer.
        least_clearance = self.voxels.radius - self.voxels.slack
        need = 2.0 * least_clearance / self.voxels.window.resolution - math.sqrt(3.0)
        places = self.squared > 0
        if need > 0.0:
            least = math.ceil(need * need * (1.0 - DISTANCE_TOLERANCE))
            places &= self.squared >= min(least, NOWHERE)
        parts: Ints32 = ndimage.label(places, structure=np.ones((3, 3, 3)))[0]
        return parts
