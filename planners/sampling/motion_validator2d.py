"""Validation of states and edges over a costmap: places or poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NoReturn

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.swept_footprint import ground_of, shape_of
from planners.geometry.kernels.curves import wrap
from planners.geometry.kernels.swept_footprint import Shape
from planners.problem.problem import Pose
from planners.sampling.kernels.addresses import WORDS
from planners.sampling.kernels.edges import Body, comes_later, curve_motions, slide_steps
from planners.sampling.kernels.edges_at import (
    dubins_clear_at,
    line_clear_at,
    reeds_shepp_clear_at,
    slide_clear_at,
)
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.settings import TURNING, StateSpace
from planners.search.kernels.hybrid_astar import drive_along

EDGE_CHECKS: dict[str, Callable[..., bool]] = {
    "r2": line_clear_at,
    "se2": slide_clear_at,
    "dubins": dubins_clear_at,
    "reeds_shepp": reeds_shepp_clear_at,
}
# Types of the arrays of a `Body`, as `planners.sampling.kernels.edges_at` reads them.
BODY_TYPES = (np.bool_, np.int64, np.float64, np.float64, np.int64, np.float64, np.float64)


class MotionValidator2D(MotionValidator):
    """Edges between places or poses over a costmap.

    Parameters
    ----------
    costmap : Costmap
    space : {"r2", "se2", "dubins", "reeds_shepp"}
        An edge is, in r2, the straight line of the disc around the footprint; in se2, that of the
        footprint itself with its yaw interpolated linearly; else the shortest curve.
    turning_radius : float [m]
        Of curves.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), -1.0, dtype=np.float32)
    >>> field[20:, 30] = 1.0
    >>> grid.fuse(np.array([0, 0]), field)
    >>> problem = PlanningProblem(grid, start=(2, 2), goal=(30, 2), footprint=0.9)
    >>> validator = MotionValidator2D(Costmap.of(problem), "r2", 1.0)
    >>> start, low, high = (validator.state_of(xy) for xy in ((2, 2), (30, 2), (30, 20)))
    >>> validator.is_clear(*start, *low), validator.is_clear(*start, *high)
    (True, False)
    """

    costmap: Costmap

    def __init__(self, costmap: Costmap, space: StateSpace, turning_radius: float) -> None:
        self.costmap, self.space, self.turning_radius = costmap, space, turning_radius
        size = costmap.window.resolution
        self.shape = shape_of(costmap.problem.shape, size, slack=costmap.slack)
        numbers = np.array([size, turning_radius / size, *self.shape[3:]])
        self.body = Body(*ground_of(costmap), *self.shape[:3], numbers)
        self.is_clear = _bind(EDGE_CHECKS[space], self.body)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return a recipe that rebuilds the object: its addresses are valid for its own arrays."""
        return MotionValidator2D, (self.costmap, self.space, self.turning_radius)

    def _possibly_clear(self) -> Bools:
        footprint, size = self.costmap.problem.shape, self.costmap.window.resolution
        radius = footprint.radius if self.space == "r2" else footprint.inscribed_radius
        cells: Bools = self.costmap.clearance + math.sqrt(0.5) * size >= radius
        if radius > 0.0 or self.space == "r2":  # else base_link may be over a blocked cell
            cells &= ~self.costmap.blocked
        return cells

    def _mean_clearance(self, region: Bools) -> float:
        return float(self.costmap.clearance[region].mean())

    def _interpolate(self, states: Sequence[Pose]) -> Floats:
        if self.space == "r2":
            return super()._interpolate(states)
        edges = [self._edge(a, b) for a, b in pairwise(states)]
        return np.concatenate([*edges, np.array(states[-1:])])

    def _edge(self, a: Pose, b: Pose) -> Floats:
        """Return the poses along an edge without its last one."""
        if self.space == "reeds_shepp" and comes_later(*a, *b):
            backwards = _curve(self.body.numbers, self.shape, b, a, forward=False)
            return backwards[:0:-1]
        if self.space in TURNING:
            forward = self.space == "dubins"
            return _curve(self.body.numbers, self.shape, a, b, forward=forward)[:-1]
        change = np.array([b[0] - a[0], b[1] - a[1], wrap(b[2] - a[2])])
        length = math.hypot(change[0], change[1]) / self.costmap.window.resolution
        steps = slide_steps(self.shape, length, float(change[2]))
        slide: Floats = np.array(a) + np.arange(steps)[:, None] / steps * change
        return slide


class _ArrayOwner:
    """Keeps the arrays alive whose addresses a check uses.

    A deep copy or a pickle of the check would refer to arrays that it does not own.
    """

    def __init__(self, table: Ints, arrays: list[Any]) -> None:
        self.table, self.arrays = table, arrays

    def __reduce__(self) -> NoReturn:
        expected = "is_clear can't be copied or pickled: it holds the address of its own arrays"
        raise TypeError(f"{expected}. Copy or pickle its MotionValidator2D instead.")


def _bind(check: Callable[..., bool], body: Body) -> Callable[..., bool]:
    """Return a check that is bound to the addresses of the arrays of a body."""
    arrays = [np.ascontiguousarray(*pair) for pair in zip(body, BODY_TYPES, strict=True)]
    words = [(array.ctypes.data, *array.shape, 1)[:WORDS] for array in arrays]
    table = np.array(words, dtype=np.int64)
    bound = partial(check, table.ctypes.data)
    vars(bound)["owner"] = _ArrayOwner(table, arrays)
    return bound


def _curve(numbers: Floats, shape: Shape, a: Pose, b: Pose, *, forward: bool) -> Floats:
    """Return the poses along a curve, both ends included."""
    size = numbers[0]
    curvatures, lengths = curve_motions(forward, numbers, *a, *b)
    start = np.array([a[0] / size, a[1] / size, a[2]])
    poses: Floats = drive_along(shape, start, curvatures, lengths)
    poses[:, :2] *= size
    return poses
