"""Averaging features with their neighbours, along the lines of sight."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats

WIDEST = 0.2  # [rad], of a neighbourhood to either side
MOST = 2048  # neighbours to either side: more say nothing new, and all of all would be a square
FEWEST = 3  # neighbours, itself included, to average; one more, to fit a slope
SAME_BEARING = 1e-9  # [rad]: neighbours whose bearings spread less are at one bearing
STIFFEST = 1e-3  # of the fit's determinant: below this the neighbours are all at one bearing


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
    """Fit, around each feature, a straight surface to those that may be on it.

    Parameters
    ----------
    bearings, inverse, sigma : ndarray, shape (n,)
        Sorted by bearing: bearing, inverse range, and the inverse range's standard deviation. Along
        a straight surface the inverse range is linear in the bearing, to first order.
    half_width : float [m]
        How far neighbours are across the line of sight.
    gate : float
        How far their inverse ranges differ [standard deviations of the difference].
    smoothed, deviation : ndarray, shape (n,)
        Set to the fit at the feature's own bearing and its standard deviation. No feature is moved
        nearer or farther than all of its neighbours: a steep fit may leave the half-line of sight.
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
