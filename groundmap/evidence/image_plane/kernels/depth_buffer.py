"""Rasterisation of triangles by number."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints, Ints32

EMPTY = -1


@njit(cache=True, nogil=True)
def draw_triangles(buffer: Ints32, corners: Floats, drawn: Bools) -> None:
    """Write the number of the triangle at each cell's centre.

    Parameters
    ----------
    buffer : ndarray of int32, shape (rows, cols)
    corners : ndarray, shape (t, 3, 2) [cells]
        Right, down.
    drawn : ndarray of bool, shape (t,)
    """
    rows, cols = buffer.shape
    for t in range(len(corners)):
        if not drawn[t]:
            continue
        top = min(corners[t, 0, 1], corners[t, 1, 1], corners[t, 2, 1])
        bottom = max(corners[t, 0, 1], corners[t, 1, 1], corners[t, 2, 1])
        for row in range(
            max(int(np.ceil(top - 0.5)), 0), min(int(np.floor(bottom - 0.5)), rows - 1) + 1
        ):
            y = row + 0.5
            left, right = np.inf, -np.inf
            for k in range(3):
                ax, ay = corners[t, k, 0], corners[t, k, 1]
                bx, by = corners[t, (k + 1) % 3, 0], corners[t, (k + 1) % 3, 1]
                if min(ay, by) <= y <= max(ay, by):
                    if ay == by:
                        left, right = min(left, ax, bx), max(right, ax, bx)
                    else:
                        x = ax + (bx - ax) * ((y - ay) / (by - ay))
                        left, right = min(left, x), max(right, x)
            if left > right:
                continue
            first, last = (
                max(int(np.ceil(left - 0.5)), 0),
                min(int(np.floor(right - 0.5)), cols - 1),
            )
            for col in range(first, last + 1):
                buffer[row, col] = t


@njit(cache=True, nogil=True)
def draw_rim(buffer: Ints32, corners: Floats, neighbors: Ints, drawn: Bools) -> None:
    """Write triangles into the empty cells that the border of the triangulation passes through.

    Parameters
    ----------
    buffer : ndarray of int32, shape (rows, cols)
    corners : ndarray, shape (t, 3, 2) [cells]
    neighbors : ndarray, shape (t, 3)
        Triangle opposite to each corner, -1 for none.
    drawn : ndarray of bool, shape (t,)
    """
    for t in range(len(corners)):
        if not drawn[t]:
            continue
        for k in range(3):
            other = neighbors[t, k]
            if other >= 0 and drawn[other]:
                continue
            p, q = corners[t, (k + 1) % 3], corners[t, (k + 2) % 3]
            # Two steps per cell, and the cells around each: no cell on the edge is left out.
            steps = 2 * int(np.ceil(max(abs(q[0] - p[0]), abs(q[1] - p[1])))) + 1
            for i in range(steps + 1):
                share = i / steps
                col = int(np.floor(p[0] + (q[0] - p[0]) * share))
                row = int(np.floor(p[1] + (q[1] - p[1]) * share))
                for r in range(max(row - 1, 0), min(row + 2, buffer.shape[0])):
                    for c in range(max(col - 1, 0), min(col + 2, buffer.shape[1])):
                        if buffer[r, c] == EMPTY:
                            buffer[r, c] = t


@njit(cache=True, nogil=True)
def raise_limits(limits: Floats, corners: Floats, depth: Floats, size: int) -> None:
    """Raise the limit of every square of cells to the depth of the triangles that may touch it.

    Parameters
    ----------
    limits : ndarray, shape (a, b) [m]
    corners : ndarray, shape (t, 3, 2) [cells]
    depth : ndarray, shape (t,) [m]
    size : int
        Cells along a square.
    """
    rows, cols = limits.shape
    for t in range(len(corners)):
        x, y = corners[t, :, 0], corners[t, :, 1]
        first, last = int(y.min() - 1.0) // size, int(y.max() + 1.0) // size
        left, right = int(x.min() - 1.0) // size, int(x.max() + 1.0) // size
        for row in range(max(first, 0), min(last, rows - 1) + 1):
            for col in range(max(left, 0), min(right, cols - 1) + 1):
                limits[row, col] = max(limits[row, col], depth[t])
