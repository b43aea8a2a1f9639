"""Interpolation of heights and covariances at vertices inside segments."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints


@njit(cache=True, nogil=True)
def blend_crossings(
    crossings: Ints, points: Floats, low: Floats, high: Floats, covariance: Floats
) -> None:
    """Set heights and covariance of vertices inside segments, interpolated between the ends.

    Parameters
    ----------
    crossings : ndarray, shape (c, 3)
        (vertex, a, b): the vertex lies inside the segment of vertices a, b.
    points : ndarray, shape (n, 2)
    low, high : ndarray, shape (n,)
        Height bands, widened in place.
    covariance : ndarray, shape (n, 2, 2)
        Set in place; of several segments, the last one counts.
    """
    for vertex, a, b in crossings:
        length = np.hypot(points[b, 0] - points[a, 0], points[b, 1] - points[a, 1])
        part = np.hypot(points[vertex, 0] - points[a, 0], points[vertex, 1] - points[a, 1])
        t = min(1.0, part / length)
        low[vertex] = min(low[vertex], (1 - t) * low[a] + t * low[b])
        high[vertex] = max(high[vertex], (1 - t) * high[a] + t * high[b])
        for i in range(2):
            for j in range(2):
                covariance[vertex, i, j] = (1 - t) * covariance[a, i, j] + t * covariance[b, i, j]
