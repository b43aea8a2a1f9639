"""Dense windows of a grid, the four states of cells, and cell coordinates."""

from __future__ import annotations

from collections.abc import Callable
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


class CellState(IntEnum):
    """The four states of a cell."""

    UNKNOWN = 0  #: never observed
    FREE = 1  #: confidence <= -epsilon
    NONFREE = 2  #: confidence >= epsilon
    CONTESTED = 3  #: in between: views contradict each other


@dataclass(frozen=True, eq=False)
class GridWindow:
    """A dense window of a grid; arrays are indexed ``[row, col]`` (``[layer, row, col]`` in 3-D).

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

    def world_to_cell(self, xy: npt.ArrayLike) -> Ints:
        """Return the cells ``[row, col]`` of map positions (x, y) [m], inside or outside."""
        return cells_of(xy, self.origin, self.resolution)

    def cell_to_world(self, cells: npt.ArrayLike) -> Floats:
        """Return the centres (x, y) [m, map] of cells ``[row, col]``."""
        return centres_of(cells, self.origin, self.resolution)

    def contains(self, cells: Ints) -> Bools:
        """Return which cells lie inside the window."""
        within = (cells >= 0) & (cells < np.array(self.count.shape))
        inside: Bools = np.logical_and.reduce(within, axis=-1)
        return inside


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
