"""Smoothing of features along their lines of sight, by a fit to neighbours."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats

WIDEST = 0.2  # [rad], largest half-width of a neighbourhood
MOST = 2048  # neighbours to either side, which bounds the time in dense views
FEWEST = 3  # features to average, including itself; a slope takes one more
SAME_BEARING = 1e-9  # [rad]: neighbours whose bearings spread less are at one bearing
STIFFEST = 1e-3  # least relative determinant of a fit; below it, all neighbours have one bearing


@njit(cache=True, nogil=True)
def smooth_along_rays(
    bearings: Floats,
    inverse: Floats,
    sigma: Floats,
    half_width: float,
    gate: float,
    smoothed: Floats,
    deviation: Floats,
) -> None:
    """Fit a straight surface to the neighbours of each feature.

    Parameters
    ----------
    bearings, inverse, sigma : ndarray, shape (n,)
        Bearing, inverse range and its standard deviation, sorted by bearing. Along a straight
        surface, the inverse range is linear in the bearing to first order.
    half_width : float [m]
        Largest distance of neighbours across the line of sight.
    gate : float
        Largest difference of inverse ranges [standard deviations of the difference].
    smoothed, deviation : ndarray, shape (n,)
        Set to the fit at the feature's own bearing and to its standard deviation. The fit is
        clamped to the range of the neighbours, as a steep one may be behind the viewpoint.
    """
    count = len(bearings)
    for i in range(count):
        width = min(half_width * inverse[i], WIDEST)
        first, last = i, i
        while first > max(i - MOST, 0) and bearings[i] - bearings[first - 1] <= width:
            first -= 1
        while last < min(i + MOST, count - 1) and bearings[last + 1] - bearings[i] <= width:
            last += 1
        s0 = s1 = s2 = t0 = t1 = 0.0
        neighbours, farthest, nearest = 0, inverse[i], inverse[i]
        for k in range(first, last + 1):
            apart = inverse[k] - inverse[i]
            if apart * apart > gate * gate * (sigma[i] ** 2 + sigma[k] ** 2):
                continue
            weight, x = 1.0 / sigma[k] ** 2, bearings[k] - bearings[i]
            s0, s1, s2 = s0 + weight, s1 + weight * x, s2 + weight * x * x
            t0, t1 = t0 + weight * inverse[k], t1 + weight * inverse[k] * x
            neighbours += 1
            farthest, nearest = min(farthest, inverse[k]), max(nearest, inverse[k])
        determinant = s0 * s2 - s1 * s1
        if neighbours < FEWEST:
            smoothed[i], deviation[i] = inverse[i], sigma[i]
        elif neighbours > FEWEST and determinant > max(STIFFEST * s2, SAME_BEARING**2 * s0) * s0:
            smoothed[i] = (s2 * t0 - s1 * t1) / determinant
            deviation[i] = np.sqrt(s2 / determinant)
        else:
            smoothed[i], deviation[i] = t0 / s0, np.sqrt(1.0 / s0)
        smoothed[i] = min(max(smoothed[i], farthest), nearest)
