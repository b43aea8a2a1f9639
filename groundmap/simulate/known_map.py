"""The correct map of a world, in any dimension."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from groundmap.arrays import Bools, Floats


@dataclass(frozen=True, eq=False)
class KnownMap(ABC):
    """The correct map of a world, on the cells of a box: a `Truth`, in 3-D a `VoxelTruth`.

    Attributes
    ----------
    nonfree : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
        Cells that overlap an obstacle.
    visible : ndarray of bool, shape as `nonfree`
        Cells whose centre is visible from some view: in both images, in range, nothing between.
    in_line : ndarray of bool, shape as `nonfree`
        The same for a camera with a field of view of 360 degrees and unlimited range. Free cells of
        a map outside of it lie in or behind a surface, which is the dangerous error.
    surfaces : ndarray, shape (n, 2) or (n, 3) [m, map]
        Points on the surfaces of obstacles, half a cell apart, that are visible from some view.
    viewpoints : ndarray, shape (v, 2) or (v, 3) [m, map]
    """

    nonfree: Bools
    visible: Bools
    in_line: Bools
    surfaces: Floats
    viewpoints: Floats

    @abstractmethod
    def to_obstacles(self, points: Floats) -> Floats:
        """Return the distance of points, shape (n, d), to the nearest obstacle [m]; 0 inside.

        It is infinite without obstacles.
        """

    @abstractmethod
    def to_borders(self, points: Floats) -> Floats:
        """Return the distance of points, shape (n, d), to the nearest border of an obstacle [m].

        It is infinite without obstacles.
        """
