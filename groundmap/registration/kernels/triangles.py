"""Hypotheses of a motion from triangles of features whose sides agree in both views."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints


@njit(cache=True, nogil=True)
def find_candidates(
    points_a: Floats,
    points_b: Floats,
    slack_b: Floats,
    labels_a: Ints,
    labels_b: Ints,
    reach: Floats,
) -> tuple[Ints, Ints]:
    """Return the features of B within reach of each feature of A, as rows of one list.

    Parameters
    ----------
    points_a, points_b : ndarray, shape (n, 3) and (m, 3) [m, b]
        Features of A where the guessed motion places them, and features of B.
    slack_b : ndarray, shape (m,) [m]
        Uncertainty of the features of B.
    labels_a, labels_b : ndarray, shape (n,) and (m,)
        Only features with equal labels are candidates.
    reach : ndarray, shape (n,) [m]

    Returns
    -------
    start : ndarray, shape (n + 1,)
        The candidates of feature i are ``partner[start[i] : start[i + 1]]``.
    partner : ndarray of int
        Rows of `points_b`.
    """
    start = np.zeros(len(points_a) + 1, dtype=np.int64)
    partner = np.empty(len(points_a) * len(points_b), dtype=np.int64)
    count = 0
    for i in range(len(points_a)):
        for j in range(len(points_b)):
            if labels_a[i] == labels_b[j]:
                square = 0.0
                for k in range(3):
                    square += (points_a[i, k] - points_b[j, k]) ** 2
                if square <= (reach[i] + slack_b[j]) ** 2:
                    partner[count] = j
                    count += 1
        start[i + 1] = count
    return start, partner[:count].copy()


@njit(cache=True, nogil=True)
def match_triangles(
    triangles: Ints,
    points_a: Floats,
    covariance_a: Floats,
    points_b: Floats,
    covariance_b: Floats,
    spread_b: Floats,
    labels_a: Ints,
    labels_b: Ints,
    start: Ints,
    partner: Ints,
    sigmas: float,
    turn: float,
    matched: Ints,
) -> int:
    """Find triangles of B whose sides and orientation agree with triangles of A.

    Parameters
    ----------
    triangles : ndarray, shape (k, 3)
        Rows of `points_a`.
    points_a : ndarray, shape (n, 3) [m, camera]
    covariance_a : ndarray, shape (n, 3, 3) [m²]
    points_b : ndarray, shape (m, 3) [m, camera]
        In the order of x.
    covariance_b : ndarray, shape (m, 3, 3) [m²]
    spread_b : ndarray, shape (m,) [m]
        Bound of the standard deviation in any direction.
    labels_a, labels_b : ndarray, shape (n,) and (m,)
        Only features with equal labels match.
    start, partner : ndarray
        Candidates, from `find_candidates`.
    sigmas : float
        Largest difference of two lengths [standard deviations].
    turn : float
        Largest change of a side, as a share of its length: a bound of the rotation.
    matched : ndarray, shape (most, 4)
        Result: triangle of A, three rows of `points_b`; the same number for each triangle at most.

    Returns
    -------
    int
        Number of rows of `matched` that were written.
    """
    count = 0
    sides = np.empty((3, 3))
    noise = np.empty((3, 2))
    columns = points_b[:, 0].copy()
    slack = 0.0  # bound of the noise along x and y
    for j in range(len(points_b)):
        lateral = max(covariance_b[j, 0, 0], covariance_b[j, 1, 1])
        slack = max(slack, 2.0 * sigmas * np.sqrt(lateral))
    share = len(matched) // max(len(triangles), 1)
    for number in range(len(triangles)):
        limit = count + share
        first, second, third = triangles[number]
        _side(points_a, covariance_a, first, second, sides[0], noise[0])
        _side(points_a, covariance_a, first, third, sides[1], noise[1])
        _side(points_a, covariance_a, second, third, sides[2], noise[2])
        reach = turn * noise[:, 0] + slack
        for at_1 in range(start[first], start[first + 1]):
            if count == limit:
                break
            one = partner[at_1]
            low, high = _window(columns, points_b[one, 0] + sides[0, 0], reach[0])
            low_3, high_3 = _window(columns, points_b[one, 0] + sides[1, 0], reach[1])
            for two in range(low, high):
                if count == limit:
                    break
                if (
                    two == one
                    or abs(points_b[two, 1] - points_b[one, 1] - sides[0, 1]) > reach[0]
                    or labels_a[second] != labels_b[two]
                    or not _agrees(
                        points_b, covariance_b, spread_b, one, two, sides[0], noise[0], sigmas, turn
                    )
                ):
                    continue
                for three in range(low_3, high_3):
                    if abs(points_b[three, 1] - points_b[one, 1] - sides[1, 1]) > reach[1]:
                        continue
                    if (
                        count < limit
                        and three not in (one, two)
                        and labels_a[third] == labels_b[three]
                        and _agrees(
                            points_b,
                            covariance_b,
                            spread_b,
                            one,
                            three,
                            sides[1],
                            noise[1],
                            sigmas,
                            turn,
                        )
                        and _agrees(
                            points_b,
                            covariance_b,
                            spread_b,
                            two,
                            three,
                            sides[2],
                            noise[2],
                            sigmas,
                            turn,
                        )
                    ):
                        matched[count, 0] = number
                        matched[count, 1] = one
                        matched[count, 2] = two
                        matched[count, 3] = three
                        count += 1
    return count


@njit(cache=True, nogil=True)
def _window(columns: Floats, middle: float, reach: float) -> tuple[int, int]:
    """Return the range of points whose x is within reach of a value."""
    low = int(np.searchsorted(columns, middle - reach))
    return low, int(np.searchsorted(columns, middle + reach))


@njit(cache=True, nogil=True)
def _side(points: Floats, covariance: Floats, i: int, j: int, side: Floats, noise: Floats) -> None:
    """Compute the side between two points, its length [m] and the length's variance [m²]."""
    square, variance = 0.0, 0.0
    for k in range(3):
        side[k] = points[j, k] - points[i, k]
        square += side[k] ** 2
    for k in range(3):
        for m in range(3):
            variance += side[k] * (covariance[i, k, m] + covariance[j, k, m]) * side[m]
    noise[0] = np.sqrt(square)
    noise[1] = variance / max(square, 1e-12)


