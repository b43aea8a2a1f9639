"""The cells that allowed moves reach."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Bytes, Ints
from planners.costmap.kernels.moves import COLS, ROWS


@njit(cache=True, nogil=True)
def flood(moves: Bytes, width: int, sources: Ints) -> Bools:
    """Return which cells can be reached from any of the sources, including these.

    Parameters
    ----------
    moves : ndarray of uint8, shape (cells,)
        Allowed moves of every cell, as in `planners.search.kernels.astar`.
    width : int
        Cells in a row.
    sources : ndarray of int64, shape (n,)
        Indices of cells.
    """
    reached = np.zeros(len(moves), dtype=np.bool_)
    stack = np.empty(len(moves), dtype=np.int64)
    size = 0
    for source in sources:
        reached[source] = True
        stack[size] = source
        size += 1
    while size > 0:
        size -= 1
        node = stack[size]
        for k in range(8):
            if (moves[node] >> k) & 1:
                to = node + ROWS[k] * width + COLS[k]
                if not reached[to]:
                    reached[to] = True
                    stack[size] = to
                    size += 1
    return reached
