"""What the edges between sampled states cost: their length, the cells they cross, and their time.

Places come in metres from the map's outer corner, as the sampler holds them. A straight line is cut
at the borders of the cells, so what its cells cost is exact. A curve is cut into the chords between
the poses of the route, and the cells count that the chords cross.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Floats
from planners.geometry.kernels.curves import SEGMENTS, along, wrap
from planners.geometry.kernels.swept_footprint import Shape, cuts
from planners.route.kernels.shortcut import leg_cost
from planners.sampling.kernels.edges import (
    ARM,
    BULGE,
    INSCRIBED,
    RADIUS,
    SIZE,
    SPIKE,
    TOUCH,
    TURNING,
    comes_later,
    curve_motions,
    curve_word,
)

# What `prices` holds: of a cell's side, of a cell's side per unit of its cost, of the time in which
# a cell's side is driven at full speed, and of that in which a radian is turned.
LENGTH, COST, DRIVE, TURN = range(4)


@njit(cache=True, nogil=True)
def line_cost(
    costs: Bytes, numbers: Floats, prices: Floats, ax: float, ay: float, bx: float, by: float
) -> float:
    """Return what the straight line from a to b costs.

    Parameters
    ----------
    costs : ndarray of uint8, shape (rows, cols)
        Of cells, 252 at most.
    numbers : ndarray, shape (8,)
        As in `Body`.
    prices : ndarray, shape (4,)
    ax, ay, bx, by : float [m]
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
    """Return what it costs to move straight from a to b, and to turn meanwhile.

    Driving and turning end at once: the slower of the two tells how long that takes.

    Parameters
    ----------
    costs, numbers, prices
        As for `line_cost`.
    ax, ay, a, bx, by, b : float [m, rad]
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
    """Return what the shortest curve from a to b costs.

    Parameters
    ----------
    forward : bool
        Dubins' curve; otherwise that of Reeds and Shepp, which costs the same both ways.
    costs, numbers, prices
        As for `line_cost`.
    ax, ay, a, bx, by, b : float [m, rad]
    """
    if not forward and comes_later(ax, ay, a, bx, by, b):
        ax, ay, a, bx, by, b = bx, by, b, ax, ay, a
    curvatures, lengths = curve_motions(forward, numbers, ax, ay, a, bx, by, b)
    shape = _shape(numbers)
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
    """Return the length of chords that each turn by so much, times the cost of their cells."""
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
    """Return the length of the shortest curve from a to b, along its arcs [m]."""
    if not forward and comes_later(ax, ay, a, bx, by, b):
        ax, ay, a, bx, by, b = bx, by, b, ax, ay, a
    arcs, turns = np.zeros(SEGMENTS), np.zeros(SEGMENTS, dtype=np.int64)
    length = curve_word(forward, numbers, ax, ay, a, bx, by, b, arcs, turns)
    return float(numbers[SIZE] * numbers[TURNING] * length)


@njit(cache=True, nogil=True)
def _shape(numbers: Floats) -> Shape:
    """Return what of a footprint decides how finely a curve is cut."""
    return Shape(
        np.empty((0, 2)),
        np.empty(0, dtype=np.int64),
        np.empty((0, 3)),
        numbers[RADIUS],
        numbers[ARM],
        numbers[SPIKE],
        numbers[INSCRIBED],
        numbers[BULGE],
        numbers[TOUCH],
    )
