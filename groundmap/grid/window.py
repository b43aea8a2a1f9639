"""Dense windows of a grid, the four states of cells, and cell coordinates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from groundmap.arrays import (
    FARTHEST_CELL,
    Bools,
    Bytes,
    Counts,
    Floats,
    Floats32,
    Ints,
    as_cells,
    as_positions,
    is_number,
)
from groundmap.errors import InputError

EPSILON = 0.01  # |confidence| below this is contested
SLAB_CELLS = 2**22  # 32 MiB of confidence and count


class CellState(IntEnum):
    """The four states of a cell."""

    UNKNOWN = 0  #: never observed
    FREE = 1  #: confidence <= -epsilon
    NONFREE = 2  #: confidence >= epsilon
    CONTESTED = 3  #: in between: views contradict each other


class CellFrame:
    """Where the cells of a box lie.

    Attributes
    ----------
    origin : ndarray, shape (d,) [m, map]
        Outer corner of cell (0, 0), x first.
    resolution : float [m]
    """

    origin: Floats
    resolution: float

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each axis, ``(rows, cols)``, ``(layers, rows, cols)`` in 3-D."""
        raise NotImplementedError

    def world_to_cell(self, xy: npt.ArrayLike) -> Ints:
        """Return the cells ``[row, col]`` of map positions (x, y) [m], outside ones included."""
        return cells_of(xy, self.origin, self.resolution)

    def cell_to_world(self, cells: npt.ArrayLike) -> Floats:
        """Return the centres (x, y) [m, map] of cells ``[row, col]``."""
        return centres_of(cells, self.origin, self.resolution)

    def contains(self, cells: Ints) -> Bools:
        """Return which cells lie inside."""
        within = (cells >= 0) & (cells < np.array(self.shape))
        inside: Bools = np.logical_and.reduce(within, axis=-1)
        return inside


@dataclass(frozen=True, eq=False)
class CellBox(CellFrame):
    """A box of a grid's cells, without what the grid holds there.

    Attributes
    ----------
    lower, upper : ndarray of int64, shape (d,)
        The first cell ``[row, col]`` of the grid, and the cell past the last.
    origin : ndarray, shape (d,) [m, map]
        Outer corner of the first cell, x first.
    resolution : float [m]

    Examples
    --------
    >>> box = CellBox(np.array([-2, 0, 1]), np.array([3, 4, 5]), np.zeros(3), 0.5)
    >>> box.shape, [(slab.shape, slab.origin.tolist()) for slab in box.slabs(40)]
    ((5, 4, 4), [((2, 4, 4), [0.0, 0.0, 0.0]), ((2, 4, 4), [0.0, 0.0, 1.0]), \
((1, 4, 4), [0.0, 0.0, 2.0])])
    """

    lower: Ints
    upper: Ints
    origin: Floats
    resolution: float

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each axis."""
        return tuple((self.upper - self.lower).tolist())

    def slabs(self, most_cells: int = SLAB_CELLS) -> Iterator[CellBox]:
        """Yield boxes of whole rows or layers that together are this one, in order.

        Parameters
        ----------
        most_cells : int, default 2**22
            Cells of a slab; one row or layer is never cut.
        """
        for part in slabs(self.shape, most_cells):
            lower, upper, origin = self.lower.copy(), self.upper.copy(), self.origin.copy()
            lower[0], upper[0] = self.lower[0] + part.start, self.lower[0] + part.stop
            origin[-1] += part.start * self.resolution
            yield CellBox(lower, upper, origin, self.resolution)


@dataclass(frozen=True, eq=False)
class GridWindow(CellFrame):
    """A dense piece of a grid; arrays are indexed ``[row, col]`` (``[layer, row, col]`` in 3-D).

    Attributes
    ----------
    confidence : ndarray of float32
        Below zero for freespace, above zero for non-freespace; the highest of all layers.
    count : ndarray of uint32
        Number of views that observed the cell.
    origin : ndarray, shape (d,) [m, map]
        Outer corner of cell (0, 0), x first.
    resolution : float [m]
    """

    confidence: Floats32
    count: Counts
    origin: Floats
    resolution: float

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each axis."""
        return self.count.shape

    def states(self, *, epsilon: float = EPSILON) -> Bytes:
        """Return the `CellState` of every cell, as uint8.

        Raises
        ------
        InputError
            `epsilon` is not a number from 0 to 1.
        """
        if not (is_number(epsilon) and 0 <= epsilon <= 1):
            raise InputError("epsilon", "a number from 0 to 1", repr(epsilon)[:60])
        states = np.full(self.count.shape, CellState.CONTESTED, dtype=np.uint8)
        states[self.confidence <= -epsilon] = CellState.FREE
        states[self.confidence >= epsilon] = CellState.NONFREE
        states[self.count == 0] = CellState.UNKNOWN
        return states


def slabs(shape: tuple[int, ...], most_cells: int = SLAB_CELLS) -> Iterator[slice]:
    """Yield slices of the first axis that together are a box of cells, in order.

    Parameters
    ----------
    shape : tuple of int
    most_cells : int, default 2**22
        Cells of a slab; one row or layer is never cut.
    """
    thickness = max(1, most_cells // max(1, math.prod(shape[1:])))
    for first in range(0, shape[0], thickness):
        yield slice(first, min(first + thickness, shape[0]))


def cells_of(xy: npt.ArrayLike, origin: Floats, resolution: float) -> Ints:
    """Return the cells ``[row, col]`` of positions; a lower border belongs to its cell.

    Cells beyond `FARTHEST_CELL`, which no grid contains, are clipped to it.

    Parameters
    ----------
    xy : array_like, shape (n, d) or (d,) [m, map]
    origin : ndarray, shape (d,) [m, map]
    resolution : float [m]
    """
    positions = as_positions("xy", xy, len(origin))
    return scaled_cells(np.floor, positions, origin, resolution)


def scaled_cells(
    rounded: Callable[[Floats], Floats], positions: Floats, origin: Floats, resolution: float
) -> Ints:
    """Return positions in cells ``[row, col]``, rounded up or down.

    Parameters
    ----------
    rounded : callable
        `numpy.floor` or `numpy.ceil`.
    positions : ndarray, shape (n, d) [m, map]
    origin : ndarray, shape (d,) [m, map]
    resolution : float [m]
    """
    with np.errstate(over="ignore"):
        scaled = (positions - origin) / resolution
    cells = np.clip(rounded(scaled), -FARTHEST_CELL, FARTHEST_CELL)
    return cells.astype(np.int64)[:, ::-1]


def centres_of(cells: npt.ArrayLike, origin: Floats, resolution: float) -> Floats:
    """Return the centres of cells, shape (n, d) [m, map].

    Parameters
    ----------
    cells : array_like, shape (n, d) or (d,)
    origin : ndarray, shape (d,) [m, map]
    resolution : float [m]
    """
    index = as_cells("cells", cells, len(origin))
    return origin + (index[:, ::-1] + 0.5) * resolution
