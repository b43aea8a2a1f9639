"""Checks of whole edges between sampled states on a 2-D map.

Positions are in metres from the map's outer corner, as in OMPL's states, and converted to cells
here. No check depends on a sampling step: straight lines of a disc are checked exactly, all other
motions are cut into steps whose hulls contain the swept area.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints
from planners.geometry.kernels.curves import SEGMENTS, along, dubins_word, reeds_shepp_word, wrap
from planners.geometry.kernels.swept_footprint import (
    Ground,
    Shape,
    motion_clear,
    nearness,
    step_clear,
    within,
)
from planners.sampling.kernels.lines import line_clear

PIECE = 4.0  # [cells] longest motion that a curve is cut into
# Positions in `Body.numbers`.
SIZE, TURNING, RADIUS, ARM, SPIKE, INSCRIBED, BULGE, TOUCH = range(8)


class Body(NamedTuple):
    """Map and footprint as plain arrays, which each call from Python unpacks anew."""

    blocked: Bools  #: shape (rows, cols)
    before: Ints  #: as in `Ground`
    clearance: Floats  #: as in `Ground` [cells]
    corners: Floats  #: as in `Shape` [cells]
    begins: Ints  #: as in `Shape`
    discs: Floats  #: as in `Shape` [cells]
    numbers: Floats  #: shape (8,); a cell's side [m], the turning radius and `Shape`'s [cells]


@njit(cache=True, nogil=True)
def slide_clear(
    blocked: Bools,
    before: Ints,
    clearance: Floats,
    corners: Floats,
    begins: Ints,
    discs: Floats,
    numbers: Floats,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
) -> bool:
    """Whether a footprint that moves straight from a to b while it turns overlaps nothing blocked.

    Position and yaw are interpolated linearly, the yaw over the shorter turn. A step is checked by
    the hull of its two poses, grown by an upper bound of what the turn adds; steps are skipped
    where the distance field guarantees clearance for the discs that cover the footprint.

    Parameters
    ----------
    blocked, before, clearance, corners, begins, discs, numbers : ndarray
        As in `Body`.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        First and last pose.
    """
    ground, shape = Ground(blocked, before, clearance), to_shape(corners, begins, discs, numbers)
    size, inscribed = numbers[SIZE], shape.inscribed
    if len(corners) == 0:  # a disc
        return line_clear(blocked, clearance, size, shape.radius, shape.touch, ax, ay, bx, by)
    # Most blocked edges cross a wall, which the check of the inscribed disc detects sooner.
    if inscribed > shape.touch and not line_clear(
        blocked, clearance, size, inscribed, shape.touch, ax, ay, bx, by
    ):
        return False
    ax, ay, bx, by = ax / size, ay / size, bx / size, by / size
    if not (within(clearance, ax, ay, 0.0) and within(clearance, bx, by, 0.0)):
        return False
    dx, dy, turn = bx - ax, by - ay, wrap(b - a)
    steps = slide_steps(shape, math.hypot(dx, dy), turn)
    grow = _bulge(shape, turn / steps)
    reach = (math.hypot(dx, dy) + abs(turn) * shape.arm) / steps  # of any point, in a step
    i = 0
    while i < steps:
        s, t = i / steps, (i + 1) / steps
        x, y, yaw = ax + s * dx, ay + s * dy, a + s * turn
        margin = _margin(clearance, discs, x, y, yaw) - grow
        if margin >= reach * (steps - i):
            return True
        if margin >= reach:
            i += math.floor(margin / reach)
            continue
        if nearness(clearance, x, y)[1] < shape.inscribed - shape.touch:
            return False
        to_x, to_y, to_yaw = ax + t * dx, ay + t * dy, a + t * turn
        if not step_clear(ground, shape, x, y, yaw, to_x, to_y, to_yaw, grow):
            return False
        i += 1
    return True


@njit(cache=True, nogil=True)
def slide_steps(shape: Shape, length: float, turn: float) -> int:
    """Return the number of steps of a straight motion, each at most half a cell long.

    No point of the footprint deviates from the chord of a step by more than `Shape.bulge`.

    Parameters
    ----------
    shape : Shape
    length : float [cells]
    turn : float [rad]
    """
    steps = math.ceil(2.0 * length)
    if turn != 0.0 and shape.arm > 0.0:
        max_turn = math.sqrt(8.0 * shape.bulge / (shape.spike * shape.arm))
        steps = max(steps, math.ceil(abs(turn) / max_turn))
    return max(steps, 1)


@njit(cache=True, nogil=True)
def curve_clear(
    forward: bool,
    blocked: Bools,
    before: Ints,
    clearance: Floats,
    corners: Floats,
    begins: Ints,
    discs: Floats,
    numbers: Floats,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
) -> bool:
    """Whether a footprint overlaps nothing blocked along the shortest curve from a to b.

    A Reeds-Shepp curve is the same in both directions, even if several are equally short.

    Parameters
    ----------
    forward : bool
        Whether the curve is a Dubins curve; else a Reeds-Shepp curve.
    blocked, before, clearance, corners, begins, discs, numbers : ndarray
        As in `Body`.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        First and last pose.
    """
    ground, shape = Ground(blocked, before, clearance), to_shape(corners, begins, discs, numbers)
    if not forward and comes_later(ax, ay, a, bx, by, b):
        ax, ay, a, bx, by, b = bx, by, b, ax, ay, a
    size = numbers[SIZE]
    x, y, yaw = ax / size, ay / size, a
    if not (within(clearance, x, y, 0.0) and _may_fit(ground, shape, bx / size, by / size)):
        return False
    curvatures, lengths = curve_motions(forward, numbers, ax, ay, a, bx, by, b)
    if len(lengths) == 0:
        return step_clear(ground, shape, x, y, yaw, x, y, yaw, 0.0)
    if not _may_pass(ground, shape, x, y, yaw, curvatures, lengths):
        return False
    for i in range(len(lengths)):
        if not motion_clear(ground, shape, x, y, yaw, curvatures[i], lengths[i]):
            return False
        x, y, yaw = along(x, y, yaw, curvatures[i], lengths[i])
    return True


@njit(cache=True, nogil=True)
def _may_pass(
    ground: Ground,
    shape: Shape,
    x: float,
    y: float,
    yaw: float,
    curvatures: Floats,
    lengths: Floats,
) -> bool:
    """Whether the footprint may fit at some places along a curve: a cheap necessary condition."""
    for i in range(len(lengths)):
        at, length = 0.0, abs(lengths[i])
        while at < length:
            at_x, at_y, _ = along(x, y, yaw, curvatures[i], math.copysign(at, lengths[i]))
            if not _may_fit(ground, shape, at_x, at_y):
                return False
            margin = nearness(ground.clearance, at_x, at_y)[0] - shape.inscribed
            at += max(margin, 1.0)
        x, y, yaw = along(x, y, yaw, curvatures[i], lengths[i])
    return True


@njit(cache=True, nogil=True)
def _may_fit(ground: Ground, shape: Shape, x: float, y: float) -> bool:
    """Whether the inscribed disc of the footprint may be clear with base_link at a place."""
    if not within(ground.clearance, x, y, 0.0):
        return False
    if nearness(ground.clearance, x, y)[1] < shape.inscribed - shape.touch:
        return False
    has_inside = shape.inscribed > shape.touch or len(shape.corners) == 0
    return not (has_inside and ground.blocked[int(y), int(x)])


@njit(cache=True, nogil=True)
def comes_later(ax: float, ay: float, a: float, bx: float, by: float, b: float) -> bool:
    """Whether an edge that is the same in both directions is computed from b to a.

    Parameters
    ----------
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        Its ends.
    """
    if ax != bx:
        return ax > bx
    return ay > by if ay != by else a > b


@njit(cache=True, nogil=True)
def curve_motions(
    forward: bool,
    numbers: Floats,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
) -> tuple[Floats, Floats]:
    """Return the shortest curve from a to b as motions.

    Parameters
    ----------
    forward : bool
        Whether the curve is a Dubins curve; else a Reeds-Shepp curve.
    numbers : ndarray, shape (8,)
        As in `Body`.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        First and last pose.

    Returns
    -------
    curvatures : ndarray, shape (n,) [1 / cells]
    lengths : ndarray, shape (n,) [cells]
    """
    radius = numbers[TURNING]
    arcs, turns = np.zeros(SEGMENTS), np.zeros(SEGMENTS, dtype=np.int64)
    curve_word(forward, numbers, ax, ay, a, bx, by, b, arcs, turns)
    counts = np.zeros(SEGMENTS, dtype=np.int64)
    for k in range(SEGMENTS):
        counts[k] = math.ceil(abs(arcs[k]) * radius / PIECE)
    curvatures, lengths = np.empty(counts.sum()), np.empty(counts.sum())
    at = 0
    for k in range(SEGMENTS):
        for _ in range(counts[k]):
            curvatures[at] = turns[k] / radius
            lengths[at] = arcs[k] * radius / counts[k]
            at += 1
    return curvatures, lengths


@njit(cache=True, nogil=True)
def curve_word(
    forward: bool,
    numbers: Floats,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
    arcs: Floats,
    turns: Ints,
) -> float:
    """Compute the shortest curve from a to b; return its length [turning radii].

    Parameters
    ----------
    forward : bool
        Whether the curve is a Dubins curve; else a Reeds-Shepp curve.
    numbers : ndarray, shape (8,)
        As in `Body`.
    ax, ay, a, bx, by, b : float [m, m, rad, m, m, rad; corner]
        First and last pose.
    arcs, turns : ndarray, shape (5,)
        Receive the segments; unused ones have length 0.
    """
    scale = numbers[SIZE] * numbers[TURNING]
    dx, dy = (bx - ax) / scale, (by - ay) / scale
    cosine, sine = math.cos(a), math.sin(a)
    x, y, turn = cosine * dx + sine * dy, cosine * dy - sine * dx, wrap(b - a)
    if forward:
        return dubins_word(x, y, turn, arcs, turns)
    return reeds_shepp_word(x, y, turn, 1.0, 0.0, arcs, turns)


@njit(cache=True, nogil=True)
def to_shape(corners: Floats, begins: Ints, discs: Floats, numbers: Floats) -> Shape:
    """Return the footprint of a `Body`.

    Parameters
    ----------
    corners, begins, discs, numbers : ndarray
        As in `Body`.
    """
    return Shape(
        corners,
        begins,
        discs,
        numbers[RADIUS],
        numbers[ARM],
        numbers[SPIKE],
        numbers[INSCRIBED],
        numbers[BULGE],
        numbers[TOUCH],
    )


@njit(cache=True, nogil=True)
def _bulge(shape: Shape, turn: float) -> float:
    """Return an upper bound of the deviation of a point from its chord in a step with a turn.

    The acceleration of a corner towards the centre is at most `arm` times the square of the turn
    per step; growing an outline with sharp corners increases the deviation up to `spike` times.
    """
    return shape.spike * shape.arm * turn * turn / 8.0


@njit(cache=True, nogil=True)
def _margin(clearance: Floats, discs: Floats, x: float, y: float, yaw: float) -> float:
    """Return a lower bound of the distance of the covering discs to blocked squares [cells]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    margin = math.inf
    for k in range(len(discs)):
        u, v, radius = discs[k, 0], discs[k, 1], discs[k, 2]
        at_x, at_y = x + cosine * u - sine * v, y + sine * u + cosine * v
        margin = min(margin, nearness(clearance, at_x, at_y)[0] - radius)
    return margin
