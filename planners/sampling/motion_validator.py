"""Where sampled states may be, whether edges between them are clear, and the poses along them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NoReturn, TypeAlias

import numpy as np
from scipy import ndimage

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
from planners.sampling.settings import TURNING, StateSpace
from planners.search.kernels.hybrid_astar import drive_along

Bounds: TypeAlias = tuple[float, ...]  # low x, low y, high x, high y [m, corner]
CHECKS: dict[str, Callable[..., bool]] = {
    "r2": line_clear_at,
    "se2": slide_clear_at,
    "dubins": dubins_clear_at,
    "reeds_shepp": reeds_shepp_clear_at,
}
# Of the arrays of a `Body`, as `planners.sampling.kernels.edges_at` reads them.
KINDS = (np.bool_, np.int64, np.float64, np.float64, np.int64, np.float64, np.float64)
REACH = 8.0  # how many times the mean clearance an edge is long, at most
SHARE = 0.2  # of the extent of what is sampled: OMPL's own choice


class MotionValidator:
    """The edges of a space over a costmap, each checked by one compiled call.

    States are x, y [m] from the map's outer corner and, but for "r2", a yaw [rad].

    Parameters
    ----------
    costmap : Costmap
    space : {"r2", "se2", "dubins", "reeds_shepp"}
        Between two states lies: the straight line of a disc that holds the footprint; the same
        for the footprint itself, turning evenly; the shortest curve.
    turning_radius : float [m]
        Of curves.

    Attributes
    ----------
    is_clear : callable
        Takes the numbers of two states; whether the footprint touches nothing in between.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), -1.0, dtype=np.float32)
    >>> field[20:, 30] = 1.0
    >>> grid.fuse(np.array([0, 0]), field)
    >>> problem = PlanningProblem(grid, start=(2, 2), goal=(30, 2), footprint=0.9)
    >>> ways = MotionValidator(Costmap.of(problem), "r2", 1.0)
    >>> start, low, high = (ways.state_of(xy) for xy in ((2, 2), (30, 2), (30, 20)))
    >>> ways.is_clear(*start, *low), ways.is_clear(*start, *high)
    (True, False)
    """

    is_clear: Callable[..., bool]

    def __init__(self, costmap: Costmap, space: StateSpace, turning_radius: float) -> None:
        self.costmap, self.space, self.turning_radius = costmap, space, turning_radius
        size = costmap.window.resolution
        ground = ground_of(costmap)
        self.shape = shape_of(costmap.problem.shape, size, slack=costmap.slack)
        self.body = Body(
            *ground,
            *self.shape[:3],
            np.array([size, turning_radius / size, *self.shape[3:]]),
        )
        self.is_clear = _bind(CHECKS[space], self.body)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make a copy or a pickle anew: an address is good for these arrays only."""
        return MotionValidator, (self.costmap, self.space, self.turning_radius)

    def state_of(self, pose: Pose) -> Pose:
        """Return a pose [map] as a state."""
        x, y = (np.asarray(pose[:2]) - self.costmap.window.origin).tolist()
        return (x, y) if self.space == "r2" else (x, y, wrap(pose[2]))

    def are_clear(self, states: Sequence[Pose]) -> bool:
        """Whether all edges of a path are clear."""
        return all(self.is_clear(*a, *b) for a, b in pairwise(states))

    def region(self, start: Pose) -> Bools:
        """Return the cells that can be reached from a start, shape (rows, cols), and some more.

        A cell is left out if at none of its places base_link is as far from what is blocked as
        the inscribed radius. So where a goal lies in no such cell, there is no route; where it
        does, there may be one.
        """
        footprint, size = self.costmap.problem.shape, self.costmap.window.resolution
        radius = footprint.radius if self.space == "r2" else footprint.inscribed_radius
        places = self.costmap.clearance + math.sqrt(0.5) * size >= radius
        if radius > 0.0 or self.space == "r2":  # else base_link may be over what is blocked
            places &= ~self.costmap.blocked
        regions, _ = ndimage.label(places, structure=np.ones((3, 3)))
        first = regions[self.cell_of(start)]
        reached: Bools = (regions == first) & places[self.cell_of(start)]
        return reached

    def cell_of(self, state: Pose) -> tuple[int, ...]:
        """Return the cell [row, col] of a state."""
        size = self.costmap.window.resolution
        return int(state[1] / size), int(state[0] / size)

    def room(self, start: Pose, goal: Pose) -> Bounds | None:
        """Return a box that holds all that can be reached, or None if the goal can't be."""
        region = self.region(start)
        return (
            box_of(region, self.costmap.window.resolution) if region[self.cell_of(goal)] else None
        )

    def reach(self, region: Bools, room: Bounds) -> float:
        """Return how long edges should be at most [m]: so long that many of them are clear.

        That is some times the mean clearance in a region, and no more than OMPL's own choice, which
        knows nothing but the extent of what it samples.
        """
        extent = math.hypot(room[2] - room[0], room[3] - room[1])
        return min(REACH * float(self.costmap.clearance[region].mean()), SHARE * extent)

    def poses(self, states: Sequence[Pose]) -> Floats:
        """Return the poses of base_link along a path, shape (n, 2) or (n, 3) [m, map; rad].

        In "r2" these are the states; else they are as dense as the edges were checked.
        """
        if self.space == "r2":
            poses = np.array(states)
        else:
            edges = [self._edge(a, b) for a, b in pairwise(states)]
            poses = np.concatenate([*edges, np.array(states[-1:])])
        poses[:, :2] += self.costmap.window.origin
        return poses

    def length(self, states: Sequence[Pose]) -> float:
        """Return the length of a path [m]."""
        return float(np.hypot(*np.diff(self.poses(states)[:, :2], axis=0).T).sum())

    def _edge(self, a: Pose, b: Pose) -> Floats:
        """Return the poses along an edge without its last one."""
        if self.space == "reeds_shepp" and comes_later(*a, *b):
            there = _curve(self.body.numbers, self.shape, b, a, forward=False)
            return there[:0:-1]
        if self.space not in TURNING:
            turn = wrap(b[2] - a[2])
            size = self.costmap.window.resolution
            steps = slide_steps(self.shape, math.hypot(b[0] - a[0], b[1] - a[1]) / size, turn)
            change = np.array([b[0] - a[0], b[1] - a[1], turn])
            slide: Floats = np.array(a) + np.arange(steps)[:, None] / steps * change
            return slide
        return _curve(self.body.numbers, self.shape, a, b, forward=self.space == "dubins")[:-1]


