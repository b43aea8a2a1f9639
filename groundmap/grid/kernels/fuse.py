"""Running averages over flat arrays: the innermost loop of every map."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Counts, Floats32

MOST = np.uint32(0xFFFFFFFF)


@njit(cache=True, nogil=True)
def update_average(confidence: Floats32, count: Counts, z: Floats32, cap: int) -> None:
    """x += w (z - x), w = 1 / (k + 1), where z is not 0; k stops growing at `cap`."""
    for i in range(z.size):
        if z[i] != 0.0:
            k = count[i]
            weight = np.float32(1.0) / np.float32(k + 1)
            confidence[i] += weight * (z[i] - confidence[i])
            if k < cap:
                count[i] = k + 1


@njit(cache=True, nogil=True)
def merge_average(confidence: Floats32, count: Counts, other: Floats32, others: Counts) -> None:
    """Count-weighted mean of two averages, in place in the first; counts stop at their largest."""
    for i in range(other.size):
        if others[i] > 0:
            ours, theirs = np.float64(count[i]), np.float64(others[i])
            total = ours * confidence[i] + theirs * other[i]
            confidence[i] = np.float32(total / (ours + theirs))
            count[i] += min(others[i], MOST - count[i])


@njit(cache=True, nogil=True)
def keep_low(z: Floats32, height: Floats32, sight: float, top: float, low: Floats32) -> None:
    """Copy to `low` the free evidence of sight below `sight` and the non-free of tops below `top`.

    All arrays have the shape (n,); heights are in metres.
    """
    for i in range(z.size):
        if z[i] != 0.0 and height[i] < (sight if z[i] < 0.0 else top):
            low[i] = z[i]
