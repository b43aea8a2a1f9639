"""Costs of edges between sampled states: their length, the cells they cross, and their duration.

Positions are in metres from the map's outer corner, as in OMPL's states. A straight line is cut at
the borders of the cells, so the cost of its cells is exact. A curve is cut into the chords between
the poses of the route, and costs what the cells that the chords cross cost.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Floats
from planners.geometry.kernels.curves import SEGMENTS, along, wrap
from planners.geometry.kernels.swept_footprint import cuts
from planners.route.kernels.shortcut import leg_cost
from planners.sampling.kernels.edges import (
    SIZE,
    TURNING,
    comes_later,
    curve_motions,
    curve_word,
    to_shape,
)

# Positions in `prices`: cost of the length of a cell's side, the same per unit of the cell's cost,
# and costs of the time to drive a cell's side and to turn by a radian at full speed.
LENGTH, COST, DRIVE, TURN = range(4)


@njit(cache=True, nogil=True)
def line_cost(
    costs: Bytes, numbers: Floats, prices: Floats, ax: float, ay: float, bx: float, by: float
) -> float:
    """Return the cost of the straight line from a to b.

    Parameters
    ----------
    costs : ndarray of uint8, shape (rows, cols)
        Of cells, at most 252.
    numbers : ndarray, shape (8,)
        As in `Body`.
    prices : ndarray, shape (4,)
    ax, ay, bx, by : float [m, corner]
        Start and end of the line.
    """
    size = numbers[SIZE]
    ax, ay, bx, by = ax / size, ay / size, bx / size, by / size
    total: float = (prices[LENGTH] + prices[DRIVE]) * math.hypot(bx - ax, by - ay)
    if prices[COST] > 0.0:
        total += prices[COST] * leg_cost(costs, ax, ay, bx, by)
    return total


@njit(cache=True, nogil=True)
def slide_cost(
    costs: Bytes,
    numbers: Floats,
    prices: Floats,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
) -> float:
    """Return the cost of a straight motion from a to b with a simultaneous turn.

    Its duration is that of the slower one, driving or turning.

    Parameters
    ----------
    costs, numbers, prices : ndarray
        As for `line_cost`.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        First and last pose.
    """
    size = numbers[SIZE]
    ax, ay, bx, by = ax / size, ay / size, bx / size, by / size
    length = math.hypot(bx - ax, by - ay)
    total: float = prices[LENGTH] * length
    total += max(prices[DRIVE] * length, prices[TURN] * abs(wrap(b - a)))
    if prices[COST] > 0.0:
        total += prices[COST] * leg_cost(costs, ax, ay, bx, by)
    return total


@njit(cache=True, nogil=True)
def curve_cost(
    forward: bool,
    costs: Bytes,
    numbers: Floats,
    prices: Floats,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
) -> float:
    """Return the cost of the shortest curve from a to b.

    Parameters
    ----------
    forward : bool
        Whether the curve is a Dubins curve; else a Reeds-Shepp curve, which costs the same in both
        directions.
    costs, numbers, prices : ndarray
        As for `line_cost`.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        First and last pose.
    """
    if not forward and comes_later(ax, ay, a, bx, by, b):
        ax, ay, a, bx, by, b = bx, by, b, ax, ay, a
    curvatures, lengths = curve_motions(forward, numbers, ax, ay, a, bx, by, b)
    # Only the numbers of a footprint determine the steps of a curve.
    shape = to_shape(np.empty((0, 2)), np.empty(0, dtype=np.int64), np.empty((0, 3)), numbers)
    x, y, yaw = ax / numbers[SIZE], ay / numbers[SIZE], a
    total = 0.0
    for i in range(len(lengths)):
        curvature, length = curvatures[i], lengths[i]
        turn = curvature * length
        steps = cuts(shape, curvature, length) if turn != 0.0 else 1
        chord = length if turn == 0.0 else 2.0 * math.sin(0.5 * turn / steps) / curvature
        total += max(prices[DRIVE] * abs(length), prices[TURN] * abs(turn))
        total += prices[LENGTH] * abs(chord) * steps
        if prices[COST] > 0.0:
            total += prices[COST] * _chords_cost(costs, x, y, yaw, chord, turn / steps, steps)
        x, y, yaw = along(x, y, yaw, curvature, length)
    return total


@njit(cache=True, nogil=True)
def _chords_cost(
    costs: Bytes, x: float, y: float, yaw: float, chord: float, turn: float, steps: int
) -> float:
    """Return the sum over chords of their length times the cost of their cells.

    Each chord is rotated by `turn` against the one before it.
    """
    dx, dy = chord * math.cos(yaw + 0.5 * turn), chord * math.sin(yaw + 0.5 * turn)
    cosine, sine = math.cos(turn), math.sin(turn)
    rows, cols = costs.shape
    total = 0.0
    for _ in range(steps):
        to_x, to_y = x + dx, y + dy
        row, col = math.floor(y), math.floor(x)
        within = 0 <= row < rows and 0 <= col < cols
        if within and row == math.floor(to_y) and col == math.floor(to_x):
            total += abs(chord) * costs[row, col]
        else:
            total += leg_cost(costs, x, y, to_x, to_y)
        x, y = to_x, to_y
        dx, dy = cosine * dx - sine * dy, sine * dx + cosine * dy
    return total


@njit(cache=True, nogil=True)
def curve_length(
    forward: bool,
    numbers: Floats,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
) -> float:
    """Return the length of the shortest curve from a to b, along its arcs [m].

    Parameters
    ----------
    forward : bool
        Whether the curve is a Dubins curve; else a Reeds-Shepp curve.
    numbers : ndarray, shape (8,)
        As in `Body`.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        First and last pose.
    """
    if not forward and comes_later(ax, ay, a, bx, by, b):
        ax, ay, a, bx, by, b = bx, by, b, ax, ay, a
    arcs, turns = np.zeros(SEGMENTS), np.zeros(SEGMENTS, dtype=np.int64)
    length = curve_word(forward, numbers, ax, ay, a, bx, by, b, arcs, turns)
    return float(numbers[SIZE] * numbers[TURNING] * length)
