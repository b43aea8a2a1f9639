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

SIGHT, TOPS = (0.05, 0.15, 0.6), (0.15, 0.6, np.inf)  # [m], of the grid's height layers
ONE_VIEW = 1.05  # a layer counts where its evidence adds up to more
ROUNDING = 2.0**-24  # of one float32 operation, relative


@dataclass
class DenseGrid:
    """All cells from -extent up to (not with) extent, in every direction."""

    extent: int
    total: Floats  #: sum of all evidence, and of that in each height layer, shape (4, ...)
    count: Counts  #: shape (4, ...)

    @classmethod
    def empty(cls, extent: int, ndim: int) -> DenseGrid:
        shape = (1 + len(SIGHT), *(2 * extent,) * ndim)
        return cls(extent, np.zeros(shape), np.zeros(shape, np.uint32))

    def fuse(self, lower: Ints, z: Block, height: Block | None = None) -> None:
        where = self.piece(lower, lower + z.shape)
        self.total[0][where] += z
        self.count[0][where] += z != 0
        if height is None:
            return
        for layer, (sight, top) in enumerate(zip(SIGHT, TOPS, strict=True), start=1):
            low = ((z < 0) & (height < sight)) | ((z > 0) & (height < top))
            self.total[layer][where] += np.where(low, z, 0.0)
            self.count[layer][where] += low

    def add(self, other: DenseGrid) -> None:
        self.total += other.total
        self.count += other.count

    def piece(self, lower: Ints, upper: Ints) -> tuple[slice, ...]:
        """Return where the cells from lower up to (not with) upper are."""
        assert (lower >= -self.extent).all()
        assert (upper <= self.extent).all()
        return tuple(map(slice, lower + self.extent, upper + self.extent))

    def assert_same(self, window: GridWindow, lower: Ints, upper: Ints) -> None:
        """Compare with a window of those cells; confidence to the rounding of a running average."""
        where = self.piece(lower, upper)
        count = self.count[0][where]
        assert_array_equal(window.count, count)
        surest = self.total[0][where] / np.maximum(count, 1)
        unsure = np.zeros(count.shape, dtype=np.bool_)
        for total, below in zip(self.total[1:], self.count[1:], strict=True):
            mean = total[where] / np.maximum(below[where], 1)
            surest = np.where(total[where] > ONE_VIEW, np.maximum(surest, mean), surest)
            unsure |= np.abs(total[where] - ONE_VIEW) < 1e-3  # rounding may decide either way
        error = np.abs(window.confidence - surest)
        assert (error <= rounding_of_mean(count))[~unsure].all()
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
