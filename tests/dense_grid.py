"""A dense twin of the confidence grid: sums over all views in one array, no tiles, no averages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.testing import assert_array_equal

from groundmap.arrays import Counts, Floats, Ints
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import GridWindow

Block = npt.NDArray[np.float32]

ROUNDING = 2.0**-24  # of one float32 operation, relative


@dataclass
class DenseGrid:
    """All cells from -extent up to (not with) extent, in every direction."""

    extent: int
    total: Floats  #: sum of all evidence
    count: Counts
    drop_offs: Counts

    @classmethod
    def empty(cls, extent: int, ndim: int) -> DenseGrid:
        shape = (2 * extent,) * ndim
        return cls(extent, np.zeros(shape), np.zeros(shape, np.uint32), np.zeros(shape, np.uint32))

    def fuse(self, lower: Ints, z: Block) -> None:
        where = self.piece(lower, lower + z.shape)
        self.total[where] += z
        self.count[where] += z != 0

    def add_drop_offs(self, cells: Ints) -> None:
        for cell in {tuple(cell) for cell in (cells + self.extent).tolist()}:
            self.drop_offs[cell] += 1

    def add(self, other: DenseGrid) -> None:
        self.total += other.total
        self.count += other.count
        self.drop_offs += other.drop_offs

    def piece(self, lower: Ints, upper: Ints) -> tuple[slice, ...]:
        """Return where the cells from lower up to (not with) upper are."""
        assert (lower >= -self.extent).all()
        assert (upper <= self.extent).all()
        return tuple(map(slice, lower + self.extent, upper + self.extent))

    def assert_same(self, window: GridWindow, lower: Ints, upper: Ints) -> None:
        """Compare with a window of those cells; confidence to the rounding of a running average."""
        where = self.piece(lower, upper)
        count = self.count[where]
        assert_array_equal(window.count, count)
        assert_array_equal(window.drop_offs, self.drop_offs[where])
        mean = self.total[where] / np.maximum(count, 1)
        error = np.abs(window.confidence - mean)
        assert (error <= rounding_of_mean(count)).all()
        assert_array_equal(window.confidence[count == 0], 0.0)

    def assert_same_grid(self, grid: ConfidenceGrid) -> None:
        """Compare with all cells of a grid."""
        corner = np.full(grid.ndim, self.extent)
        bounds = np.concatenate([-corner, corner]) * grid.resolution + np.tile(grid.origin, 2)
        self.assert_same(grid.window(bounds), -corner, corner)


def rounding_of_mean(count: npt.ArrayLike) -> Floats:
    """Return how far a float32 running average of so many values in [-1, 1] can be off.

    Step k adds at most u for the sum and 6 u / k for the increment, then weighs k / n: in all
    (n + 1) / 2 + 6 roundings u. Merging is one rounding more, and a few spare.
    """
    return (0.5 * np.asarray(count, dtype=np.float64) + 10.0) * ROUNDING