def box_of(region: Bools, size: float) -> Bounds:
    """Return the box around the cells of a region: low x, y, high x, y [m, corner].

    Examples
    --------
    >>> box_of(np.eye(4, dtype=bool)[1:3], 0.5)
    (0.5, 0.0, 1.5, 1.0)
    """
    axes = range(region.ndim)[::-1]
    lines = [np.flatnonzero(region.any(axis=tuple(k for k in axes if k != axis))) for axis in axes]
    edges = [line[0] for line in lines] + [line[-1] + 1 for line in lines]
    return tuple(size * float(edge) for edge in edges)


class _Kept:
    """Keeps the arrays alive whose address a check has: an address alone keeps nothing.

    A deep copy or a pickle of the check would hold the address of arrays that it does not keep.
    """

    def __init__(self, table: Ints, arrays: list[Any]) -> None:
        self.table, self.arrays = table, arrays

    def __reduce__(self) -> NoReturn:
        expected = "is_clear can't be copied or pickled: it holds the address of its own arrays"
        raise TypeError(f"{expected}. Copy or pickle its Ways instead.")


def _bind(check: Callable[..., bool], body: Body) -> Callable[..., bool]:
    """Return a check that is told once where the arrays are which it reads."""
    arrays = [np.ascontiguousarray(*pair) for pair in zip(body, KINDS, strict=True)]
    words = [(array.ctypes.data, *array.shape, 1)[:WORDS] for array in arrays]
    table = np.array(words, dtype=np.int64)
    bound = partial(check, table.ctypes.data)
    vars(bound)["kept"] = _Kept(table, arrays)
    return bound


def _curve(numbers: Floats, shape: Shape, a: Pose, b: Pose, *, forward: bool) -> Floats:
    """Return the poses along a curve, both ends included."""
    size = numbers[0]
    curvatures, lengths = curve_motions(forward, numbers, *a, *b)
    start = np.array([a[0] / size, a[1] / size, a[2]])
    poses: Floats = drive_along(shape, start, curvatures, lengths)
    poses[:, :2] *= size
    return poses
