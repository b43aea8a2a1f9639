"""Regions of cells, in any dimension and with little memory: connected, nearest, drawn."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from groundmap.arrays import Bools, Floats, Ints
from groundmap.grid.window import CellFrame, slabs
from planners.costmap.kernels.regions import fill, nth_cells


def connected_to(free: Bools, cells: Ints, *, corners: bool = False) -> Bools:
    """Return the free cells that are connected to cells.

    Parameters
    ----------
    free : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
    cells : ndarray of int64, shape (n, d)
    corners : bool, default False
        Whether cells are also connected through their edges and corners, not only their sides.

    Examples
    --------
    >>> free = np.array([[True, False, True], [False, True, True]])
    >>> connected_to(free, np.array([[1, 1]])).astype(int).tolist()
    [[0, 0, 1], [0, 1, 1]]
    >>> connected_to(free, np.array([[1, 1]]), corners=True).astype(int).tolist()
    [[1, 0, 1], [0, 1, 1]]
    """
    seeds = np.zeros((len(cells), 3), dtype=np.int64)
    seeds[:, 3 - free.ndim :] = cells
    reached: Bools = fill(_in_layers(free), seeds, corners).reshape(free.shape)
    return reached


def largest_region(free: Bools) -> Bools:
    """Return the largest region of free cells that are connected through their sides."""
    labels, count = ndimage.label(free)
    sizes = np.zeros(count + 1, dtype=np.int64)
    for part in slabs(free.shape):
        sizes += np.bincount(labels[part].ravel(), minlength=count + 1)
    region: Bools = labels == (1 + sizes[1:].argmax() if count else -1)
    return region


def nearest_cells(frame: CellFrame, mask: Bools, place: tuple[float, ...]) -> tuple[Floats, float]:
    """Return the centre of the cell of a mask that is nearest to a place, and its distance.

    Parameters
    ----------
    frame : CellBox or GridWindow
        Where the cells lie.
    mask : ndarray of bool, shape as `frame`
    place : tuple of float [m, map]

    Returns
    -------
    ndarray, shape (d,) [m, map]
    float [m]
        Infinite if no cell is in the mask.
    """
    best, nearest = np.full(mask.ndim, np.nan), np.inf
    for part in slabs(mask.shape):
        cells = np.argwhere(mask[part])
        cells[:, 0] += part.start
        centres = frame.cell_to_world(cells)
        away = np.hypot.reduce(centres - place, axis=1)
        if len(away) and away.min() < nearest:
            best, nearest = centres[away.argmin()], float(away.min())
    return best, nearest


class CellSample:
    """Draws cells of a mask, all with the same probability.

    Parameters
    ----------
    mask : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
    """

    def __init__(self, mask: Bools) -> None:
        self.shape = mask.shape
        self._lines = np.ascontiguousarray(mask).reshape(-1, mask.shape[-1])
        self._ends: Ints = np.cumsum(np.count_nonzero(self._lines, axis=1), dtype=np.int64)

    def __len__(self) -> int:
        return int(self._ends[-1])

    def draw(self, rng: np.random.Generator, count: int) -> Ints:
        """Return cells, shape (count, d).

        Parameters
        ----------
        rng : numpy Generator
        count : int
        """
        drawn = nth_cells(self._lines, self._ends, rng.integers(len(self), size=count))
        return np.column_stack(np.unravel_index(drawn, self.shape))


def _in_layers(mask: Bools) -> Bools:
    layers: Bools = np.ascontiguousarray(mask).reshape((1,) * (3 - mask.ndim) + mask.shape)
    return layers
