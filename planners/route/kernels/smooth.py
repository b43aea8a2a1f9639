"""Smoothing a line: discs of free space around its points, and relaxation within them.

Positions are in cells, as in `planners.geometry.kernels.clearance`: x grows with the column, and
cell [row, col] is the closed square from (col, row) to (col + 1, row + 1).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats

HALVINGS = 7  # centres of discs are accurate to 1/128 of the distance that they may move
TENSION = 1e-3  # weight of the line's length against the constraints
STIFF = 10.0  # weight of the bends; it affects the rate of convergence, not the limit
OVERSHOOT = 1.6  # over-relaxation factor


@njit(cache=True, nogil=True)
def nearest(blocked: Bools, x: float, y: float, limit: float) -> tuple[float, float, float]:
    """Return the distance and position of the point of a blocked square nearest to (x, y).

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    x, y : float [cells]
    limit : float [cells]
        Farther squares are ignored; if there is no nearer one, (x, y) itself is returned.

    Returns
    -------
    float, float, float
        Distance, at most `limit`, and x, y.
    """
    rows, cols = blocked.shape
    col, row = math.floor(x), math.floor(y)
    farthest = max(col, cols - col, row, rows - row)
    best, at_x, at_y = limit, x, y
    for ring in range(farthest + 1):
        if ring - 1 >= best:
            break
        for i in range(max(row - ring, 0), min(row + ring + 1, rows)):
            step = 1 if abs(i - row) == ring else max(2 * ring, 1)
            for j in range(col - ring, col + ring + 1, step):
                if 0 <= j < cols and blocked[i, j]:
                    near_x, near_y = min(max(x, j), j + 1.0), min(max(y, i), i + 1.0)
                    away = math.hypot(near_x - x, near_y - y)
                    if away < best:
                        best, at_x, at_y = away, near_x, near_y
    return best, at_x, at_y


@njit(cache=True, nogil=True)
def free_discs(blocked: Bools, points: Floats, need: float, most: float) -> Floats:
    """Return for each point a disc in which the centre of a robot may be.

    A disc around the point itself would fix it where no clearance is spare. Therefore the centre
    moves away from the nearest square while the disc still contains the point. Such discs are
    nested, so that bisection finds the largest one.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    points : ndarray, shape (n, 2) [cells]
    need : float [cells]
        Distance to keep.
    most : float [cells]
        Largest distance that centres move.

    Returns
    -------
    ndarray, shape (n, 3) [cells]
        x and y of the centre, and the radius, 0 where nothing is free.
    """
    discs = np.empty((len(points), 3))
    limit = need + 2.0 * most
    for k in range(len(points)):
        x, y = points[k]
        away, near_x, near_y = nearest(blocked, x, y, limit)
        moved = 0.0
        if 0.0 < away < limit:
            dx, dy = (x - near_x) / away, (y - near_y) / away
            too_far = most
            for _ in range(HALVINGS):
                t = 0.5 * (moved + too_far)
                if nearest(blocked, x + t * dx, y + t * dy, limit)[0] >= min(away, need) + t:
                    moved = t
                else:
                    too_far = t
            there = nearest(blocked, x + moved * dx, y + moved * dy, limit)[0]
            if there > away:
                x, y, away = x + moved * dx, y + moved * dy, there
        discs[k] = x, y, max(away - need, 0.0)
    return discs


@njit(cache=True, nogil=True)
def relax(points: Floats, discs: Floats, bend: float, low: int, high: int, rounds: int) -> Floats:
    """Return an approximation of the shortest line within its discs and its bound on bends.

    It minimises the sum of squared steps, where no second difference
    ``p[i - 1] - 2 p[i] + p[i + 1]`` is longer than `bend` and every point is in its disc: a convex
    problem, solved by the alternating direction method of multipliers (Boyd et al. 2011). The
    first half of a round solves a banded linear system, the second projects each second
    difference and each point onto its bound.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        About equally spaced.
    discs : ndarray, shape (n, 3)
        x, y and radius.
    bend : float
        c s² for a curvature c at points a distance s apart.
    low, high : int
        Points before `low` and from `high` on are fixed: at least one at either end.
    rounds : int
    """
    n = len(points)
    bands = _bands(n)
    factors = _factorise(bands, low, high)
    x = points.copy()
    bends, bends_off = np.zeros((n, 2)), np.zeros((n, 2))
    for i in range(1, n - 1):
        bends[i] = x[i - 1] - 2.0 * x[i] + x[i + 1]
    places, places_off, right = x.copy(), np.zeros((n, 2)), np.zeros((n, 2))
    for _ in range(rounds):
        for i in range(n):
            right[i] = places[i] - places_off[i]
        for i in range(1, n - 1):
            for c in range(2):
                part = STIFF * (bends[i, c] - bends_off[i, c])
                right[i - 1, c] += part
                right[i, c] -= 2.0 * part
                right[i + 1, c] += part
        _solve(bands, factors, right, x, low, high)
        for i in range(n):
            _cut(x, i, places, places_off, discs[i, 0], discs[i, 1], discs[i, 2])
        for i in range(1, n - 1):
            for c in range(2):
                right[i, c] = x[i - 1, c] - 2.0 * x[i, c] + x[i + 1, c]
            _cut(right, i, bends, bends_off, 0.0, 0.0, bend)
    return x


@njit(cache=True, nogil=True)
def _cut(
    values: Floats, i: int, cut: Floats, off: Floats, x: float, y: float, radius: float
) -> None:
    """Project a value onto a disc, and accumulate the residual."""
    dx = OVERSHOOT * values[i, 0] + (1.0 - OVERSHOOT) * cut[i, 0] + off[i, 0] - x
    dy = OVERSHOOT * values[i, 1] + (1.0 - OVERSHOOT) * cut[i, 1] + off[i, 1] - y
    away = math.hypot(dx, dy)
    share = radius / away if away > radius else 1.0
    cut[i, 0], cut[i, 1] = x + share * dx, y + share * dy
    off[i, 0], off[i, 1] = (1.0 - share) * dx, (1.0 - share) * dy


@njit(cache=True, nogil=True)
def _bands(n: int) -> Floats:
    """Return diagonal and two upper bands of I + TENSION GᵀG + STIFF DᵀD.

    G takes steps, D second differences.
    """
    bands = np.zeros((n, 3))
    bands[:, 0] = 1.0
    for i in range(n - 1):
        bands[i, 0] += TENSION
        bands[i + 1, 0] += TENSION
        bands[i, 1] -= TENSION
    for i in range(1, n - 1):
        bands[i - 1, 0] += STIFF
        bands[i, 0] += 4.0 * STIFF
        bands[i + 1, 0] += STIFF
        bands[i - 1, 1] -= 2.0 * STIFF
        bands[i, 1] -= 2.0 * STIFF
        bands[i - 1, 2] += STIFF
    return bands


@njit(cache=True, nogil=True)
def _factorise(bands: Floats, low: int, high: int) -> Floats:
    """Return D and the two bands of L of the LDLᵀ decomposition for the movable points."""
    factors = np.zeros((len(bands), 3))
    for i in range(low, high):
        one = bands[i - 1, 1] if i - 1 >= low else 0.0
        two = bands[i - 2, 2] if i - 2 >= low else 0.0
        if i - 2 >= low:
            factors[i, 2] = two / factors[i - 2, 0]
            one -= two * factors[i - 1, 1]
        if i - 1 >= low:
            factors[i, 1] = one / factors[i - 1, 0]
        factors[i, 0] = bands[i, 0] - one * factors[i, 1] - two * factors[i, 2]
    return factors


@njit(cache=True, nogil=True)
def _solve(bands: Floats, factors: Floats, right: Floats, x: Floats, low: int, high: int) -> None:
    """Write the solution to the movable points of `x`."""
    n = len(x)
    for c in range(2):
        for i in range(low, high):
            value = right[i, c]
            for k in range(1, 3):  # fixed points
                if i - k >= 0 and i - k < low:
                    value -= bands[i - k, k] * x[i - k, c]
                if i + k < n and i + k >= high:
                    value -= bands[i, k] * x[i + k, c]
            if i - 1 >= low:
                value -= factors[i, 1] * right[i - 1, c]
            if i - 2 >= low:
                value -= factors[i, 2] * right[i - 2, c]
            right[i, c] = value
        for i in range(high - 1, low - 1, -1):
            value = right[i, c] / factors[i, 0]
            if i + 1 < high:
                value -= factors[i + 1, 1] * x[i + 1, c]
            if i + 2 < high:
                value -= factors[i + 2, 2] * x[i + 2, c]
            x[i, c] = value
