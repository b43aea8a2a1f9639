"""Kernels that cast rays on a dense block of cells; coordinates are in cells, x along columns."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Floats32


@njit(cache=True, nogil=True)
def cast_rays(z: Floats32, origin: Floats, ends: Floats, value: np.float32) -> None:
    """Set all cells that rays pass through to `value` (Amanatides and Woo 1987).

    Parameters
    ----------
    z : ndarray, shape (rows, cols)
        Contains `origin` and all `ends`; changed in place.
    origin : ndarray, shape (2,) [cells]
    ends : ndarray, shape (n, 2) [cells]
    value : float32
    """
    for i in range(len(ends)):
        _cast_ray(z, origin[0], origin[1], ends[i, 0], ends[i, 1], value)


@njit(cache=True, nogil=True)
def _cast_ray(
    z: Floats32, x: float, y: float, end_x: float, end_y: float, value: np.float32
) -> None:
    col, row = int(np.floor(x)), int(np.floor(y))
    last_col, last_row = int(np.floor(end_x)), int(np.floor(end_y))
    dx, dy = end_x - x, end_y - y
    step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    # Fraction of the ray at the next border in x and y, and between two borders.
    next_x = ((col + (dx > 0)) - x) / dx if dx != 0.0 else np.inf
    next_y = ((row + (dy > 0)) - y) / dy if dy != 0.0 else np.inf
    each_x = abs(1.0 / dx) if dx != 0.0 else np.inf
    each_y = abs(1.0 / dy) if dy != 0.0 else np.inf
    z[row, col] = value
    # The number of borders is known in advance, so the loop ends in spite of rounding.
    for _ in range(abs(last_col - col) + abs(last_row - row)):
        if col != last_col and (next_x < next_y or row == last_row):
            col += step_x
            next_x += each_x
        else:
            row += step_y
            next_y += each_y
        z[row, col] = value
