"""Running averages over flat arrays."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Counts, Floats32

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
