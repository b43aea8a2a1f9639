"""Exact clearance on the half-cell lattice, and the moves it allows.

The lattice of a map of r x c cells has (2 r + 1) x (2 c + 1) points: the corners, edge midpoints
and centres of the cells; the centre of cell [row, col] is point [2 row + 1, 2 col + 1]. A blocked
cell's closed square marks its 3 x 3 points. The point of a square that is nearest to a lattice
point is a lattice point again (clamp each coordinate), so a distance transform of the lattice
gives distances to *squares*, squared and in half cells exact integers.

Three look-ups check a whole move. Let a move go from centre (a, b) by (2, 0) or (2, 2) half cells,
and a square span [X, X + 2] x [Y, Y + 2]; a and b are odd, X and Y even. At t in [0, 2] along the
move, the squared distance is u(t)² + v(t)², where u is X - a - t, 0 or a + t - X - 2, and v
likewise (constant, for an orthogonal move); the kinks are at integer t. Between kinks, if u and v
don't grow in opposite senses, the minimum is at a kink or an end. If one grows as p + t and the
other shrinks as q - t, it is at t = (q - p) / 2, and p and q are odd: an integer again. So it is
attained at t = 0, 1 or 2: an end or the midpoint, all lattice points.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from groundmap.arrays import Bools, Bytes, Ints

NOWHERE = np.iinfo(np.int32).max  # squared distance to a blocked cell if there is none
ROUNDING = 1e-12  # relative error granted to the radius: 2 * 0.3 / 0.1 is not quite 6


def squared_clearance(blocked: Bools) -> Ints:
    """Return the squared distance of every lattice point to the nearest blocked square.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)

    Returns
    -------
    ndarray of int64, shape (2 rows + 1, 2 cols + 1) [(half cells)²]
        `NOWHERE` throughout if no cell is blocked.

    Examples
    --------
    >>> squared_clearance(np.array([[True, False]]))
    array([[0, 0, 0, 1, 4],
           [0, 0, 0, 1, 4],
           [0, 0, 0, 1, 4]])
    """
    rows, cols = blocked.shape
    clear = np.ones((2 * rows + 1, 2 * cols + 1), dtype=np.bool_)
    for i, j in np.ndindex(3, 3):
        clear[i : i + 2 * rows : 2, j : j + 2 * cols : 2] &= ~blocked
    if clear.all():
        return np.full(clear.shape, NOWHERE, dtype=np.int64)
    distance = ndimage.distance_transform_edt(clear)
    squared: Ints = np.rint(distance * distance).astype(np.int64)
    return squared


def squared_need(radius: float, resolution: float) -> int:
    """Return the least squared clearance [(half cells)²] that is enough for a radius [m].

    Examples
    --------
    >>> squared_need(0.3, 0.1)
    36
    """
    return math.ceil((2.0 * radius / resolution) ** 2 * (1.0 - ROUNDING))


def allowed_moves(blocked: Bools, squared: Ints, need: int) -> Bytes:
    """Return the allowed moves of every cell, a bit each, as in `planners.kernels.astar`.

    A move is allowed if the whole of it keeps the clearance, and, for a diagonal, if both cells
    that it passes between are not blocked (no corner is cut, even with a radius of 0).

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    squared : ndarray of int64, shape (2 rows + 1, 2 cols + 1) [(half cells)²]
        From `squared_clearance`.
    need : int [(half cells)²]
        From `squared_need`.

    Returns
    -------
    ndarray of uint8, shape (rows, cols)
    """
    clear = squared >= need
    free = ~blocked
    stand = free & clear[1::2, 1::2]
    east = stand[:, :-1] & stand[:, 1:] & clear[1::2, 2:-1:2]
    north = stand[:-1] & stand[1:] & clear[2:-1:2, 1::2]
    around = free[:-1, :-1] & free[:-1, 1:] & free[1:, :-1] & free[1:, 1:]
    corner = around & clear[2:-1:2, 2:-1:2]
    northeast = corner & stand[:-1, :-1] & stand[1:, 1:]
    northwest = corner & stand[:-1, 1:] & stand[1:, :-1]
    moves = np.zeros(blocked.shape, dtype=np.uint8)
    moves[:, :-1] |= east.view(np.uint8)
    moves[:-1, :-1] |= northeast.view(np.uint8) << 1
    moves[:-1] |= north.view(np.uint8) << 2
    moves[:-1, 1:] |= northwest.view(np.uint8) << 3
    moves[:, 1:] |= east.view(np.uint8) << 4
    moves[1:, 1:] |= northeast.view(np.uint8) << 5
    moves[1:] |= north.view(np.uint8) << 6
    moves[1:, :-1] |= northwest.view(np.uint8) << 7
    return moves
