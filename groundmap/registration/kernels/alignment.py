"""Matching of features under a motion, in coordinates in which stereo noise is uniform.

The coordinates of a feature are (x/z, y/z, 1/z): bearing and inverse depth. In them a stereo
camera's noise hardly depends on the depth, and averages over features are without bias.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints
from groundmap.registration.kernels.bins import bin_of, bins_per_side

NEAREST = 1e-3  # [m], depth below which a feature is not in view


@njit(cache=True, nogil=True)
def score_poses(
    poses: Floats,
    points_a: Floats,
    noise_a: Floats,
    labels_a: Ints,
    bearings_b: Floats,
    noise_b: Floats,
    labels_b: Ints,
    start: Ints,
    rows: Ints,
    size: float,
    gate: float,
    scores: Ints,
) -> None:
    """Count the features of A that meet a feature of B under motions that are roughly known.

    Parameters
    ----------
    poses : ndarray, shape (h, 3, 4)
    points_a : ndarray, shape (n, 3) [m]
    noise_a : ndarray, shape (n,)
        Standard deviation of the inverse depth [1/m].
    labels_a : ndarray, shape (n,)
        Only features with equal labels meet.
    bearings_b : ndarray, shape (m, 3)
    noise_b : ndarray, shape (m,)
    labels_b : ndarray, shape (m,)
    start, rows : ndarray
        From `fill_bins`.
    size : float
        Side of the bins.
    gate : float
        Uncertainty of bearings under these motions; at most `size`.
    scores : ndarray, shape (h,)
        Result. Motions are given up after a third of the features if they are far behind the best.
    """
    best = 0
    third = max(len(points_a) // 3, 1)
    bearing = np.empty(3)
    for h in range(len(poses)):
        count = 0
        for i in range(len(points_a)):
            if i == third and 6 * count < best:
                break
            if to_bearing(poses[h], points_a[i], bearing):
                slack = gate * bearing[2] + 2.0 * noise_a[i]
                count += _meets(
                    bearing,
                    labels_a[i],
                    slack,
                    bearings_b,
                    noise_b,
                    labels_b,
                    start,
                    rows,
                    size,
                    gate,
                )
        scores[h] = count
        best = max(best, count)


@njit(cache=True, nogil=True)
def _meets(
    bearing: Floats,
    label: int,
    slack: float,
    bearings_b: Floats,
    noise_b: Floats,
    labels_b: Ints,
    start: Ints,
    rows: Ints,
    size: float,
    gate: float,
) -> bool:
    """Return whether a feature of B is near a bearing and an inverse depth."""
    side = bins_per_side(size)
    first, last = bin_of(bearing[0] - gate, size), bin_of(bearing[0] + gate, size)
    for line in range(bin_of(bearing[1] - gate, size), bin_of(bearing[1] + gate, size) + 1):
        for at in range(start[line * side + first], start[line * side + last + 1]):
            j = rows[at]
            if (
                abs(bearings_b[j, 0] - bearing[0]) <= gate
                and abs(bearings_b[j, 1] - bearing[1]) <= gate
                and abs(bearings_b[j, 2] - bearing[2]) <= slack + 2.0 * noise_b[j]
                and labels_b[j] == label
            ):
                return True
    return False


@njit(cache=True, nogil=True)
def match_features(
    pose: Floats,
    points_a: Floats,
    covariance_a: Floats,
    labels_a: Ints,
    bearings_b: Floats,
    covariance_b: Floats,
    labels_b: Ints,
    start: Ints,
    rows: Ints,
    size: float,
    gate: float,
    most: float,
    partner: Ints,
    residuals: Floats,
    information: Floats,
) -> int:
    """Match each feature of A to the best feature of B, one to one, under a motion.

    Parameters
    ----------
    pose : ndarray, shape (3, 4)
    points_a : ndarray, shape (n, 3) [m]
    covariance_a : ndarray, shape (n, 3, 3) [m²]
    labels_a : ndarray, shape (n,)
        Only features with equal labels match.
    bearings_b : ndarray, shape (m, 3)
    covariance_b : ndarray, shape (m, 3, 3)
        Of the bearings and inverse depths.
    labels_b : ndarray, shape (m,)
    start, rows : ndarray
        From `fill_bins`.
    size : float
        Side of the bins.
    gate : float
        Uncertainty of bearings that is due to the motion; at most a third of `size`.
    most : float
        Largest squared Mahalanobis distance.
    partner : ndarray, shape (n,)
        Result: row of the feature of B, or -1.
    residuals : ndarray, shape (n, 3)
        Result: bearing and inverse depth of the feature of A less those of its partner.
    information : ndarray, shape (n, 3, 3)
        Result: inverse covariance of the residuals.

    Returns
    -------
    int
        Number of matches.
    """
    side = bins_per_side(size)
    taken = np.full(len(bearings_b), -1, dtype=np.int64)
    distance = np.full(len(points_a), np.inf)
    own, inverse = np.empty((3, 3)), np.empty((3, 3))
    work, bearing, difference = np.empty((2, 3, 3)), np.empty(3), np.empty(3)
    for i in range(len(points_a)):
        partner[i] = -1
        if not to_bearing(pose, points_a[i], bearing):
            continue
        _bearing_covariance(pose, covariance_a[i], bearing, work, own)
        own[0, 0] += gate * gate
        own[1, 1] += gate * gate
        own[2, 2] += gate * gate * bearing[2] * bearing[2]
        middle = bin_of(bearing[1], size) * side + bin_of(bearing[0], size)
        best, least = -1, np.inf
        for line in range(middle - side, middle + side + 1, side):
            for at in range(start[line - 1], start[line + 2]):
                j = rows[at]
                if labels_a[i] != labels_b[j]:
                    continue
                for k in range(3):
                    difference[k] = bearing[k] - bearings_b[j, k]
                off = _distance(difference, own, covariance_b[j], most, work[0], inverse)
                if off > most or off >= least or (taken[j] >= 0 and distance[taken[j]] <= off):
                    continue
                best, least = j, off
                residuals[i] = difference
                information[i] = inverse
        if best >= 0:
            if taken[best] >= 0:  # the feature that was matched to it loses its match
                partner[taken[best]] = -1
            partner[i], taken[best], distance[i] = best, i, least
    return int((partner >= 0).sum())


@njit(cache=True, nogil=True)
def to_bearing(pose: Floats, point: Floats, bearing: Floats) -> bool:
    """Compute (x/z, y/z, 1/z) of a feature that a motion moves; return whether it is in view.

    Parameters
    ----------
    pose : ndarray, shape (3, 4)
    point : ndarray, shape (3,) [m]
    bearing : ndarray, shape (3,)
        Result.
    """
    for k in range(3):
        bearing[k] = (
            pose[k, 0] * point[0] + pose[k, 1] * point[1] + pose[k, 2] * point[2] + pose[k, 3]
        )
    if bearing[2] < NEAREST:
        return False
    bearing[2] = 1.0 / bearing[2]
    bearing[0] *= bearing[2]
    bearing[1] *= bearing[2]
    return True


@njit(cache=True, nogil=True)
def _distance(
    difference: Floats, one: Floats, other: Floats, most: float, work: Floats, inverse: Floats
) -> float:
    """Return the squared Mahalanobis distance, and compute the inverse of the covariance.

    Infinite without an inverse if the difference along one axis alone is too large.
    """
    for k in range(3):
        if difference[k] ** 2 > most * (one[k, k] + other[k, k]):
            return np.inf
    for k in range(3):
        for m in range(3):
            work[k, m] = one[k, m] + other[k, m]
    _invert(work, inverse)
    return square_of(difference, inverse)


@njit(cache=True, nogil=True)
def _bearing_covariance(
    pose: Floats, covariance: Floats, bearing: Floats, work: Floats, result: Floats
) -> None:
    """Compute the covariance of (x/z, y/z, 1/z) of a feature that a motion moves."""
    u, v, w = bearing
    turned, half = work[0], work[1]
    for k in range(3):
        turned[0, k] = w * (pose[0, k] - u * pose[2, k])
        turned[1, k] = w * (pose[1, k] - v * pose[2, k])
        turned[2, k] = -w * w * pose[2, k]
    for i in range(3):
        for m in range(3):
            half[i, m] = (
                turned[i, 0] * covariance[0, m]
                + turned[i, 1] * covariance[1, m]
                + turned[i, 2] * covariance[2, m]
            )
    for i in range(3):
        for m in range(3):
            result[i, m] = (
                half[i, 0] * turned[m, 0] + half[i, 1] * turned[m, 1] + half[i, 2] * turned[m, 2]
            )


@njit(cache=True, nogil=True)
def _invert(matrix: Floats, result: Floats) -> None:
    """Compute the inverse of a symmetric matrix, shape (3, 3); the diagonal is kept above zero."""
    a, b, c = matrix[0, 0] + 1e-18, matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1] + 1e-18, matrix[1, 2], matrix[2, 2] + 1e-18
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    share = 1.0 / max(a * first + b * second + c * third, 1e-54)
    result[0, 0], result[0, 1], result[0, 2] = first * share, second * share, third * share
    result[1, 1] = (a * f - c * c) * share
    result[1, 2] = (b * c - a * e) * share
    result[2, 2] = (a * d - b * b) * share
    result[1, 0], result[2, 0], result[2, 1] = result[0, 1], result[0, 2], result[1, 2]


@njit(cache=True, nogil=True)
def square_of(difference: Floats, information: Floats) -> float:
    """Return the squared Mahalanobis distance.

    Parameters
    ----------
    difference : ndarray, shape (3,)
    information : ndarray, shape (3, 3)
        Inverse covariance.
    """
    square = 0.0
    for k in range(3):
        for m in range(3):
            square += difference[k] * information[k, m] * difference[m]
    return square
