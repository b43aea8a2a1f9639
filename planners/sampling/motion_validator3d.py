"""Validation of the places of a ball, and of the lines between them, on a 3-D map."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from groundmap.arrays import Bools
from groundmap.grid.window import slabs
from planners.costmap.kernels.distance import NOWHERE
from planners.costmap.voxel_map import Voxels
from planners.sampling.kernels.edges3d import line_clear
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.settings import StateSpace

DISTANCE_TOLERANCE = 1e-12  # relative rounding error of distances


class MotionValidator3D(MotionValidator):
    """Straight lines of a ball between places among voxels.

    Parameters
    ----------
    costmap : Voxels

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    >>> field = np.full((16, 16, 16), -1.0, dtype=np.float32)
    >>> field[:6, :, 8] = 1.0
    >>> grid.fuse(np.array([0, 0, 0]), field)
    >>> problem = PlanningProblem(grid, start=(2, 4, 2), goal=(7, 4, 2), footprint=0.9)
    >>> validator = MotionValidator3D(Voxels.of(problem))
    >>> places = (2, 4, 2), (7, 4, 2), (4, 4, 6)
    >>> start, goal, above = (validator.state_of(place) for place in places)
    >>> validator.is_clear(*start, *goal), validator.are_clear([start, above, goal])
    (False, True)
    >>> validator.bounds(start, goal)
    (1.5, 1.5, 1.5, 8.5, 8.5, 8.5)
    """

    costmap: Voxels
    space: StateSpace = "r3"

    def __init__(self, costmap: Voxels) -> None:
        self.costmap = costmap
        self.squared = costmap.near_squared
        numbers = costmap.window.resolution, costmap.radius, costmap.slack
        self.is_clear = partial(line_clear, self.squared, *numbers)

    def _possibly_clear(self) -> Bools:
        # In half voxels; a corner is √3 of them from the centre, so its clearance may be that much
        # larger.
        least_clearance = self.costmap.radius - self.costmap.slack
        need = 2.0 * least_clearance / self.costmap.window.resolution - math.sqrt(3.0)
        cells: Bools = self.squared > 0
        if need > 0.0:
            least = math.ceil(need * need * (1.0 - DISTANCE_TOLERANCE))
            cells &= self.squared >= min(least, NOWHERE)
        return cells

    def _mean_clearance(self, region: Bools) -> float:
        total = sum(
            float(np.sqrt(self.squared[part][region[part]], dtype=np.float64).sum())
            for part in slabs(region.shape)
        )
        return 0.5 * total / np.count_nonzero(region) * self.costmap.window.resolution
