"""Lengths of jumps for jump point search, from a bitmap of stops or a table of jumps.

A jump is a number n: if n > 0, the next jump point is n cells away; if n <= 0, there is none, and
-n cells can be passed before the wall.

The bitmap, an int64 array of shape (words, 2), has two bits for every cell and straight heading:
whether a jump stops there, at a wall or a jump point, and whether the cell is a wall. Bits follow
the heading, lowest first. Each line of cells takes whole words and has a wall after its last cell.
The lines are the rows eastwards, the rows westwards, the columns northwards and the columns
southwards.

The table, of shape (rows, cols, 8), holds the jump from every cell with every heading. A diagonal
jump leads to the next cell from which a straight jump to a side reaches a jump point.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit

from groundmap.arrays import Bytes, Ints, Ints32
from planners.costmap.kernels.moves import COLS, ROWS

Jumps: TypeAlias = Ints | Ints32 | npt.NDArray[np.int16]

DE_BRUIJN = 0x022FDD63CC95386D  # any six bits in a row occur once
BIT_OF = np.zeros(64, dtype=np.int64)
BIT_OF[[((DE_BRUIJN << bit) % 2**64) >> 58 for bit in range(64)]] = range(64)


@njit(cache=True, nogil=True)
def straight_jump(moves: Bytes, jumps: Jumps, targets: Ints, row: int, col: int, k: int) -> int:
    """Return the distance to the next jump point or target on a straight heading; 0 for none.

    Parameters
    ----------
    moves : ndarray of uint8, shape (rows, cols)
        Allowed moves of every cell.
    jumps : ndarray of int, shape (words, 2) or (rows, cols, 8)
    targets : ndarray of int64, shape (n, 3)
        Row, column and final cost.
    row, col, k : int
        Cell and heading.

    Returns
    -------
    int [cells]
    """
    if jumps.ndim == 3:  # constant for numba, which drops the other branch
        n = int(jumps[row, col, k])
    else:
        n = scan(jumps, moves.shape[0], moves.shape[1], row, col, k)
    passed = abs(n)
    for t in range(len(targets)):
        rows, cols = targets[t, 0] - row, targets[t, 1] - col
        if rows * COLS[k] == cols * ROWS[k]:
            away = rows * ROWS[k] + cols * COLS[k]
            if 0 < away <= passed and (n <= 0 or away < n):
                n = away
    return max(n, 0)


@njit(cache=True, nogil=True)
def diagonal_jump(moves: Bytes, jumps: Jumps, targets: Ints, row: int, col: int, k: int) -> int:
    """Return the steps along a diagonal to the next cell from which straight jumps are tried.

    Parameters
    ----------
    moves, jumps, targets, row, col, k
        As in `straight_jump`.

    Returns
    -------
    int
        0 if there is no such cell; negative if it is a target.
    """
    if jumps.ndim == 2:
        n = (int(moves[row, col]) >> k) & 1
    else:
        n = int(jumps[row, col, k])
        passed = abs(n)
        for t in range(len(targets)):
            # A straight jump may reach the target from the cell where the diagonal first crosses
            # its row or column. At the second crossing, the target lies behind.
            away = min((targets[t, 0] - row) * ROWS[k], (targets[t, 1] - col) * COLS[k])
            if 0 < away <= passed and (n <= 0 or away < n):
                n = away
        n = max(n, 0)
    for t in range(len(targets)):
        if row + n * ROWS[k] == targets[t, 0] and col + n * COLS[k] == targets[t, 1]:
            return -n
    return n


@njit(cache=True, nogil=True)
def scan(stops: Jumps, height: int, width: int, row: int, col: int, k: int) -> int:
    """Return the straight jump to the next jump point, from a scan of 64 cells at a time.

    Parameters
    ----------
    stops : ndarray of int64, shape (words, 2)
        Bitmap of stops.
    height, width : int
        Rows and columns of the grid.
    row, col, k : int
        Cell and heading.
    """
    row_words, col_words = width // 64 + 1, height // 64 + 1
    if k == 0:
        first, at = row * row_words, col
    elif k == 4:
        first, at = (height + row) * row_words, width - 1 - col
    elif k == 2:
        first, at = 2 * height * row_words + col * col_words, row
    else:
        first, at = 2 * height * row_words + (width + col) * col_words, height - 1 - row
    word = first + ((at + 1) >> 6)
    bits = stops[word, 0] & (-1 << ((at + 1) & 63))
    while bits == 0:
        word += 1
        bits = stops[word, 0]
    bit = BIT_OF[(((bits & -bits) * DE_BRUIJN) >> 58) & 63]
    n = ((word - first) << 6) + bit - at
    return int(1 - n if (stops[word, 1] >> bit) & 1 else n)
