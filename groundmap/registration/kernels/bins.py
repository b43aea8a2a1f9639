"""Features by bins of their bearing."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints

BORDER = 2.0  # bearings beyond share the outer bins


@njit(cache=True, nogil=True)
def fill_bins(bearings: Floats, size: float) -> tuple[Ints, Ints]:
    """Sort features by bins of their bearing.

    Parameters
    ----------
    bearings : ndarray, shape (m, 3)
        (x/z, y/z, 1/z).
    size : float
        Side of a bin.

    Returns
    -------
    start : ndarray
        The features of bin b are ``rows[start[b] : start[b + 1]]``.
    rows : ndarray, shape (m,)
    """
    side = bins_per_side(size)
    start = np.zeros(side * side + 1, dtype=np.int64)
    home = np.empty(len(bearings), dtype=np.int64)
    for j in range(len(bearings)):
        home[j] = bin_of(bearings[j, 1], size) * side + bin_of(bearings[j, 0], size)
        start[home[j] + 1] += 1
    for b in range(side * side):
        start[b + 1] += start[b]
    rows = np.empty(len(bearings), dtype=np.int64)
    filled = start[:-1].copy()
    for j in range(len(bearings)):
        rows[filled[home[j]]] = j
        filled[home[j]] += 1
    return start, rows


@njit(cache=True, nogil=True)
def bins_per_side(size: float) -> int:
    """Return the number of rows and of columns of bins of a size."""
    return int(2.0 * BORDER / size) + 3


@njit(cache=True, nogil=True)
def bin_of(bearing: float, size: float) -> int:
    """Return the row or column of a bin; bearings beyond the border share the outer ones.

    Parameters
    ----------
    bearing : float
    size : float
        Side of a bin.
    """
    inside = min(max(bearing, -BORDER), BORDER)
    return int((inside + BORDER) / size) + 1
