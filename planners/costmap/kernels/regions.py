"""Connected cells, in layers; a 2-D map is one layer."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Ints

FIRST_ROOM = 1024  # cells of a front to begin with


@njit(cache=True, nogil=True)
def fill(free: Bools, seeds: Ints, corners: bool) -> Bools:
    """Return the free cells that are connected to seeds, a bit of memory per cell.

    Fronts of cells spread from the seeds; a front of a map of 10^8 cells holds about 10^6.

    Parameters
    ----------
    free : ndarray of bool, shape (layers, rows, cols)
    seeds : ndarray of int64, shape (n, 3)
        Layer, row and column; those that are not free are ignored.
    corners : bool
        Whether cells are also connected through their edges and corners, not only their sides.
    """
    layers, rows, cols = free.shape
    reached = np.zeros(free.shape, dtype=np.bool_)
    front = np.empty((max(FIRST_ROOM, len(seeds)), 3), dtype=np.int32)
    after = np.empty_like(front)
    size = 0
    for i in range(len(seeds)):
        z, y, x = seeds[i]
        if free[z, y, x] and not reached[z, y, x]:
            reached[z, y, x] = True
            front[size, 0], front[size, 1], front[size, 2] = z, y, x
            size += 1
    while size > 0:
        count = 0
        for i in range(size):
            if count + 26 > len(after):
                after = np.concatenate((after, np.empty_like(after)))
            for dz in range(-1, 2):
                z = front[i, 0] + dz
                if z < 0 or z >= layers:
                    continue
                for dy in range(-1, 2):
                    y = front[i, 1] + dy
                    if y < 0 or y >= rows or (not corners and dz != 0 and dy != 0):
                        continue
                    for dx in range(-1, 2):
                        x = front[i, 2] + dx
                        if (
                            x < 0
                            or x >= cols
                            or (not corners and dx != 0 and dz * dz + dy * dy > 0)
                        ):
                            continue
                        if free[z, y, x] and not reached[z, y, x]:
                            reached[z, y, x] = True
                            after[count, 0], after[count, 1], after[count, 2] = z, y, x
                            count += 1
        front, after = after, front
        size = count
    return reached


@njit(cache=True, nogil=True)
def nth_cells(mask: Bools, ends: Ints, numbers: Ints) -> Ints:
    """Return the indices, in C order, of cells of a mask that are counted in that order.

    Parameters
    ----------
    mask : ndarray of bool, shape (lines, cols)
    ends : ndarray of int64, shape (lines,)
        Number of cells of the mask up to the end of each line.
    numbers : ndarray of int64, shape (n,)
        Which cells, from 0.

    Returns
    -------
    ndarray of int64, shape (n,)
    """
    cols = mask.shape[1]
    cells = np.empty(len(numbers), dtype=np.int64)
    for i in range(len(numbers)):
        line = np.searchsorted(ends, numbers[i], side="right")
        left = numbers[i] - (ends[line - 1] if line > 0 else 0)
        col = 0
        while True:
            if mask[line, col]:
                if left == 0:
                    break
                left -= 1
            col += 1
        cells[i] = line * cols + col
    return cells
