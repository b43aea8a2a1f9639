"""The best chain of straight legs through points of a line, each leg exactly clear.

Positions are in cells, as in `planners.geometry.kernels.clearance`: x grows with the column, and
cell [row, col] is the closed square from (col, row) to (col + 1, row + 1).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Bytes, Floats, Ints, Ints32
from planners.geometry.kernels.clearance import segment_clearance

WORTH = 0.25  # [cells] shortest step along which the distance field replaces the exact check


@njit(cache=True, nogil=True)
def keeps(
    blocked: Bools, squared: Ints32, ax: float, ay: float, bx: float, by: float, need: float
) -> bool:
    """Whether the segment a-b keeps a distance to every blocked square, exactly.

    A point is at most half a diagonal from the centre of its cell, whose distance is known. This
    rejects most segments immediately and permits steps as long as the spare clearance. Only where
    little clearance is spare are pieces of a cell checked exactly.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    squared : ndarray of int32, shape (rows, cols) [(half cells)²]
        Squared distance from cell centres to the nearest blocked square.
    ax, ay, bx, by : float [cells]
    need : float [cells]
    """
    dx, dy = bx - ax, by - ay
    length = math.hypot(dx, dy)
    for exact in (False, True):
        at = 0.0
        while at <= length:
            s = at / length if length > 0.0 else 0.0
            x, y = ax + s * dx, ay + s * dy
            least, most = _bounds(squared, x, y)
            if most < need:
                return False
            step = least - need
            if step < WORTH:
                step = 1.0
                t = min((at + 1.0) / length, 1.0) if length > 0.0 else 0.0
                if exact and not _clear(blocked, x, y, ax + t * dx, ay + t * dy, need):
                    return False
            at += step
    return True


@njit(cache=True, nogil=True)
def leg_cost(factors: Floats | Bytes, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the length of the segment a-b, each part weighted by the factor of its cell.

    Parameters
    ----------
    factors : ndarray, shape (rows, cols)
    ax, ay, bx, by : float [cells]
    """
    rows, cols = factors.shape
    dx, dy = bx - ax, by - ay
    length = math.hypot(dx, dy)
    total, t = 0.0, 0.0
    x_border, y_border = _next_border(ax, dx), _next_border(ay, dy)
    while t < 1.0:
        tx = (x_border - ax) / dx if dx != 0.0 else math.inf
        ty = (y_border - ay) / dy if dy != 0.0 else math.inf
        then = min(tx, ty, 1.0)
        if then > t:
            middle = 0.5 * (t + then)
            row = min(max(math.floor(ay + middle * dy), 0), rows - 1)
            col = min(max(math.floor(ax + middle * dx), 0), cols - 1)
            total += (then - t) * length * factors[row, col]
            t = then
        if tx <= then:
            x_border += 1.0 if dx > 0.0 else -1.0
        if ty <= then:
            y_border += 1.0 if dy > 0.0 else -1.0
    return total


@njit(cache=True, nogil=True)
def best_chain(
    blocked: Bools,
    squared: Ints32,
    factors: Floats,
    points: Floats,
    begins: Ints,
    ends: Ints,
    need: float,
    wanted: float,
    price: float,
    ahead: int,
) -> Ints:
    """Return the points of the cheapest chain of legs from the first to the last, in order.

    A new leg is allowed within an old leg, and where it keeps its distance. Dynamic programming
    over all chains of allowed legs that span at most `ahead` points.

    Parameters
    ----------
    blocked, squared
        As for `keeps`.
    factors : ndarray, shape (rows, cols), or (0, 0)
        Cost per length, 1 or more; empty if it is uniform.
    points : ndarray, shape (n, 2) [cells]
    begins, ends : ndarray of int64, shape (n,)
        The old leg that begins at each point and the one that ends there; the same for points
        within a leg.
    need, wanted : float [cells]
        Distance to keep always; distance to keep where the old legs kept it (elsewhere, at least
        the distance of the old legs).
    price : float [cells]
        Cost of a leg in addition to its length.
    ahead : int
        Largest number of points that a leg spans.
    """
    n = len(points)
    kept = np.full(n, wanted)  # by the piece that leads to each point
    if wanted > need:
        for j in range(1, n):
            kept[j] = _clearance(blocked, points[j - 1], points[j], wanted)
    cost, before = np.zeros(n), np.zeros(n, dtype=np.int64)
    least = np.empty(n)
    for j in range(1, n):
        first = max(0, j - ahead)
        tightest = wanted
        for i in range(j - 1, first - 1, -1):
            tightest = min(tightest, kept[i + 1])
            least[i] = max(need, tightest)
        bx, by = points[j]
        ax, ay = points[j - 1]
        best, before[j] = cost[j - 1] + _leg(factors, ax, ay, bx, by) + price, j - 1
        for i in range(first, j - 1):
            ax, ay = points[i]
            if cost[i] + math.hypot(bx - ax, by - ay) + price >= best:
                continue
            if begins[i] != ends[j] and not keeps(blocked, squared, ax, ay, bx, by, least[i]):
                continue
            reached = cost[i] + _leg(factors, ax, ay, bx, by) + price
            if reached < best:
                best, before[j] = reached, i
        cost[j] = best
    return _chain(before)


@njit(cache=True, nogil=True)
def _leg(factors: Floats, ax: float, ay: float, bx: float, by: float) -> float:
    if factors.size == 0:
        return math.hypot(bx - ax, by - ay)
    return leg_cost(factors, ax, ay, bx, by)


@njit(cache=True, nogil=True)
def _clearance(blocked: Bools, a: Floats, b: Floats, limit: float) -> float:
    """Return the clearance of a segment, at most `limit`."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    pieces = max(1, math.ceil(max(abs(dx), abs(dy))))
    best = limit
    for k in range(pieces):
        s, t = k / pieces, (k + 1) / pieces
        best = segment_clearance(
            blocked, a[0] + s * dx, a[1] + s * dy, a[0] + t * dx, a[1] + t * dy, best
        )
    return best


@njit(cache=True, nogil=True)
def _clear(blocked: Bools, ax: float, ay: float, bx: float, by: float, need: float) -> bool:
    return segment_clearance(blocked, ax, ay, bx, by, need) >= need


@njit(cache=True, nogil=True)
def _bounds(squared: Ints32, x: float, y: float) -> tuple[float, float]:
    """Return bounds of the distance of a point to the nearest blocked square."""
    row = min(max(math.floor(y), 0), squared.shape[0] - 1)
    col = min(max(math.floor(x), 0), squared.shape[1] - 1)
    away = math.sqrt(squared[row, col]) / 2.0
    off = math.hypot(x - col - 0.5, y - row - 0.5)
    return away - off, away + off


@njit(cache=True, nogil=True)
def _next_border(a: float, d: float) -> float:
    return math.floor(a) + 1.0 if d > 0.0 else math.ceil(a) - 1.0


@njit(cache=True, nogil=True)
def _chain(before: Ints) -> Ints:
    chain = [len(before) - 1]
    while chain[-1] > 0:
        chain.append(before[chain[-1]])
    return np.array(chain[::-1], dtype=np.int64)