@njit(cache=True, nogil=True)
def _agrees(
    points: Floats,
    covariance: Floats,
    spread: Floats,
    i: int,
    j: int,
    side: Floats,
    noise: Floats,
    sigmas: float,
    turn: float,
) -> bool:
    """Return whether the side between two points has the length and direction of a given one."""
    x = points[j, 0] - points[i, 0]
    y = points[j, 1] - points[i, 1]
    z = points[j, 2] - points[i, 2]
    change = (x - side[0]) ** 2 + (y - side[1]) ** 2 + (z - side[2]) ** 2
    slack = turn * noise[0] + sigmas * (spread[i] + spread[j])
    if change > slack * slack:  # the cheap test first
        return False
    square = x * x + y * y + z * z
    variance = noise[1]
    for end in (i, j):
        c = covariance[end]
        across = x * y * c[0, 1] + x * z * c[0, 2] + y * z * c[1, 2]
        along = x * x * c[0, 0] + y * y * c[1, 1] + z * z * c[2, 2]
        variance += (along + 2.0 * across) / max(square, 1e-12)
    return bool(abs(np.sqrt(square) - noise[0]) <= sigmas * np.sqrt(variance))


@njit(cache=True, nogil=True)
def poses_of_triangles(
    triangles: Ints,
    matched: Ints,
    points_a: Floats,
    points_b: Floats,
    poses: Floats,
) -> None:
    """Compute the motions that move triangles of A onto those of B.

    Parameters
    ----------
    triangles : ndarray, shape (k, 3)
    matched : ndarray, shape (h, 4)
        From `match_triangles`.
    points_a, points_b : ndarray, shape (n, 3) and (m, 3) [m]
    poses : ndarray, shape (h, 3, 4)
        Result: rotation and translation, ``p_b = R @ p_a + t``.
    """
    axes_a = np.empty((3, 3))
    axes_b = np.empty((3, 3))
    for row in range(len(matched)):
        triangle = triangles[matched[row, 0]]
        _axes(points_a, triangle[0], triangle[1], triangle[2], axes_a)
        _axes(points_b, matched[row, 1], matched[row, 2], matched[row, 3], axes_b)
        for i in range(3):
            shift = 0.0
            for corner in range(3):
                shift += points_b[matched[row, corner + 1], i] / 3.0
            for j in range(3):
                entry = 0.0
                for k in range(3):
                    entry += axes_b[k, i] * axes_a[k, j]
                poses[row, i, j] = entry
                for corner in range(3):
                    shift -= entry * points_a[triangle[corner], j] / 3.0
            poses[row, i, 3] = shift


@njit(cache=True, nogil=True)
def _axes(points: Floats, i: int, j: int, k: int, axes: Floats) -> None:
    """Compute the axes of a triangle: along its first side, in its plane, and across it."""
    for row, end in ((0, j), (1, k)):
        for axis in range(3):
            axes[row, axis] = points[end, axis] - points[i, axis]
    _scale(axes[0])
    _cross(axes[0], axes[1], axes[2])
    _scale(axes[2])
    _cross(axes[2], axes[0], axes[1])


@njit(cache=True, nogil=True)
def _cross(one: Floats, other: Floats, result: Floats) -> None:
    result[0] = one[1] * other[2] - one[2] * other[1]
    result[1] = one[2] * other[0] - one[0] * other[2]
    result[2] = one[0] * other[1] - one[1] * other[0]


@njit(cache=True, nogil=True)
def _scale(vector: Floats) -> None:
    """Scale a vector to length 1, in place."""
    length = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    for axis in range(3):
        vector[axis] /= max(length, 1e-12)
