"""Line of sight between cell centres, exact in integers.

The region that routes may use consists of squares between the centres of four cells, and of sides
between the centres of two neighbours. The moves define both: the region contains the square to the
north-east of a centre if the step north-east is allowed, the side to its east if the step east is
allowed, and the side to its north if the step north is allowed.
"""

from __future__ import annotations

from numba import njit

from groundmap.arrays import Bytes

EAST, NORTHEAST, NORTH = 1, 2, 4  # bits of a cell's moves


@njit(cache=True, nogil=True)
def sight(moves: Bytes, row: int, col: int, to_row: int, to_col: int) -> bool:
    """Whether the straight line between the centres of two cells stays in the region.

    Parameters
    ----------
    moves : ndarray of uint8, shape (rows, cols)
        Allowed moves of every cell, as in `planners.search.kernels.astar`.
    row, col, to_row, to_col : int
        The two cells, both traversable.
    """
    rows, cols = abs(to_row - row), abs(to_col - col)
    if rows == 0:
        return _along(moves, row, min(col, to_col), 0, 1, cols)
    if cols == 0:
        return _along(moves, min(row, to_row), col, 1, 0, rows)
    row_step, col_step = (1 if to_row > row else -1), (1 if to_col > col else -1)
    square_row, square_col = min(row, row + row_step), min(col, col + col_step)
    # Along the line from 0 to rows · cols, it meets the i-th row of centres at i · cols, and the
    # j-th column at j · rows. Where it meets both at once, it passes from corner to corner.
    next_row, next_col, end = cols, rows, rows * cols
    while moves[square_row, square_col] & NORTHEAST:
        at = min(next_row, next_col)
        if at == end:
            return True
        if next_row == at:
            square_row += row_step
            next_row += cols
        if next_col == at:
            square_col += col_step
            next_col += rows
    return False


@njit(cache=True, nogil=True)
def _along(moves: Bytes, row: int, col: int, row_step: int, col_step: int, count: int) -> bool:
    """Whether `count` consecutive sides in a row or column belong to the region."""
    bit = NORTH if row_step else EAST
    belong = True
    for i in range(count):
        belong = belong and moves[row + i * row_step, col + i * col_step] & bit != 0
    return belong
