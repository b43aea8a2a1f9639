"""Cells hidden behind new surfaces."""

from __future__ import annotations

import math

from numba import njit

from groundmap.arrays import Bools, Floats, Floats32


@njit(cache=True, nogil=True)
def mark_shadow(z: Floats32, free: Bools, eye: Floats, shadow: Bools) -> None:
    """Mark free cells from which the way to the viewpoint meets a new surface first.

    The way passes free cells without evidence only, cell by cell through faces, so that no surface
    of diagonal neighbours is missed. A new surface is a cell with z > 0 that was free.

    Parameters
    ----------
    z : ndarray of float32, shape (layers, rows, cols)
        Evidence of the view.
    free : ndarray of bool, of z's shape
        Cells that were free before the view.
    eye : ndarray of float, shape (3,)
        Viewpoint in cells ``[layer, row, col]``; cell i spans i to i + 1.
    shadow : ndarray of bool, of z's shape
        Set to True at the marked cells.
    """
    layers, rows, cols = z.shape
    for layer in range(layers):
        for row in range(rows):
            for col in range(cols):
                if free[layer, row, col] and z[layer, row, col] == 0.0:
                    shadow[layer, row, col] = _behind_new(z, free, eye, layer, row, col)


@njit(cache=True, nogil=True)
def _behind_new(z: Floats32, free: Bools, eye: Floats, layer: int, row: int, col: int) -> bool:
    a, b, c = layer, row, col
    da, db, dc = eye[0] - (a + 0.5), eye[1] - (b + 0.5), eye[2] - (c + 0.5)
    sa, sb, sc = (1 if da > 0 else -1), (1 if db > 0 else -1), (1 if dc > 0 else -1)
    # Share of the way between two faces along each axis, and up to the next face.
    wa = 1.0 / abs(da) if da != 0.0 else math.inf
    wb = 1.0 / abs(db) if db != 0.0 else math.inf
    wc = 1.0 / abs(dc) if dc != 0.0 else math.inf
    na, nb, nc = 0.5 * wa, 0.5 * wb, 0.5 * wc
    while min(na, nb, nc) < 1.0:
        if na <= nb and na <= nc:
            a, na = a + sa, na + wa
        elif nb <= nc:
            b, nb = b + sb, nb + wb
        else:
            c, nc = c + sc, nc + wc
        inside = 0 <= a < z.shape[0] and 0 <= b < z.shape[1] and 0 <= c < z.shape[2]
        if not inside or not free[a, b, c] or z[a, b, c] < 0.0:
            return False
        if z[a, b, c] > 0.0:
            return True
    return False
