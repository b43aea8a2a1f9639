"""Convex hulls of a few points, and their overlap with blocked cells.

Positions are in cells: x grows with the column, and cell [row, col] is the closed square from
(col, row) to (col + 1, row + 1).

A convex shape meets exactly those cells of a row whose columns overlap the extent in x of its part
within the row. Its outline is therefore clipped row by row, and a running count of blocked cells
covers all columns between the two ends at once.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints


@njit(cache=True, nogil=True)
def hull_of(points: Floats) -> Floats:
    """Return the convex hull of a few points, closed (Andrew 1979); sorts them in place."""
    n = len(points)
    for i in range(1, n):
        x, y = points[i]
        k = i
        while k > 0 and (points[k - 1, 0] > x or (points[k - 1, 0] == x and points[k - 1, 1] > y)):
            points[k, 0], points[k, 1] = points[k - 1, 0], points[k - 1, 1]
            k -= 1
        points[k, 0], points[k, 1] = x, y
    hull = np.empty((2 * n + 1, 2))
    size = turned = 0
    for i in range(2 * n - 1):
        at = i if i < n else 2 * n - 2 - i  # along the lower side, then back along the upper
        kept = 2 if i < n else turned + 1
        while size >= kept and not _turns_left(hull, size, points[at, 0], points[at, 1]):
            size -= 1
        hull[size, 0], hull[size, 1] = points[at, 0], points[at, 1]
        size += 1
        if i == n - 1:
            turned = size
    return hull[:size]


@njit(cache=True, nogil=True)
def _turns_left(hull: Floats, size: int, x: float, y: float) -> bool:
    ax, ay = hull[size - 2]
    bx, by = hull[size - 1]
    return bool((bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0)


@njit(cache=True, nogil=True)
def hull_clear(before: Ints, hull: Floats, grow: float) -> bool:
    """Whether a closed convex outline, grown in x and y, overlaps no blocked square.

    Parameters
    ----------
    before : ndarray of int64, shape (rows, cols + 1)
        Number of blocked cells of the row with a smaller column.
    hull : ndarray, shape (n, 2) [cells]
    grow : float [cells]
    """
    rows, cols = before.shape[0], before.shape[1] - 1
    low = max(math.floor(hull[:, 1].min() - grow), 0)
    high = min(math.floor(hull[:, 1].max() + grow), rows - 1)
    for row in range(low, high + 1):
        left, right = math.inf, -math.inf
        for i in range(len(hull) - 1):
            ax, ay, bx, by = hull[i, 0], hull[i, 1], hull[i + 1, 0], hull[i + 1, 1]
            lower, upper = clip_extent(ax, ay, bx, by, row - grow, row + 1.0 + grow)
            left, right = min(left, lower), max(right, upper)
        if left <= right:
            first, last = math.floor(left - grow), math.ceil(right + grow) - 1
            first, last = max(first, 0), min(last, cols - 1)
            if first <= last and before[row, last + 1] > before[row, first]:
                return False
    return True


@njit(cache=True, nogil=True)
def clip_extent(
    ax: float, ay: float, bx: float, by: float, low: float, high: float
) -> tuple[float, float]:
    """Return the extent in x of the part of a segment between two heights; (inf, -inf) if none.

    Parameters
    ----------
    ax, ay, bx, by : float [cells]
        Ends of the segment.
    low, high : float [cells]
    """
    if max(ay, by) < low or min(ay, by) > high:
        return math.inf, -math.inf
    if ay == by:
        return min(ax, bx), max(ax, bx)
    s, t = (low - ay) / (by - ay), (high - ay) / (by - ay)
    s, t = min(max(s, 0.0), 1.0), min(max(t, 0.0), 1.0)
    u, v = ax + s * (bx - ax), ax + t * (bx - ax)
    return min(u, v), max(u, v)
