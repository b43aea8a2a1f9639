"""Validation of sampled states and of the edges between them, on a map of any dimension."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from groundmap.arrays import Bools, Floats
from planners.costmap.costmap import Costmap
from planners.costmap.regions import connected_to
from planners.costmap.voxel_map import Voxels
from planners.geometry.kernels.curves import wrap
from planners.problem.problem import Pose
from planners.sampling.settings import FLAT, StateSpace

Bounds: TypeAlias = tuple[float, ...]  # low x, y (, z), high x, y (, z) [m, corner]
CLEARANCE_FACTOR = 8.0  # longest edge over the mean clearance
EXTENT_FACTOR = 0.2  # longest edge over the extent of the sampled box, as in OMPL


class MotionValidator(ABC):
    """Edges between states on a map, each checked by one compiled call.

    A state is a position [m] from the map's outer corner and, except in flat spaces, a yaw [rad].

    Attributes
    ----------
    costmap : Costmap or Voxels
    space : {"r2", "se2", "dubins", "reeds_shepp", "r3"}
    is_clear : callable
        Takes the coordinates of two states; returns whether the footprint overlaps nothing blocked
        anywhere between them.
    """

    costmap: Costmap | Voxels
    space: StateSpace
    is_clear: Callable[..., bool]

    @property
    def axes(self) -> int:
        """Number of the map's axes."""
        return self.costmap.blocked.ndim

    def state_of(self, pose: Pose) -> Pose:
        """Return a pose [map] as a state; flat spaces drop its yaw."""
        position = (np.asarray(pose[: self.axes]) - self.costmap.window.origin).tolist()
        return tuple(position) if self.space in FLAT else (*position, wrap(pose[self.axes]))

    def cell_of(self, state: Pose) -> tuple[int, ...]:
        """Return the cell [row, col] of a state, or its voxel [layer, row, col]."""
        size = self.costmap.window.resolution
        return tuple(int(value / size) for value in reversed(state[: self.axes]))

    def are_clear(self, states: Sequence[Pose]) -> bool:
        """Whether all edges of a path are clear."""
        return all(self.is_clear(*a, *b) for a, b in pairwise(states))

    def region(self, start: Pose) -> Bools:
        """Return a superset of the cells that can be reached from a start.

        A cell is left out if no position in it can be clear. A goal outside the region therefore
        has no route; a goal inside it may have one.

        Returns
        -------
        ndarray of bool, shape (rows, cols) or (layers, rows, cols)
            Shared with other calls: it must not be changed.
        """
        cell = self.cell_of(start)
        if not self._last_region[cell]:
            # The region of another start is the same one, or has no cell in common with it.
            cells = self._possibly_clear()
            self._last_region = connected_to(cells, np.array([cell]), corners=True)
        return self._last_region

    def bounds(self, start: Pose, goal: Pose) -> Bounds | None:
        """Return the bounding box of the region of a start, or None if the goal is outside it.

        Parameters
        ----------
        start, goal : state

        Returns
        -------
        tuple of float
            Low x, y (, z), high x, y (, z) [m, corner].
        """
        region = self.region(start)
        if not region[self.cell_of(goal)]:
            return None
        return box_of(region, self.costmap.window.resolution)

    def max_edge_length(self, region: Bools, bounds: Bounds) -> float:
        """Return an edge length [m] up to which many edges are clear.

        It is proportional to the mean clearance in a region, and at most OMPL's own default, which
        depends on the extent of the sampled box only.

        Parameters
        ----------
        region : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
        bounds : tuple of float [m, corner]
            Box that is sampled.
        """
        extent = math.dist(bounds[: self.axes], bounds[self.axes :])
        return min(CLEARANCE_FACTOR * self._mean_clearance(region), EXTENT_FACTOR * extent)

    def poses(self, states: Sequence[Pose]) -> Floats:
        """Return the poses of base_link along a path [map].

        In flat spaces these are the states; in the others they are as dense as the checks of the
        edges.

        Returns
        -------
        ndarray, shape (n, 2) [m]; (n, 3) [m] in r3, [m, m, rad] with a yaw
        """
        poses = self._interpolate(states)
        poses[:, : self.axes] += self.costmap.window.origin
        return poses

    def _interpolate(self, states: Sequence[Pose]) -> Floats:
        return np.array(states)

    @cached_property
    def _last_region(self) -> Bools:
        return np.zeros_like(self.costmap.blocked)

    @abstractmethod
    def _possibly_clear(self) -> Bools:
        """Return the cells that may contain a clear position."""

    @abstractmethod
    def _mean_clearance(self, region: Bools) -> float:
        """Return the mean clearance of the cells of a region [m]."""


def box_of(region: Bools, size: float) -> Bounds:
    """Return the bounding box of the cells of a region: low x, y, high x, y [m, corner].

    Parameters
    ----------
    region : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
    size : float [m]
        Side of a cell.

    Examples
    --------
    >>> box_of(np.eye(4, dtype=bool)[1:3], 0.5)
    (0.5, 0.0, 1.5, 1.0)
    """
    axes = range(region.ndim)[::-1]
    lines = [np.flatnonzero(region.any(axis=tuple(k for k in axes if k != axis))) for axis in axes]
    edges = [line[0] for line in lines] + [line[-1] + 1 for line in lines]
    return tuple(size * float(edge) for edge in edges)
