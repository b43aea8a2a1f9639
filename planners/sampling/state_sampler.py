"""Clear states at random: drawn from the cells that can be reached, so narrow maps don't starve."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from groundmap.arrays import Bools
from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.settings import FLAT

BATCH = 1024  # states drawn at once
TRIES = 50  # for one that is clear


class StateSampler:
    """Clear states of a space, one after another.

    Parameters
    ----------
    validator : MotionValidator
    region : ndarray of bool, shape (rows, cols)
        Cells to draw from; on voxels of shape (layers, rows, cols).
    seed : int
    yaw_weight : float [m/rad]
        How far away a turn is, for states near another.
    first : iterable of states
        Handed out before any others.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.costmap.costmap import Costmap
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), 1.0, dtype=np.float32)
    >>> field[20:24] = -1.0
    >>> grid.fuse(np.array([0, 0]), field)
    >>> problem = PlanningProblem(grid, start=(2, 11), goal=(30, 11), footprint=0.9)
    >>> validator = MotionValidator(Costmap.of(problem), "r2", 1.0)
    >>> start = validator.state_of((2, 11))
    >>> draws = StateSampler(validator, validator.region(start), seed=0)
    >>> all(validator.is_clear(*2 * draws.anywhere()) for _ in range(100))
    True
    """

    def __init__(
        self,
        validator: MotionValidator | MotionValidator3D,
        region: Bools,
        *,
        seed: int,
        yaw_weight: float = 1.0,
        first: Iterable[Pose] = (),
    ) -> None:
        self.validator, self.size = validator, validator.costmap.window.resolution
        self.cells, self.shape = np.flatnonzero(region), region.shape
        self.random = np.random.default_rng(seed)
        self.yaw_weight = yaw_weight
        self._first = iter(tuple(first))
        self._others = self._draw()

    def anywhere(self) -> Pose | None:
        """Return a clear state, or None if none was found."""
        state = next(self._first, None)
        if state is not None:
            return state
        return next(filter(self._is_clear, (next(self._others) for _ in range(TRIES))), None)

    def near(self, state: Pose, distance: float) -> Pose | None:
        """Return a clear state in the box of half a side `distance` [m] around another, or None."""
        reach = np.full(len(state), distance)
        if self.validator.space not in FLAT:
            reach[2] = min(distance / self.yaw_weight, math.pi)
        offsets = self.random.uniform(-1.0, 1.0, (TRIES, len(state))) * reach
        for near in (np.array(state) + offsets).tolist():
            if self._is_clear(tuple(near)):
                return tuple(near)
        return None

    def _is_clear(self, state: Pose) -> bool:
        return self.validator.is_clear(*state, *state)

    def _draw(self) -> Iterator[Pose]:
        """Yield states in the cells of the region, evenly, and any yaw; clear or not."""
        while True:
            drawn = self.cells[self.random.integers(len(self.cells), size=BATCH)]
            cells = np.column_stack(np.unravel_index(drawn, self.shape)[::-1])  # x, y (, z)
            states = (cells + self.random.random(cells.shape)) * self.size
            if self.validator.space not in FLAT:
                yaws = self.random.uniform(-math.pi, math.pi, BATCH)
                states = np.column_stack([states, yaws])
            yield from map(tuple, states.tolist())
