"""The motions of hybrid A*, what they cost, and what is left to the goal at least; all in cells.

Motions are numbered: to the right, straight and to the left, and then the same backwards.
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
DETOUR = 7.3  # [radii] no curve, even forward only, needs more beyond the straight distance


class Drive(NamedTuple):
    """How the robot moves, and what that costs."""

    step: float  #: length of a straight motion
    arc: float  #: length of a turning motion: half a circle at most, as more turns the other way
    curvature: float  #: at the steering's stop
    gears: int  #: 1: forward only; 2: both ways
    reverse: float  #: what a cell's side driven backwards costs
    cusp: float  #: what a change of gear costs
    steer: float  #: what turning the steering from stop to stop costs
    bins: int  #: of headings
    ratio: float  #: a curve is tried after as many nodes as steps remain, divided by this
    weight: float  #: how much more than itself the guess of what is left counts


class Prices(NamedTuple):
    """What a length costs where, as a multiple of itself."""

    costs: Bytes  #: shape (rows, cols)
    factors: Floats  #: shape (256,) by cost; shape (1,) if every cell's is 1


@njit(cache=True, nogil=True)
def steering(motion: int) -> tuple[int, int]:
    """Return the gear of a motion, 1 or -1, and its turn: 1 to the left, 0 or -1."""
    return 1 if motion < TURNS else -1, motion % TURNS - 1


@njit(cache=True, nogil=True)
def reach(drive: Drive, turn: int) -> float:
    """Return the length of a motion with a turn."""
    return drive.step if turn == 0 else drive.arc


@njit(cache=True, nogil=True)
def pieces(drive: Drive, length: float) -> int:
    """Return into how many motions a segment of a curve is cut."""
    return max(1, math.ceil(abs(length) / drive.step))


@njit(cache=True, nogil=True)
def curve_of(
    drive: Drive, goal: Floats, x: float, y: float, yaw: float, lengths: Floats, turns: Ints
) -> float:
    """Find the cheapest curve to the goal, heedless of obstacles; return its cost."""
    dx, dy = (goal[0] - x) * drive.curvature, (goal[1] - y) * drive.curvature
    cosine, sine = math.cos(yaw), math.sin(yaw)
    u, v, turn = cosine * dx + sine * dy, cosine * dy - sine * dx, wrap(goal[2] - yaw)
    if drive.gears == 1:
        return dubins_word(u, v, turn, lengths, turns) / drive.curvature
    cusp = drive.cusp * drive.curvature
    return reeds_shepp_word(u, v, turn, drive.reverse, cusp, lengths, turns) / drive.curvature


@njit(cache=True, nogil=True)
def guess_of(drive: Drive, goal: Floats, x: float, y: float, yaw: float, far: float) -> float:
    """Return the larger of the way around obstacles and the way that the steering allows."""
    if far >= math.hypot(goal[0] - x, goal[1] - y) + DETOUR / drive.curvature:
        return far
    lengths, turns = np.empty(SEGMENTS), np.empty(SEGMENTS, dtype=np.int64)
    return max(far, curve_of(drive, goal, x, y, yaw, lengths, turns))


@njit(cache=True, nogil=True)
def change_of(drive: Drive, motion: int, gear: int, turn: int) -> float:
    """Return what it costs to go on after a motion in another gear or with another steering."""
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
    """Return what a motion costs: the cells half-way and at its end count for half of it each."""
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
