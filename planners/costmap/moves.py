"""The half-cell lattice: exact clearance on it, and the moves that it allows.

The lattice of a map of r x c cells has (2 r + 1) x (2 c + 1) points: the corners, edge midpoints
and centres of the cells; the centre of cell [row, col] is point [2 row + 1, 2 col + 1]. A blocked
cell's closed square covers 3 x 3 points. The point of a square that is nearest to a lattice point
is also a lattice point (clamp each coordinate), so a distance transform of the lattice gives
distances to *squares*, whose squares in half cells are exact integers.

A disc whose centre keeps its radius at the ends of a move keeps it along the whole move. Take a
blocked square S and the block of cells that the move spans: two cells, or four for a diagonal,
whose centres all keep the radius. These centres span a segment or a square. Its point nearest to S
is a corner, or lies beside S at the same distance as a corner, because S is aligned with the cells.
(S is not within the block, as the centres of blocked cells do not keep the radius.) Therefore the
bitmap of traversable cells determines all moves.
"""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Bools, Bytes

RADIUS_TOLERANCE = 1e-12  # relative tolerance of the radius: 2 * 0.3 / 0.1 is slightly below 6


def squared_need(radius: float, resolution: float) -> int:
    """Return the smallest squared clearance that suffices for a radius [(half cells)²].

    Parameters
    ----------
    radius, resolution : float [m]

    Examples
    --------
    >>> squared_need(0.3, 0.1)
    36
    """
    return math.ceil((2.0 * radius / resolution) ** 2 * (1.0 - RADIUS_TOLERANCE))


def allowed_moves(traversable: Bools) -> Bytes:
    """Return the allowed moves of every cell as bits, see `planners.costmap.kernels.moves`.

    An orthogonal move requires two traversable cells, a diagonal one four, so that no corner is
    cut.

    Parameters
    ----------
    traversable : ndarray of bool, shape (rows, cols)

    Returns
    -------
    ndarray of uint8, shape (rows, cols)

    Examples
    --------
    >>> allowed_moves(np.array([[True, True], [True, False]]))
    array([[ 5, 16],
           [64,  0]], dtype=uint8)
    """
    east = (traversable[:, :-1] & traversable[:, 1:]).view(np.uint8)
    north = (traversable[:-1] & traversable[1:]).view(np.uint8)
    block = east[:-1] & east[1:]
    moves = np.zeros(traversable.shape, dtype=np.uint8)
    moves[:, :-1] |= east
    moves[:-1, :-1] |= block << 1
    moves[:-1] |= north << 2
    moves[:-1, 1:] |= block << 3
    moves[:, 1:] |= east << 4
    moves[1:, 1:] |= block << 5
    moves[1:] |= north << 6
    moves[1:, :-1] |= block << 7
    return moves
