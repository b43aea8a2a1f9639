"""The motions of hybrid A*, their costs, and estimates of the remaining cost; all in cells.

Motions are numbered: to the right, straight and to the left, then the same backward.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Floats, Ints
from planners.geometry.kernels.curves import SEGMENTS, along, dubins_word, reeds_shepp_word, wrap

TURNS = 3  # motions of one gear
ROOT = -1  # no motion: the start
DETOUR = 7.3  # [radii] largest excess of a curve, even forward only, over the straight distance


class Drive(NamedTuple):
    """The robot's motions and penalties [cells]."""

    step: float  #: length of a straight motion
    arc: float  #: length of a turning motion: at most half a circle
    curvature: float  #: curvature at the steering's stop
    gears: int  #: 1: forward only; 2: forward and backward
    reverse: float  #: factor on lengths that are driven backward
    cusp: float  #: cost of a change of gear
    steer: float  #: cost of turning the steering from stop to stop
    bins: int  #: number of heading bins
    ratio: float  #: expansions between two curves to the goal: the remaining steps divided by this
    weight: float  #: factor on the estimate of the remaining cost


class Prices(NamedTuple):
    """Costs of cells, and the factors on lengths that they stand for."""

    costs: Bytes  #: shape (rows, cols)
    factors: Floats  #: shape (256,), by cost; shape (1,) if all are 1


@njit(cache=True, nogil=True)
def steering(motion: int) -> tuple[int, int]:
    """Return a motion's gear, 1 or -1, and its turn: 1 to the left, 0 straight, -1 to the right."""
    return 1 if motion < TURNS else -1, motion % TURNS - 1


@njit(cache=True, nogil=True)
def reach(drive: Drive, turn: int) -> float:
    """Return the length of a motion [cells].

    Parameters
    ----------
    drive : Drive
    turn : int
        1 to the left, 0 straight, -1 to the right.
    """
    return drive.step if turn == 0 else drive.arc


@njit(cache=True, nogil=True)
def pieces(drive: Drive, length: float) -> int:
    """Return the number of motions into which a segment of a curve is cut.

    Parameters
    ----------
    drive : Drive
    length : float [cells]
    """
    return max(1, math.ceil(abs(length) / drive.step))


@njit(cache=True, nogil=True)
def curve_of(
    drive: Drive, goal: Floats, x: float, y: float, yaw: float, lengths: Floats, turns: Ints
) -> float:
    """Return the cost of the cheapest curve to the goal, without regard to obstacles.

    Parameters
    ----------
    drive : Drive
    goal : ndarray, shape (3,) [cells; rad]
    x, y, yaw : float [cells; rad]
    lengths : ndarray, shape (5,) [radii]
    turns : ndarray of int64, shape (5,)
        Both are overwritten with the curve's segments.
    """
    dx, dy = (goal[0] - x) * drive.curvature, (goal[1] - y) * drive.curvature
    cosine, sine = math.cos(yaw), math.sin(yaw)
    u, v, turn = cosine * dx + sine * dy, cosine * dy - sine * dx, wrap(goal[2] - yaw)
    if drive.gears == 1:
        return dubins_word(u, v, turn, lengths, turns) / drive.curvature
    cusp = drive.cusp * drive.curvature
    return reeds_shepp_word(u, v, turn, drive.reverse, cusp, lengths, turns) / drive.curvature


@njit(cache=True, nogil=True)
def guess_of(drive: Drive, goal: Floats, x: float, y: float, yaw: float, far: float) -> float:
    """Return an estimate of the remaining cost, from the distance field and the steering.

    Parameters
    ----------
    drive : Drive
    goal : ndarray, shape (3,) [cells; rad]
    x, y, yaw : float [cells; rad]
    far : float [cells]
        Length of the shortest path around obstacles.

    Returns
    -------
    float
        The larger one of `far` and the cost of the cheapest curve without regard to obstacles.
    """
    if far >= math.hypot(goal[0] - x, goal[1] - y) + DETOUR / drive.curvature:
        return far
    lengths, turns = np.empty(SEGMENTS), np.empty(SEGMENTS, dtype=np.int64)
    return max(far, curve_of(drive, goal, x, y, yaw, lengths, turns))


@njit(cache=True, nogil=True)
def change_of(drive: Drive, motion: int, gear: int, turn: int) -> float:
    """Return the cost of a change of gear and steering after a motion.

    Parameters
    ----------
    drive : Drive
    motion : int
        The previous motion, or `ROOT`.
    gear, turn : int
        Those of the next motion.
    """
    if motion == ROOT:
        return 0.0
    gear_before, turn_before = steering(motion)
    cost = 0.5 * drive.steer * abs(turn - turn_before)
    return cost + drive.cusp if gear != gear_before else cost


@njit(cache=True, nogil=True)
def price_of(
    costs: Bytes,
    factors: Floats,
    reverse: float,
    x: float,
    y: float,
    yaw: float,
    curvature: float,
    length: float,
) -> float:
    """Return the cost of a motion, with the mean factor of the cells half-way and at its end.

    Parameters
    ----------
    costs : ndarray of uint8, shape (rows, cols)
    factors : ndarray, shape (256,) or (1,)
    reverse : float
    x, y, yaw : float [cells; rad]
        Pose at the beginning.
    curvature : float [1/cells]
    length : float [cells]
        Negative for a motion backward.
    """
    cost = length if length > 0.0 else -reverse * length
    if len(factors) == 1:
        return cost
    rows, cols = costs.shape
    total = 0.0
    for part in (0.5, 1.0):
        to_x, to_y, _ = along(x, y, yaw, curvature, part * length)
        row = min(max(math.floor(to_y), 0), rows - 1)
        col = min(max(math.floor(to_x), 0), cols - 1)
        total += 0.5 * factors[costs[row, col]]
    return cost * total
