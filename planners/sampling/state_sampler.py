"""Random clear states, sampled uniformly from the reachable cells."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from groundmap.arrays import Bools
from planners.costmap.regions import CellSample
from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.settings import FLAT

BATCH = 1024  # number of states drawn at once
MAX_ATTEMPTS = 50  # states tried for one that is clear


class StateSampler:
    """Samples clear states of a space.

    Sampling only reachable cells keeps the share of clear samples high on narrow maps.

    Parameters
    ----------
    validator : MotionValidator
    region : ndarray of bool, shape (rows, cols)
        Cells to sample; on voxels of shape (layers, rows, cols).
    seed : int
    yaw_weight : float [m/rad]
        Length that a radian counts as in `sample_near`.
    first : iterable of states
        Returned before any random ones.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.costmap.costmap import Costmap
    >>> from planners.problem.problem import PlanningProblem
    >>> from planners.sampling.motion_validator2d import MotionValidator2D
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), 1.0, dtype=np.float32)
    >>> field[20:24] = -1.0
    >>> grid.fuse(np.array([0, 0]), field)
    >>> problem = PlanningProblem(grid, start=(2, 11), goal=(30, 11), footprint=0.9)
    >>> validator = MotionValidator2D(Costmap.of(problem), "r2", 1.0)
    >>> start = validator.state_of((2, 11))
    >>> sampler = StateSampler(validator, validator.region(start), seed=0)
    >>> all(validator.is_clear(*2 * sampler.sample()) for _ in range(100))
    True
    """

    def __init__(
        self,
        validator: MotionValidator,
        region: Bools,
        *,
        seed: int,
        yaw_weight: float = 1.0,
        first: Iterable[Pose] = (),
    ) -> None:
        self.validator, self.size = validator, validator.costmap.window.resolution
        self.cells = CellSample(region)
        self.random = np.random.default_rng(seed)
        self.yaw_weight = yaw_weight
        self._first = iter(tuple(first))
        self._others = self._draw()

    def sample(self) -> Pose | None:
        """Return a clear state, or None if no attempt was clear."""
        state = next(self._first, None)
        if state is not None:
            return state
        attempts = (next(self._others) for _ in range(MAX_ATTEMPTS))
        return next(filter(self._is_clear, attempts), None)

    def sample_near(self, state: Pose, distance: float) -> Pose | None:
        """Return a clear state in a box around another, or None if no attempt was clear.

        Parameters
        ----------
        state : state
            Centre of the box.
        distance : float [m]
            Half of its sides.
        """
        half_sides = np.full(len(state), distance)
        if self.validator.space not in FLAT:
            half_sides[2] = min(distance / self.yaw_weight, math.pi)
        offsets = self.random.uniform(-1.0, 1.0, (MAX_ATTEMPTS, len(state))) * half_sides
        attempts = map(tuple, (np.array(state) + offsets).tolist())
        return next(filter(self._is_clear, attempts), None)

    def _is_clear(self, state: Pose) -> bool:
        return self.validator.is_clear(*state, *state)

    def _draw(self) -> Iterator[Pose]:
        """Yield states, clear or not, uniformly from the cells of the region and all yaws."""
        while True:
            cells = self.cells.draw(self.random, BATCH)[:, ::-1]  # x, y (, z)
            states = (cells + self.random.random(cells.shape)) * self.size
            if self.validator.space not in FLAT:
                yaws = self.random.uniform(-math.pi, math.pi, BATCH)
                states = np.column_stack([states, yaws])
            yield from map(tuple, states.tolist())
