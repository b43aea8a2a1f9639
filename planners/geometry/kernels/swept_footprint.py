"""Overlap of a footprint, at a pose or along a motion, with blocked cells.

Positions are in cells: x grows with the column, and cell [row, col] is the closed square from
(col, row) to (col + 1, row + 1). Touching a square is not an overlap. Everything outside the array
is ignored.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints
from planners.geometry.kernels.clearance import segment_clearance
from planners.geometry.kernels.curves import along
from planners.geometry.kernels.hull import clip_extent, hull_clear, hull_of


class Ground(NamedTuple):
    """The map as an argument of these kernels."""

    blocked: Bools  #: shape (rows, cols)
    before: Ints  #: shape (rows, cols + 1); blocked cells of the row with a smaller column
    clearance: Floats  #: shape (rows, cols) [cells]; of cell centres


class Shape(NamedTuple):
    """A footprint as an argument of these kernels; lengths in cells."""

    corners: Floats  #: shape (n, 2); of its convex parts, counter-clockwise; empty for a disc
    begins: Ints  #: shape (parts + 1,); rows of `corners`
    discs: Floats  #: shape (k, 3); x, y, radius of discs that together cover it
    radius: float  #: of a disc; 0 for a polygon
    arm: float  #: largest distance of its points from the origin; 0 for a disc
    spike: float  #: largest distance that a corner moves out per distance the outline is grown
    inscribed: float  #: of the largest disc about the origin within it
    bulge: float  #: how far a motion may leave the hulls of the poses it is cut into
    touch: float  #: overlap that is attributed to rounding


@njit(cache=True, nogil=True)
def pose_clear(
    blocked: Bools,
    polygon: Floats,
    x: float,
    y: float,
    cosine: float,
    sine: float,
    touch: float,
) -> bool:
    """Whether a simple polygon, convex or not, overlaps no blocked square at a pose.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    polygon : ndarray, shape (n, 2) [cells, base_link]
    x, y, cosine, sine : float [cells]
        Position of base_link, and cosine and sine of its yaw.
    touch : float [cells]
        Overlap that is attributed to rounding.

    Notes
    -----
    A square that no side enters is entirely inside or outside, and so is its centre.
    """
    rows, cols = blocked.shape
    n = len(polygon)
    placed = np.empty((n + 1, 2))
    for i in range(n + 1):
        u, v = polygon[i % n]
        placed[i, 0], placed[i, 1] = x + cosine * u - sine * v, y + sine * u + cosine * v
    low = max(math.floor(placed[:, 1].min()), 0)
    high = min(math.floor(placed[:, 1].max()), rows - 1)
    crossings = np.empty(n)
    for row in range(low, high + 1):
        count, middle = 0, row + 0.5
        for i in range(n):
            ax, ay = placed[i]
            bx, by = placed[i + 1]
            left, right = clip_extent(ax, ay, bx, by, row + touch, row + 1.0 - touch)
            if left <= right:
                first, last = math.floor(left + touch), math.ceil(right - touch) - 1
                for col in range(max(first, 0), min(last, cols - 1) + 1):
                    if blocked[row, col]:
                        return False
            if (ay > middle) != (by > middle):
                crossings[count] = ax + (middle - ay) / (by - ay) * (bx - ax)
                count += 1
        crossings[:count].sort()
        for i in range(0, count - 1, 2):
            first, last = math.ceil(crossings[i] - 0.5), math.floor(crossings[i + 1] - 0.5)
            for col in range(max(first, 0), min(last, cols - 1) + 1):
                if blocked[row, col] and crossings[i] < col + 0.5 < crossings[i + 1]:
                    return False
    return True


@njit(cache=True, nogil=True)
def cuts(shape: Shape, curvature: float, length: float) -> int:
    """Return the number of steps into which a motion is cut.

    Consecutive poses are at most half a cell apart. Where the motion turns, no point of the
    footprint leaves the chord between its positions at two of them by more than `Shape.bulge`.

    Parameters
    ----------
    shape : Shape
    curvature : float [1 / cells]
    length : float [cells]
        Negative in reverse.
    """
    pieces = math.ceil(2.0 * abs(length))
    if curvature != 0.0:
        farthest = 1.0 / abs(curvature) + shape.arm  # from the centre of the turn
        turn = 2.0 * math.acos(max(1.0 - shape.bulge / farthest, 0.0))
        pieces = max(pieces, math.ceil(abs(curvature * length) / turn))
    return max(pieces, 1)


@njit(cache=True, nogil=True)
def motion_clear(
    ground: Ground,
    shape: Shape,
    x: float,
    y: float,
    yaw: float,
    curvature: float,
    length: float,
) -> bool:
    """Whether the footprint stays on the map and overlaps no blocked square along a motion.

    The motion is cut into steps. For each step, the convex hull of every convex part at its two
    poses is checked, grown by the most that the turn in between may add.

    Parameters
    ----------
    ground : Ground
    shape : Shape
    x, y, yaw : float [cells; rad]
        Pose at the beginning.
    curvature : float [1 / cells]
    length : float [cells]
        Negative in reverse.
    """
    steps = cuts(shape, curvature, length)
    turn = abs(curvature * length)
    grow = 0.0
    if turn > 0.0:
        # The largest distance of a point from its chord, or of a sharp corner of the outline once
        # the hull of the two poses is grown with mitres, which is larger on tight turns.
        farthest = max(1.0 / abs(curvature) + shape.arm, shape.spike * shape.arm)
        grow = farthest * (1.0 - math.cos(0.5 * turn / steps))
    reach = 0.5 * (abs(length) + turn * shape.arm)  # of any point, from the pose half-way
    excess = 0.5 * turn / steps * shape.arm + grow  # of the hulls over all the poses in between
    mid_x, mid_y, mid = along(x, y, yaw, curvature, 0.5 * length)
    if within(ground.clearance, mid_x, mid_y, 0.5 * abs(length)) and discs_clear(
        ground.clearance, shape.discs, mid_x, mid_y, mid, reach + excess
    ):
        return True
    if curvature == 0.0:
        steps = 1  # hulls are exact where nothing turns
    slack = reach / steps + excess
    ax, ay, a = x, y, yaw
    for i in range(1, steps + 1):
        bx, by, b = along(x, y, yaw, curvature, length * i / steps)
        if not within(ground.clearance, bx, by, 0.0):
            return False
        if nearness(ground.clearance, bx, by)[1] < shape.inscribed - shape.touch:
            return False
        between = along(x, y, yaw, curvature, length * (i - 0.5) / steps)
        if not discs_clear(ground.clearance, shape.discs, *between, slack) and not step_clear(
            ground, shape, ax, ay, a, bx, by, b, grow
        ):
            return False
        ax, ay, a = bx, by, b
    return True


@njit(cache=True, nogil=True)
def step_clear(
    ground: Ground,
    shape: Shape,
    ax: float,
    ay: float,
    a: float,
    bx: float,
    by: float,
    b: float,
    grow: float,
) -> bool:
    """Whether the hulls of the footprint at two poses overlap no blocked square.

    Parameters
    ----------
    ground : Ground
    shape : Shape
    ax, ay, a, bx, by, b : float [cells; rad]
        The two poses: position and yaw.
    grow : float [cells]
        Added to the hulls on all sides.
    """
    if len(shape.corners) == 0:
        need = max(shape.radius + grow, 2.0 * shape.touch)
        return segment_clearance(ground.blocked, ax, ay, bx, by, need) >= need - shape.touch
    cos_a, sin_a, cos_b, sin_b = math.cos(a), math.sin(a), math.cos(b), math.sin(b)
    for part in range(len(shape.begins) - 1):
        first, last = shape.begins[part], shape.begins[part + 1]
        points = np.empty((2 * (last - first), 2))
        for i in range(first, last):
            u, v = shape.corners[i]
            k = 2 * (i - first)
            points[k, 0], points[k, 1] = ax + cos_a * u - sin_a * v, ay + sin_a * u + cos_a * v
            points[k + 1, 0] = bx + cos_b * u - sin_b * v
            points[k + 1, 1] = by + sin_b * u + cos_b * v
        if not hull_clear(ground.before, hull_of(points), grow - shape.touch):
            return False
    return True


@njit(cache=True, nogil=True)
def within(clearance: Floats, x: float, y: float, margin: float) -> bool:
    """Whether a point lies on the map, at least a margin away from its border.

    Parameters
    ----------
    clearance : ndarray, shape (rows, cols) [cells]
    x, y, margin : float [cells]
    """
    rows, cols = clearance.shape
    return bool(margin <= x < cols - margin and margin <= y < rows - margin)


@njit(cache=True, nogil=True)
def nearness(clearance: Floats, x: float, y: float) -> tuple[float, float]:
    """Return lower and upper bound of the clearance at a point, from that of its cell's centre.

    Parameters
    ----------
    clearance : ndarray, shape (rows, cols) [cells]
    x, y : float [cells]
    """
    rows, cols = clearance.shape
    col, row = math.floor(x), math.floor(y)
    if row < 0 or col < 0 or row >= rows or col >= cols:
        return -math.inf, math.inf
    off = math.hypot(x - col - 0.5, y - row - 0.5)
    return clearance[row, col] - off, clearance[row, col] + off


@njit(cache=True, nogil=True)
def discs_clear(
    clearance: Floats, discs: Floats, x: float, y: float, yaw: float, slack: float
) -> bool:
    """Whether the discs that cover the footprint are certainly clear at a pose.

    Parameters
    ----------
    clearance : ndarray, shape (rows, cols) [cells]
    discs : ndarray, shape (k, 3) [cells, base_link]
        x, y and radius.
    x, y, yaw : float [cells; rad]
    slack : float [cells]
        Added to the radii.
    """
    cosine, sine = math.cos(yaw), math.sin(yaw)
    for k in range(len(discs)):
        u, v, radius = discs[k, 0], discs[k, 1], discs[k, 2]
        at_x, at_y = x + cosine * u - sine * v, y + sine * u + cosine * v
        if nearness(clearance, at_x, at_y)[0] < radius + slack:
            return False
    return True
