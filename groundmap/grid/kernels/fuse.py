"""Update rules over flat arrays."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Counts, Floats, Floats32, Ints

MOST = np.uint32(0xFFFFFFFF)


@njit(cache=True, nogil=True)
def update_average(confidence: Floats32, count: Counts, z: Floats32, cap: int) -> None:
    """Update running averages in place where z is not 0: x += (z - x) / (k + 1).

    Parameters
    ----------
    confidence, count : ndarray, shape (n,)
        Average x and count k, updated in place.
    z : ndarray of float32, shape (n,)
    cap : int
        Value at which counts stop.
    """
    for i in range(z.size):
        if z[i] != 0.0:
            k = count[i]
            weight = np.float32(1.0) / np.float32(k + 1)
            confidence[i] += weight * (z[i] - confidence[i])
            if k < cap:
                count[i] = k + 1


@njit(cache=True, nogil=True)
def update_exponential(
    confidence: Floats32, count: Counts, z: Floats32, alpha: float, most: int
) -> None:
    """Update exponential averages in place where z is not 0: x += alpha (z - x), first x = z.

    Parameters
    ----------
    confidence, count : ndarray, shape (n,)
        Average x and number of views, updated in place.
    z : ndarray of float32, shape (n,)
    alpha : float
    most : int
        Value at which counts stop.
    """
    for i in range(z.size):
        if z[i] != 0.0:
            weight = np.float32(alpha if count[i] > 0 else 1.0)
            confidence[i] += weight * (z[i] - confidence[i])
            if count[i] < most:
                count[i] += 1


@njit(cache=True, nogil=True)
def update_log_odds(
    confidence: Floats32,
    count: Counts,
    z: Floats32,
    nonfree: float,
    free: float,
    clamp: float,
    most: int,
) -> None:
    """Add log-odds in place where z is not 0; a confidence is tanh(log-odds / 2).

    Parameters
    ----------
    confidence, count : ndarray, shape (n,)
        Confidence and number of views, updated in place.
    z : ndarray of float32, shape (n,)
    nonfree, free : float
        Confidence that evidence of 1 and of -1 alone makes, in (0, 1).
    clamp : float
        Largest size of a confidence, in (0, 1).
    most : int
        Value at which counts stop.
    """
    for i in range(z.size):
        if z[i] != 0.0:
            said = z[i] * (nonfree if z[i] > 0.0 else free)
            # tanh(a + b) = (tanh a + tanh b) / (1 + tanh a tanh b)
            x = (confidence[i] + said) / (1.0 + confidence[i] * said)
            confidence[i] = np.float32(min(max(x, -clamp), clamp))
            if count[i] < most:
                count[i] += 1


@njit(cache=True, nogil=True)
def merge_average(confidence: Floats32, count: Counts, other: Floats32, others: Counts) -> None:
    """Merge two running averages, weighted by their counts, in place; counts saturate.

    Parameters
    ----------
    confidence, count : ndarray, shape (n,)
        Updated in place.
    other, others : ndarray, shape (n,)
        Averages and counts that are added.
    """
    for i in range(other.size):
        if others[i] > 0:
            ours, theirs = np.float64(count[i]), np.float64(others[i])
            total = ours * confidence[i] + theirs * other[i]
            confidence[i] = np.float32(total / (ours + theirs))
            count[i] += min(others[i], MOST - count[i])


@njit(cache=True, nogil=True)
def keep_low(z: Floats32, height: Floats32, sight: float, top: float, low: Floats32) -> None:
    """Copy evidence below a height.

    Parameters
    ----------
    z, height : ndarray of float32, shape (n,)
        Evidence and its height [m].
    sight, top : float [m]
        Heights below which free and non-free evidence is copied.
    low : ndarray of float32, shape (n,)
        Destination.
    """
    for i in range(z.size):
        if z[i] != 0.0 and height[i] < (sight if z[i] < 0.0 else top):
            low[i] = z[i]


@njit(cache=True, nogil=True)
def beyond_one(z: Floats | Floats32) -> bool:
    """Whether any of the numbers, shape (n,), is NaN or beyond [-1, 1]."""
    beyond = 0
    for i in range(z.size):
        beyond += not abs(z[i]) <= 1.0
    return beyond > 0


@njit(cache=True, nogil=True)
def parts_with_evidence(z: Floats32, offset: Ints, side: Ints, some: Bools) -> None:
    """Tell which parts of a block, cut at multiples of `side`, hold a number that is not 0.

    Parameters
    ----------
    z : ndarray of float32, shape (layers, rows, cols)
    offset : ndarray, shape (3,)
        Of the block's first cell from the border of the part that it lies in.
    side : ndarray, shape (3,)
        Cells along each axis of a part.
    some : ndarray of bool, shape of the parts
        Is set to true where there is one.
    """
    for i in range(z.shape[0]):
        for j in range(z.shape[1]):
            a, b = (i + offset[0]) // side[0], (j + offset[1]) // side[1]
            k = 0
            for part in range(some.shape[2]):
                end = min((part + 1) * side[2] - offset[2], z.shape[2])
                if not some[a, b, part]:
                    while k < end:
                        if z[i, j, k] != 0.0:
                            some[a, b, part] = True
                            break
                        k += 1
                k = end
