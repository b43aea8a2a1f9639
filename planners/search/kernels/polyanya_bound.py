"""The ends of an interval, and the least length of a line through it to a target."""

from __future__ import annotations

import math

from groundmap.arrays import Floats
from planners.search.kernels.polyanya_jit import borrowing


@borrowing
def cross(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the cross product of two vectors, which is positive if b lies to the left of a.

    Parameters
    ----------
    ax, ay, bx, by : float
    """
    return ax * by - ay * bx


@borrowing
def intersect(
    rx: float, ry: float, dx: float, dy: float, ax: float, ay: float, bx: float, by: float
) -> tuple[float, float]:
    """Return the intersection of the ray from r along d with the line a-b, clamped to a-b.

    Parameters
    ----------
    rx, ry, dx, dy, ax, ay, bx, by : float
    """
    share = cross(rx - ax, ry - ay, dx, dy) / cross(bx - ax, by - ay, dx, dy)
    share = min(max(share, 0.0), 1.0)
    return ax + share * (bx - ax), ay + share * (by - ay)


@borrowing
def through(
    rx: float,
    ry: float,
    cone: Floats,
    ax: float,
    ay: float,
    bx: float,
    by: float,
    targets: Floats,
) -> float:
    """Return the least length [cells] from a root through an interval to the end of a route.

    Parameters
    ----------
    rx, ry : float
        The root. The interval is the part of the side a-b, with b to the left of a, that is
        visible from the root between two rays.
    cone : ndarray, shape (4,)
        Directions of the left and of the right ray; (0, 0) if the root is at that end.
    ax, ay, bx, by : float
    targets : ndarray, shape (n, 3)
        x, y and final cost. A target on the root's side of the interval is mirrored at it.
    """
    at_end = (cone[0] == 0.0 and cone[1] == 0.0) or (cone[2] == 0.0 and cone[3] == 0.0)
    left_x, left_y, right_x, right_y = bx, by, ax, ay
    if not at_end:
        if cross(cone[0], cone[1], bx - rx, by - ry) > 0.0:
            left_x, left_y = intersect(rx, ry, cone[0], cone[1], ax, ay, bx, by)
        if cross(cone[2], cone[3], ax - rx, ay - ry) < 0.0:
            right_x, right_y = intersect(rx, ry, cone[2], cone[3], ax, ay, bx, by)
    least = math.inf
    for k in range(len(targets)):
        x, y, final = targets[k, 0], targets[k, 1], targets[k, 2]
        height = cross(bx - ax, by - ay, x - ax, y - ay)
        if height > 0.0:
            factor = 2.0 * height / ((bx - ax) ** 2 + (by - ay) ** 2)
            x, y = x + factor * (by - ay), y - factor * (bx - ax)
        if at_end:
            length = away(rx, ry, x, y)
        elif cross(left_x - rx, left_y - ry, x - rx, y - ry) > 0.0:
            length = away(rx, ry, left_x, left_y) + away(left_x, left_y, x, y)
        elif cross(right_x - rx, right_y - ry, x - rx, y - ry) < 0.0:
            length = away(rx, ry, right_x, right_y) + away(right_x, right_y, x, y)
        else:
            length = away(rx, ry, x, y)
        least = min(least, length + final)
    return least


@borrowing
def away(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance between two points.

    Parameters
    ----------
    ax, ay, bx, by : float
    """
    return math.sqrt((ax - bx) * (ax - bx) + (ay - by) * (ay - by))
