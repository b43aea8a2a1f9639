"""The half-cell lattice: what exact clearance is on it, and the moves it allows.

The lattice of a map of r x c cells has (2 r + 1) x (2 c + 1) points: the corners, edge midpoints
and centres of the cells; the centre of cell [row, col] is point [2 row + 1, 2 col + 1]. A blocked
cell's closed square marks its 3 x 3 points. The point of a square that is nearest to a lattice
point is a lattice point again (clamp each coordinate), so a distance transform of the lattice
gives distances to *squares*, squared and in half cells exact integers.

A disc whose centre keeps its radius at the ends of a move keeps it all along. Take a square S and
the block of cells that the move spans: two cells, or, for a diagonal, four whose centres all keep
the radius. These centres span a segment, or a square; of its points, the nearest to S is a corner,
or it lies beside S, as some corner does at the same distance, since S is aligned with the cells.
(An S within the block is one of its cells, on whose centre nobody may be.) So the cells on which
the centre may be are a bitmap that says all about moves.
"""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Bools, Bytes

RADIUS_TOLERANCE = 1e-12  # relative error granted to the radius: 2 * 0.3 / 0.1 is not quite 6


def squared_need(radius: float, resolution: float) -> int:
    """Return the least squared clearance [(half cells)²] that is enough for a radius [m].

    Examples
    --------
    >>> squared_need(0.3, 0.1)
    36
    """
    return math.ceil((2.0 * radius / resolution) ** 2 * (1.0 - RADIUS_TOLERANCE))


def allowed_moves(traversable: Bools) -> Bytes:
    """Return the allowed moves of every cell, a bit each, as in `planners.costmap.kernels.moves`.

    An orthogonal move is allowed between two cells on which the footprint's centre may be, a
    diagonal one if that holds for all four cells of the block: no corner is cut.

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
