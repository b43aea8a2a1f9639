"""Exact distances from half-cell lattice points to the nearest blocked square.

The lattice is that of `planners.costmap.moves`. Distances are those of
`planners.costmap.kernels.distance`, and so is the method: first along each column of cells, then
along each line of the lattice, as the lower envelope of parabolas at the columns' borders.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Ints32
from planners.costmap.kernels.distance import NOWHERE, envelope


@njit(cache=True, nogil=True)
def squared_clearance(blocked: Bools) -> Ints32:
    """Return the squared distance of every lattice point to the nearest blocked square.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)

    Returns
    -------
    ndarray of int32, shape (2 rows + 1, 2 cols + 1) [(half cells)²]
        At most `NOWHERE`; `NOWHERE` everywhere if no cell is blocked.
    """
    rows, cols = blocked.shape
    squared = np.empty((2 * rows + 1, 2 * cols + 1), dtype=np.int32)
    away = _down_columns(blocked)
    far = 2 * rows + 1
    heights = np.empty(cols, dtype=np.int64)
    border, at = np.empty(cols + 1, dtype=np.int64), np.empty(cols + 1, dtype=np.int64)
    starts = np.empty(cols + 1, dtype=np.int64)
    for line in range(2 * rows + 1):
        for col in range(cols):
            steps = np.int64(away[line, col])
            heights[col] = steps * steps if steps < far else NOWHERE
        size = envelope(heights, border, at, starts)
        k = 0
        for x in range(2 * cols + 1):
            least = heights[x >> 1] if x & 1 else NOWHERE
            if size > 0:
                while k + 1 < size and starts[k + 1] <= x:
                    k += 1
                aside = x - at[k]
                least = min(least, aside * aside + border[k])
            squared[line, x] = min(least, NOWHERE)
    return squared


@njit(cache=True, nogil=True)
def _down_columns(blocked: Bools) -> Ints32:
    """Return the vertical distance to the nearest blocked square of the same column [half cells].

    Shape (2 rows + 1, cols); 2 rows + 1 in a column without blocked cells.
    """
    rows, cols = blocked.shape
    far = 2 * rows + 1
    away = np.full((2 * rows + 1, cols), far, dtype=np.int32)
    for row in range(rows):
        for col in range(cols):
            if blocked[row, col]:
                away[2 * row : 2 * row + 3, col] = 0
    for line in range(1, 2 * rows + 1):
        for col in range(cols):
            away[line, col] = min(away[line, col], away[line - 1, col] + 1)
    for line in range(2 * rows - 1, -1, -1):
        for col in range(cols):
            away[line, col] = min(away[line, col], away[line + 1, col] + 1)
    return away
