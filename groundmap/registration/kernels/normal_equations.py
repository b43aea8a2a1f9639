"""Normal equations of the motion that fits matched features best."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints
from groundmap.registration.kernels.alignment import square_of, to_bearing


@njit(cache=True, nogil=True)
def normal_equations(
    pose: Floats,
    points_a: Floats,
    partner: Ints,
    residuals: Floats,
    information: Floats,
    scale: float,
    directions: Floats,
) -> tuple[Floats, Floats]:
    """Return the normal equations of a small motion that reduces the residuals.

    Parameters
    ----------
    pose : ndarray, shape (3, 4)
    points_a : ndarray, shape (n, 3) [m]
    partner, residuals, information : ndarray
        From `match_features`.
    scale : float
        Squared Mahalanobis distance at which the weight of a match is a quarter.
    directions : ndarray, shape (6, d)
        Small motions, each a translation [m] and a rotation vector [rad], in B.

    Returns
    -------
    matrix : ndarray, shape (d, d)
    right : ndarray, shape (d,)
        The step solves ``matrix @ step = right``.
    """
    matrix = np.zeros((6, 6))
    right = np.zeros(6)
    design, weighted = np.zeros((3, 6)), np.zeros((3, 6))
    bearing = np.empty(3)
    for i in range(len(points_a)):
        if partner[i] < 0:
            continue
        to_bearing(pose, points_a[i], bearing)
        u, v, w = bearing
        x, y, z = u / w, v / w, 1.0 / w
        design[0, 0], design[0, 2] = w, -u * w
        design[1, 1], design[1, 2] = w, -v * w
        design[2, 2] = -w * w
        for k in range(3):
            by_x, by_y, by_z = design[k, 0], design[k, 1], design[k, 2]
            design[k, 3] = by_z * y - by_y * z
            design[k, 4] = by_x * z - by_z * x
            design[k, 5] = by_y * x - by_x * y
        weight = 1.0 / (1.0 + square_of(residuals[i], information[i]) / scale) ** 2
        for axis in range(3):
            for k in range(6):
                weighted[axis, k] = weight * (
                    information[i, axis, 0] * design[0, k]
                    + information[i, axis, 1] * design[1, k]
                    + information[i, axis, 2] * design[2, k]
                )
        for k in range(6):
            for axis in range(3):
                right[k] -= weighted[axis, k] * residuals[i, axis]
                for m in range(6):
                    matrix[k, m] += design[axis, k] * weighted[axis, m]
    return directions.T @ matrix @ directions, directions.T @ right
