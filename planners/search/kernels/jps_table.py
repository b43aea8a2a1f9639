"""Construction of the table of jumps for JPS+ (Rabin 2015)."""

from __future__ import annotations

from numba import njit

from groundmap.arrays import Bytes
from planners.costmap.kernels.moves import COLS, ROWS
from planners.search.kernels.jps_jumps import Jumps


@njit(cache=True, nogil=True)
def fill_table(moves: Bytes, table: Jumps) -> None:
    """Fill the table of jumps; `planners.search.kernels.jps_jumps` describes it.

    Parameters
    ----------
    moves : ndarray of uint8, shape (rows, cols)
        Allowed moves of every cell, as in `planners.search.kernels.astar`.
    table : ndarray of int, shape (rows, cols, 8)
        Overwritten. Its type must hold the number of rows and of columns.
    """
    rows = len(moves)
    for row in range(rows - 1, -1, -1):
        for k in range(5):
            fill_row(moves, table, row, k)
    for row in range(rows):
        for k in range(5, 8):
            fill_row(moves, table, row, k)


@njit(cache=True, nogil=True)
def fill_row(moves: Bytes, table: Jumps, row: int, k: int) -> None:
    """Fill a row's jumps with one heading, after those of the row that it leads to.

    Parameters
    ----------
    moves, table
        As in `fill_table`.
    row, k : int
        Row and heading.
    """
    cols = moves.shape[1]
    for i in range(cols):
        col = cols - 1 - i if COLS[k] > 0 else i
        n = 0
        if (moves[row, col] >> k) & 1:
            to_row, to_col = row + ROWS[k], col + COLS[k]
            if k & 1:
                sides = max(table[to_row, to_col, k - 1], table[to_row, to_col, (k + 1) & 7])
                stops = sides > 0
            else:
                opened = int(moves[to_row, to_col]) & ~int(moves[row, col])
                stops = (opened >> ((k + 2) & 7) | opened >> ((k + 6) & 7)) & 1 != 0
            after = int(table[to_row, to_col, k])
            n = 1 if stops else after + 1 if after > 0 else after - 1
        table[row, col, k] = n
