"""Merging triangles into convex polygons, finding dead ends, and locating points.

Polygons are rings of sides, counter-clockwise: a side has a first corner, a next side, and a twin
that is the same segment as a side of the adjacent polygon (-1: no adjacent polygon).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints

PLAIN, CORNER, GATE, PINCH = range(4)  # kinds of vertices


@njit(cache=True, nogil=True)
def merge(points: Floats, corners: Ints, twins: Ints, order: Ints) -> tuple[Ints, Ints, Ints]:
    """Merge triangles into strictly convex polygons, greedily.

    Parameters
    ----------
    points : ndarray, shape (v, 2)
        With integer coordinates, so that turns are exact.
    corners, twins : ndarray of int64, shape (3 t,)
        First corner and twin of every side, three to a triangle.
    order : ndarray of int64, shape (n,)
        Sides to remove where the merged polygon stays convex, in that order.

    Returns
    -------
    first : ndarray of int64, shape (p + 1,)
        Where each polygon's sides begin.
    corners, twins : ndarray of int64, shape (s,)
        First corner and twin of the remaining sides.
    """
    sides = len(corners)
    following = np.empty(sides, dtype=np.int64)
    previous = np.empty(sides, dtype=np.int64)
    for side in range(sides):
        following[side] = side + 1 if side % 3 < 2 else side - 2
        previous[side] = side - 1 if side % 3 > 0 else side + 2
    gone = np.zeros(sides, dtype=np.bool_)
    for side in order:
        twin = twins[side]
        if twin < 0 or gone[side]:
            continue
        before, after = previous[side], following[side]
        twin_before, twin_after = previous[twin], following[twin]
        start, end = corners[side], corners[twin]
        if (
            turn(points, corners[before], start, corners[following[twin_after]]) > 0
            and turn(points, corners[twin_before], end, corners[following[after]]) > 0
        ):
            gone[side] = gone[twin] = True
            following[before], previous[twin_after] = twin_after, before
            following[twin_before], previous[after] = after, twin_before
    return _rings(corners, twins, following, gone)


@njit(cache=True, nogil=True)
def turn(points: Floats, a: int, b: int, c: int) -> float:
    """Return twice the signed area of the triangle a, b, c: positive if c is left of a-b.

    Parameters
    ----------
    points : ndarray, shape (v, 2)
    a, b, c : int
        Rows of `points`.
    """
    x, y = points[a, 0], points[a, 1]
    off = (points[b, 0] - x) * (points[c, 1] - y) - (points[b, 1] - y) * (points[c, 0] - x)
    return float(off)


@njit(cache=True, nogil=True)
def _rings(corners: Ints, twins: Ints, following: Ints, gone: Bools) -> tuple[Ints, Ints, Ints]:
    """Renumber the remaining sides, ring by ring."""
    number = np.full(len(corners), -1, dtype=np.int64)
    old = np.empty(len(corners), dtype=np.int64)
    firsts, count = [0], 0
    for begin in range(len(corners)):
        if gone[begin] or number[begin] >= 0:
            continue
        side = begin
        while number[side] < 0:
            number[side], old[count] = count, side
            side, count = following[side], count + 1
        firsts.append(count)
    across = np.full(count, -1, dtype=np.int64)
    for side in range(count):
        if twins[old[side]] >= 0:
            across[side] = number[twins[old[side]]]
    return np.array(firsts), corners[old[:count]], across


@njit(cache=True, nogil=True)
def exits(first: Ints, twins: Ints, owner: Ints, through: Bools) -> Ints:
    """Return the only side that leads out of each polygon in a dead end; -1 for other polygons.

    A polygon is a dead end if exactly one of its sides leads to a polygon that is not one. Routes
    only visit a dead end if they begin or end there.

    Parameters
    ----------
    first, twins : ndarray of int64, shape (p + 1,) and (s,)
    owner : ndarray of int64, shape (s,)
        Polygon of each side.
    through : ndarray of bool, shape (p,)
        Polygons with an exit other than their sides, which are never dead ends.
    """
    polygons = len(first) - 1
    found = np.full(polygons, -1, dtype=np.int64)
    for begin in range(polygons):
        polygon = begin
        while polygon >= 0 and found[polygon] < 0 and not through[polygon]:
            ways, out = 0, -1
            for side in range(first[polygon], first[polygon + 1]):
                twin = twins[side]
                if twin >= 0 and found[owner[twin]] != twin:
                    ways, out = ways + 1, side
            if ways != 1:
                break
            found[polygon] = out
            polygon = owner[twins[out]]
    return found


@njit(cache=True, nogil=True)
def open_ways(
    near: Ints, exits: Ints, twins: Ints, owner: Ints, looked_for: Bools, leads_there: Bools
) -> None:
    """Mark the polygons with targets, and the dead ends on the way to them.

    Parameters
    ----------
    near : ndarray of int64, shape (n, 2)
        In its first column the polygons with targets.
    exits, twins, owner
        The mesh.
    looked_for, leads_there : ndarray of bool, shape (p,)
        The marks.
    """
    for i in range(len(near)):
        polygon = near[i, 0]
        looked_for[polygon] = True
        while exits[polygon] >= 0 and not leads_there[polygon]:
            leads_there[polygon] = True
            polygon = owner[twins[exits[polygon]]]


@njit(cache=True, nogil=True)
def around(
    points: Floats,
    first: Ints,
    corners: Ints,
    boxes: Ints,
    nearby: Ints,
    x: float,
    y: float,
    slack: float,
) -> Ints:
    """Return the polygons that a point lies in or, up to `slack`, on the border of.

    Parameters
    ----------
    points, first, corners
        The mesh.
    boxes : ndarray of int64, shape (p, 4)
        Least x, y and largest x, y of each polygon.
    nearby : ndarray of int64, shape (n,)
        Polygons to check.
    x, y : float
    slack : float
        Tolerance: twice the area of the triangle of the point and a side that it lies beyond.
    """
    found = []
    for polygon in nearby:
        box = boxes[polygon]
        if x < box[0] or y < box[1] or x > box[2] or y > box[3]:
            continue
        inside, last = True, corners[first[polygon + 1] - 1]
        for side in range(first[polygon], first[polygon + 1]):
            corner = corners[side]
            ax, ay = points[last, 0], points[last, 1]
            bx, by = points[corner, 0], points[corner, 1]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) < -slack:
                inside = False
                break
            last = corner
        if inside:
            found.append(polygon)
    return np.array(found, dtype=np.int64)
