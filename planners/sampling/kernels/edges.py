"""Whether the edges between sampled states keep clear, each checked as a whole.

Places come in metres from the map's outer corner, as the sampler holds them, and are turned into
cells here. What is looked at does not depend on a sampling step: straight lines of a disc are
checked exactly, everything else is cut into steps whose hulls hold all that is swept.
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

PIECE = 4.0  # [cells] curves are cut into motions of that length
# What `Body.numbers` holds.
SIZE, TURNING, RADIUS, ARM, SPIKE, INSCRIBED, BULGE, TOUCH = range(8)


class Body(NamedTuple):
    """Map and footprint as plain arrays: each call from Python unpacks them anew."""

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
    """Whether a footprint overlaps nothing that moves straight from a to b and turns meanwhile.

    Place and yaw change evenly, the yaw by the shorter turn. Of each step, the hull of the two
    poses is looked at, grown by what the turn in between may add; steps over which the distance
    field vouches for the discs around the footprint are left out.

    Parameters
    ----------
    blocked, before, clearance, corners, begins, discs, numbers
        As in `Body`.
    ax, ay, a, bx, by, b : float [m, rad]
    """
    ground, shape = Ground(blocked, before, clearance), _shape(corners, begins, discs, numbers)
    size, inscribed = numbers[SIZE], shape.inscribed
    if len(corners) == 0:  # it looks the same at every yaw
        return line_clear(blocked, clearance, size, shape.radius, shape.touch, ax, ay, bx, by)
    # Most edges that aren't clear cross a wall, which the disc within the footprint finds sooner.
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
        left_out = _room(clearance, discs, x, y, yaw) - grow
        if left_out >= reach * (steps - i):
            return True
        if left_out >= reach:
            i += math.floor(left_out / reach)
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
    """Return into how many steps such a motion is cut: poses are half a cell apart at most.

    No point of the footprint then leaves the chord of a step by more than `Shape.bulge`.
    """
    steps = math.ceil(2.0 * length)
    if turn != 0.0 and shape.arm > 0.0:
        most = math.sqrt(8.0 * shape.bulge / (shape.spike * shape.arm))
        steps = max(steps, math.ceil(abs(turn) / most))
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
    """Whether a footprint overlaps nothing all along the shortest curve between a and b.

    That of Reeds and Shepp is the same both ways, whichever of equally short ones it is.

    Parameters
    ----------
    forward : bool
        Dubins' curve; otherwise that of Reeds and Shepp.
    blocked, before, clearance, corners, begins, discs, numbers
        As in `Body`.
    ax, ay, a, bx, by, b : float [m, rad]
    """
    ground, shape = Ground(blocked, before, clearance), _shape(corners, begins, discs, numbers)
    if not forward and comes_later(ax, ay, a, bx, by, b):
        ax, ay, a, bx, by, b = bx, by, b, ax, ay, a
    size = numbers[SIZE]
    x, y, yaw = ax / size, ay / size, a
    if not (within(clearance, x, y, 0.0) and _may_stand(ground, shape, bx / size, by / size)):
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
    """Whether base_link may be at some places along a curve: that rules out most, at once."""
    for i in range(len(lengths)):
        at, length = 0.0, abs(lengths[i])
        while at < length:
            driven = math.copysign(at, lengths[i])
            at_x, at_y, _ = along(x, y, yaw, curvatures[i], driven)
            if not _may_stand(ground, shape, at_x, at_y):
                return False
            room = nearness(ground.clearance, at_x, at_y)[0] - shape.inscribed
            at += max(room, 1.0)
        x, y, yaw = along(x, y, yaw, curvatures[i], lengths[i])
    return True


@njit(cache=True, nogil=True)
def _may_stand(ground: Ground, shape: Shape, x: float, y: float) -> bool:
    """Whether the largest disc about base_link within the footprint may be clear at a place."""
    if not within(ground.clearance, x, y, 0.0):
        return False
    if nearness(ground.clearance, x, y)[1] < shape.inscribed - shape.touch:
        return False
    has_inside = shape.inscribed > shape.touch or len(shape.corners) == 0
    return not (has_inside and ground.blocked[int(y), int(x)])


@njit(cache=True, nogil=True)
def comes_later(ax: float, ay: float, a: float, bx: float, by: float, b: float) -> bool:
    """Whether a is the one of two poses at which edges that are the same both ways end."""
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
    """Return the curve from a to b as motions: curvatures [1 / cells] and lengths [cells]."""
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
    """Find the curve from a to b; return its length [turning radii].

    Parameters
    ----------
    forward, numbers, ax, ay, a, bx, by, b
        As for `curve_motions`.
    arcs, turns : ndarray, shape (5,)
        Receive the segments, those not needed with length 0.
    """
    scale = numbers[SIZE] * numbers[TURNING]
    dx, dy = (bx - ax) / scale, (by - ay) / scale
    cosine, sine = math.cos(a), math.sin(a)
    x, y, turn = cosine * dx + sine * dy, cosine * dy - sine * dx, wrap(b - a)
    if forward:
        return dubins_word(x, y, turn, arcs, turns)
    return reeds_shepp_word(x, y, turn, 1.0, 0.0, arcs, turns)


@njit(cache=True, nogil=True)
def _shape(corners: Floats, begins: Ints, discs: Floats, numbers: Floats) -> Shape:
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
    """Return how far any point may leave its chord in a step that turns by so much.

    A corner is drawn to the centre by `arm` times the square of the turn per step, at most; one
    that grows an outline with sharp corners may find `spike` times that.
    """
    return shape.spike * shape.arm * turn * turn / 8.0


@njit(cache=True, nogil=True)
def _room(clearance: Floats, discs: Floats, x: float, y: float, yaw: float) -> float:
    """Return how far the discs that cover the footprint are from what is blocked, at least."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    room = math.inf
    for k in range(len(discs)):
        u, v, radius = discs[k, 0], discs[k, 1], discs[k, 2]
        at_x, at_y = x + cosine * u - sine * v, y + sine * u + cosine * v
        room = min(room, nearness(clearance, at_x, at_y)[0] - radius)
    return room
