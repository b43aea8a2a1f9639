"""Envelopes: the nearest or farthest of many straight edges at each bearing.

Seen from the origin, an edge has the inverse range a cos t + b sin t at bearing t. Two edges cross
at most once, so the nearest edges are an upper envelope, which is merged pairwise in O(n log n).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints

NO_EDGE = -1


@njit(cache=True, nogil=True)
def upper_envelope(t0: Floats, t1: Floats, a: Floats, b: Floats) -> tuple[Floats, Floats, Ints]:
    """Return the pieces of the maximum of edges: (lower bearing, upper bearing, edge), in order.

    Parameters
    ----------
    t0, t1 : ndarray, shape (n,) [rad]
        Bearings of the ends of each edge, t0 < t1, less than a half turn apart.
    a, b : ndarray, shape (n,) [1/m]
        Coefficients of the inverse range a cos t + b sin t.
    """
    count = t0.size
    low, high = t0.copy(), t1.copy()
    edge = np.arange(count)
    first = np.arange(count + 1)  # envelope e holds the pieces first[e] to first[e + 1]
    while first.size > 2:
        pairs = first.size // 2  # an unpaired envelope is copied
        room = 4 * low.size + 4
        new_low, new_high = np.empty(room), np.empty(room)
        new_edge, new_first = np.empty(room, np.int64), np.zeros(pairs + 1, np.int64)
        size = 0
        for pair in range(pairs):
            i0, i1 = first[2 * pair], first[2 * pair + 1]
            j1 = first[min(2 * pair + 2, first.size - 1)]
            size = _merge(low, high, edge, i0, i1, j1, a, b, new_low, new_high, new_edge, size)
            new_first[pair + 1] = size
        low, high, edge = new_low[:size], new_high[:size], new_edge[:size]
        first = new_first
    return low, high, edge


@njit(cache=True, nogil=True)
def _merge(
    low: Floats,
    high: Floats,
    edge: Ints,
    i: int,
    i1: int,
    j1: int,
    a: Floats,
    b: Floats,
    new_low: Floats,
    new_high: Floats,
    new_edge: Ints,
    size: int,
) -> int:
    """Merge the envelopes i..i1 and i1..j1 into the new arrays from `size` on."""
    j, start, here = i1, size, -np.inf
    while i < i1 or j < j1:
        at_i = max(low[i], here) if i < i1 else np.inf
        at_j = max(low[j], here) if j < j1 else np.inf
        if at_i < at_j:  # only the first envelope, up to the start of the second
            here = min(high[i], at_j)
            size = _append(at_i, here, edge[i], new_low, new_high, new_edge, start, size)
        elif at_j < at_i:
            here = min(high[j], at_i)
            size = _append(at_j, here, edge[j], new_low, new_high, new_edge, start, size)
        else:
            here = min(high[i], high[j])
            size = _append_higher(
                at_i, here, edge[i], edge[j], a, b, new_low, new_high, new_edge, start, size
            )
        if i < i1 and high[i] <= here:
            i += 1
        if j < j1 and high[j] <= here:
            j += 1
    return size


@njit(cache=True, nogil=True)
def _append(
    lower: float,
    upper: float,
    edge: int,
    low: Floats,
    high: Floats,
    edges: Ints,
    start: int,
    size: int,
) -> int:
    """Append a piece, or extend the last one if the piece continues it."""
    if upper <= lower:
        return size
    if size > start and edges[size - 1] == edge and high[size - 1] == lower:
        high[size - 1] = upper
        return size
    low[size], high[size], edges[size] = lower, upper, edge
    return size + 1


@njit(cache=True, nogil=True)
def _append_higher(
    lower: float,
    upper: float,
    i: int,
    j: int,
    a: Floats,
    b: Floats,
    low: Floats,
    high: Floats,
    edges: Ints,
    start: int,
    size: int,
) -> int:
    """Append the higher of two edges, and beyond a crossing the other one."""
    da, db = a[i] - a[j], b[i] - b[j]
    crossing = _crossing(da, db, lower, upper)
    if crossing > lower:
        i_first = da * np.cos(lower) + db * np.sin(lower) > 0.0
        first, second = (i, j) if i_first else (j, i)
        size = _append(lower, crossing, first, low, high, edges, start, size)
        return _append(crossing, upper, second, low, high, edges, start, size)
    middle = 0.5 * (lower + upper)
    higher = i if da * np.cos(middle) + db * np.sin(middle) >= 0.0 else j
    return _append(lower, upper, higher, low, high, edges, start, size)


@njit(cache=True, nogil=True)
def join_envelopes(
    low: Floats,
    high: Floats,
    edge: Ints,
    alone: Bools,
    a: Floats,
    b: Floats,
    far_low: Floats,
    far_high: Floats,
    far_edge: Ints,
    far_a: Floats,
    far_b: Floats,
) -> tuple[Floats, Floats, Ints, Bools]:
    """Return the bounds of freespace, from the nearest edges and the farthest supports.

    An edge that is `alone` bounds freespace. At other edges the nearer of edge and support does,
    if there is a support. Without an edge, the support does.

    Parameters
    ----------
    low, high : ndarray, shape (k,) [rad]
        Bearings of the pieces of the nearest edges, in order.
    edge : ndarray of int, shape (k,)
        Edge of each piece.
    alone : ndarray of bool, shape (n,)
        Edges that bound freespace without a support.
    a, b : ndarray, shape (n,) [1/m]
        Coefficients of the edges' inverse ranges.
    far_low, far_high : ndarray, shape (l,) [rad]
        Bearings of the pieces of the farthest supports, in order.
    far_edge : ndarray of int, shape (l,)
        Support of each piece.
    far_a, far_b : ndarray, shape (m,) [1/m]
        Coefficients of the supports' inverse ranges.

    Returns
    -------
    tuple
        Lower bearing, upper bearing, edge or support, and whether it is a support; in order.
    """
    room = 4 * (low.size + far_low.size) + 4
    out_low, out_high = np.empty(room), np.empty(room)
    out_edge, second = np.empty(room, np.int64), np.zeros(room, np.bool_)
    size, j, here = 0, 0, -np.inf
    for i in range(low.size + 1):
        until = low[i] if i < low.size else np.inf
        while j < far_low.size and far_low[j] < until:  # no edge
            lower, upper = max(far_low[j], here), min(far_high[j], until)
            if lower < upper:
                out_low[size], out_high[size], out_edge[size] = lower, upper, far_edge[j]
                second[size] = True
                size += 1
            if far_high[j] > until:
                break
            j += 1
        if i == low.size:
            break
        here = high[i]
        if alone[edge[i]]:
            out_low[size], out_high[size], out_edge[size] = low[i], high[i], edge[i]
            size += 1
            continue
        while j < far_low.size and far_low[j] < here:
            lower, upper = max(far_low[j], low[i]), min(far_high[j], here)
            if lower < upper:
                size = _append_nearer(
                    lower, upper, edge[i], far_edge[j], a[edge[i]] - far_a[far_edge[j]],
                    b[edge[i]] - far_b[far_edge[j]], out_low, out_high, out_edge, second, size,
                )  # fmt: skip
            if far_high[j] > here:
                break
            j += 1
    return out_low[:size], out_high[:size], out_edge[:size], second[:size]


@njit(cache=True, nogil=True)
def _append_nearer(
    lower: float,
    upper: float,
    edge: int,
    support: int,
    da: float,
    db: float,
    low: Floats,
    high: Floats,
    edges: Ints,
    second: Bools,
    size: int,
) -> int:
    """Append the nearer of an edge and a support, and beyond a crossing the other one.

    At bearing t the edge is nearer where da cos t + db sin t is above zero.
    """
    cut = _crossing(da, db, lower, upper)
    for begin, end in ((lower, cut), (cut, upper)):
        if begin < end:
            middle = 0.5 * (begin + end)
            second[size] = da * np.cos(middle) + db * np.sin(middle) < 0.0
            low[size], high[size] = begin, end
            edges[size] = support if second[size] else edge
            size += 1
    return size


@njit(cache=True, nogil=True)
def _crossing(da: float, db: float, lower: float, upper: float) -> float:
    """Return the root of da cos t + db sin t between two bearings, or `lower` without one."""
    at_lower = da * np.cos(lower) + db * np.sin(lower)
    at_upper = da * np.cos(upper) + db * np.sin(upper)
    if (at_lower < 0.0) != (at_upper < 0.0) and at_lower != 0.0 and at_upper != 0.0:
        crossing = np.arctan2(-da, db)
        if crossing < lower:
            crossing += np.pi
        elif crossing > upper:
            crossing -= np.pi
        if lower < crossing < upper:
            return float(crossing)
    return lower
