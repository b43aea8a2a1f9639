"""Which voxels of a 3-D map are traversable: the counterpart of the costmap."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Counts, Floats, Floats32, Ints, Ints32
from planners.costmap.extent import padded_box
from planners.costmap.kernels.distance import NOWHERE, fill_squared_distances_3d
from planners.costmap.layers import occupancy_of
from planners.costmap.map_space import MapSpace
from planners.costmap.moves import squared_need
from planners.errors import ProblemError
from planners.geometry.kernels.clearance3d import squared_along
from planners.problem.problem import PlanningProblem

FARTHEST_SQUARED = np.iinfo(np.uint16).max  # [(half voxels)²]: 128 voxels


@dataclass(frozen=True, eq=False)
class Voxels(MapSpace):
    """Which voxels are blocked, and on whose centres the footprint's centre may be.

    The footprint is a ball. The attributes are those of `MapSpace`.

    Examples
    --------
    >>> import numpy as np
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    >>> grid.fuse(np.array([0, 0, 0]), np.full((16, 16, 16), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(4, 4, 4), goal=(5, 5, 5), footprint=0.8)
    >>> voxels = Voxels.of(problem)
    >>> voxels.blocked.shape, int(voxels.traversable.sum()), voxels.clearance_of((4, 4, 2))
    ((20, 20, 20), 1728, 2.0)
    """

    @classmethod
    def of(cls, problem: PlanningProblem) -> Voxels:
        """Return the voxels of a problem on a 3-D map whose start is on the map.

        Raises
        ------
        ProblemError
            A 2-D map, one with too many voxels, or costs other than length.
        """
        problem.check_dimensions(3)
        if problem.unknown == "penalise":
            raise ProblemError("unknown", "'avoid' or 'allow' on a 3-D map", "'penalise'")
        if problem.costs.top(penalise=False) > 0:
            expected = "no costs except length on a 3-D map"
            raise ProblemError("costs", expected, repr(problem.costs))
        box = padded_box(problem)
        masks = tuple(np.zeros(box.shape, dtype=np.bool_) for _ in range(3))
        layer = 0
        for slab in box.slabs():  # a dense window of a large map would need ten times the memory
            layers = slice(layer, layer + slab.shape[0])
            occupancy = occupancy_of(problem, problem.grid.read(slab))
            for mask, part in zip(masks, occupancy, strict=False):
                mask[layers] = part
            layer = layers.stop
        return cls(problem, box, *masks)

    @cached_property
    def traversable(self) -> Bools:
        """Voxels on whose centre the footprint's centre may be, shape (layers, rows, cols)."""
        return self.traversable_for(self.radius) if self.radius > 0 else ~self.blocked

    @cached_property
    def near_squared(self) -> npt.NDArray[np.unsignedinteger[Any]]:
        """Squared distances as in `all_squared`, but cut to a cap, in half of its memory or more.

        The cap is that of 16 bits, or what the radius needs: a larger distance only tells that the
        next blocked voxel is farther away.
        """
        need = squared_need(self.radius + self.slack, self.window.resolution)
        cap = min(max(FARTHEST_SQUARED, need), NOWHERE)
        kind = np.uint16 if cap == FARTHEST_SQUARED else np.uint32
        squared = np.empty(self.blocked.shape, dtype=kind)
        fill_squared_distances_3d(self.blocked, cap, squared)
        return squared

    def traversable_for(self, radius: float) -> Bools:
        """Return where the centre of a ball of another radius [m] may be."""
        if radius > self.radius:
            return super().traversable_for(radius)
        need = squared_need(radius, self.window.resolution)
        return ~self.blocked & (self.near_squared >= need)

    def _squared_at(self, cells: Ints) -> Ints32:
        # A box around a long line would be most of the map.
        return squared_along(self.blocked, cells, NOWHERE).astype(np.int32)

    def evidence_at(self, cells: Ints) -> tuple[Floats32, Counts]:
        """Return the confidence and the count of voxels of the map, shape (n,) each."""
        grid, centres = self.problem.grid, self.window.cell_to_world(cells)
        return np.asarray(grid.confidence_at(centres)), np.asarray(grid.count_at(centres))

    @property
    def uniform(self) -> bool:
        """Whether all voxels have the same cost: always."""
        return True

    def weights_at(self, cells: Ints) -> Floats:
        """Return what a metre costs in voxels, given by their indices: 1, shape (n,) [m/m]."""
        return np.ones(len(cells))
