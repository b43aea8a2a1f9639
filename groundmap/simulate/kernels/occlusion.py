"""Occlusion by prisms: lines of sight against footprints with heights.

A footprint is a set of edges, including those of its holes: a point is inside if a line to it has
crossed an odd number of them. An edge includes its lower end but not its upper, so that a line
through a corner counts it once.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints

TINY = 1e-12  # of a line of sight: a touched corner hides nothing


@njit(cache=True, nogil=True)
def find_hidden(
    eye: Floats, targets: Floats, edges: Floats, starts: Ints, heights: Floats, out: Bools
) -> None:
    """Set which targets have a prism between them and the eye.

    Parameters
    ----------
    eye : ndarray, shape (3,) [m, map]
    targets : ndarray, shape (n, 3) [m, map]
    edges : ndarray, shape (e, 4) [m, map]
        x0, y0, x1, y1 of the edges of all footprints, one footprint after the other.
    starts : ndarray, shape (p + 1,)
        Index of the first edge of each footprint; the last is e.
    heights : ndarray, shape (p, 4)
        Of each prism the bottom, the height of the top at x = y = 0, and its rise along x and y.
    out : ndarray of bool, shape (n,)
        Set to whether each target is hidden.
    """
    prisms = len(starts) - 1
    most = 0
    boxes = np.empty((prisms, 4))
    for p in range(prisms):
        most = max(most, starts[p + 1] - starts[p])
        boxes[p] = _box_of(edges[starts[p] : starts[p + 1]])
    crossings = np.empty(most)
    for i in range(len(targets)):
        target = targets[i]
        out[i] = False
        for p in range(prisms):
            if _beside(eye, target, boxes[p]):
                continue
            first, last = _between(eye, target, heights[p])
            if last - first <= TINY:
                continue
            count = _cross(eye, target, edges[starts[p] : starts[p + 1]], crossings)
            if _overlaps(crossings, count, first, last):
                out[i] = True
                break


@njit(cache=True, nogil=True)
def first_hits(eye: Floats, bearings: Floats, edges: Floats, ranges: Floats, which: Ints) -> None:
    """Set the range and the index of the nearest edge at each bearing.

    Parameters
    ----------
    eye : ndarray, shape (2,) [m, map]
    bearings : ndarray, shape (n,) [rad, map]
    edges : ndarray, shape (e, 4) [m, map]
        x0, y0, x1, y1.
    ranges : ndarray, shape (n,) [m]
        Set; infinite if no edge is hit.
    which : ndarray of int64, shape (n,)
        Set; -1 if no edge is hit.
    """
    for i in range(len(bearings)):
        cos, sin = np.cos(bearings[i]), np.sin(bearings[i])
        ranges[i], which[i] = np.inf, -1
        for e in range(len(edges)):
            x0, y0 = edges[e, 0] - eye[0], edges[e, 1] - eye[1]
            x1, y1 = edges[e, 2] - eye[0], edges[e, 3] - eye[1]
            side0, side1 = cos * y0 - sin * x0, cos * y1 - sin * x1
            if (side0 >= 0) == (side1 >= 0):
                continue
            share = side0 / (side0 - side1)
            ahead = cos * (x0 + share * (x1 - x0)) + sin * (y0 + share * (y1 - y0))
            if 0 < ahead < ranges[i]:
                ranges[i], which[i] = ahead, e


@njit(cache=True, nogil=True)
def _box_of(edges: Floats) -> Floats:
    box = np.array([np.inf, np.inf, -np.inf, -np.inf])
    for e in range(len(edges)):
        for end in range(2):
            x, y = edges[e, 2 * end], edges[e, 2 * end + 1]
            box[0], box[1] = min(box[0], x), min(box[1], y)
            box[2], box[3] = max(box[2], x), max(box[3], y)
    return box


@njit(cache=True, nogil=True)
def _beside(eye: Floats, target: Floats, box: Floats) -> bool:
    """Return whether the box around a line of sight misses another box."""
    for axis in range(2):
        if max(eye[axis], target[axis]) < box[axis]:
            return True
        if min(eye[axis], target[axis]) > box[axis + 2]:
            return True
    return False


@njit(cache=True, nogil=True)
def _between(eye: Floats, target: Floats, heights: Floats) -> tuple[float, float]:
    """Return the interval, in 0 to 1, in which a line of sight is between bottom and top."""
    bottom, top = heights[0], heights[1]
    if heights[2] != 0.0 or heights[3] != 0.0:
        from_top = eye[2] - top - heights[2] * eye[0] - heights[3] * eye[1]
        to_top = target[2] - top - heights[2] * target[0] - heights[3] * target[1]
        first, last = _within(from_top, to_top, -np.inf, 0.0)
        above, below = _within(eye[2], target[2], bottom, np.inf)
        return max(first, above), min(last, below)
    return _within(eye[2], target[2], bottom, top)


@njit(cache=True, nogil=True)
def _within(start: float, end: float, bottom: float, top: float) -> tuple[float, float]:
    """Return the interval, in 0 to 1, in which a line is between two heights."""
    if start == end:
        if bottom < start < top:
            return 0.0, 1.0
        return 1.0, 0.0
    a, b = (bottom - start) / (end - start), (top - start) / (end - start)
    return max(min(a, b), 0.0), min(max(a, b), 1.0)


@njit(cache=True, nogil=True)
def _cross(eye: Floats, target: Floats, edges: Floats, crossings: Floats) -> int:
    """Collect the sorted crossings of a line through eye and target with edges; return their count.

    Crossings between eye and target are 0 to 1. The unbounded line has an even number of crossings.
    """
    dx, dy = target[0] - eye[0], target[1] - eye[1]
    count = 0
    for e in range(len(edges)):
        x0, y0 = edges[e, 0] - eye[0], edges[e, 1] - eye[1]
        x1, y1 = edges[e, 2] - eye[0], edges[e, 3] - eye[1]
        side0, side1 = dx * y0 - dy * x0, dx * y1 - dy * x1
        if (side0 >= 0) == (side1 >= 0):
            continue
        share = side0 / (side0 - side1)
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        at = (x * dx + y * dy) / (dx * dx + dy * dy)
        place = count
        while place > 0 and crossings[place - 1] > at:
            crossings[place] = crossings[place - 1]
            place -= 1
        crossings[place] = at
        count += 1
    return count


@njit(cache=True, nogil=True)
def _overlaps(crossings: Floats, count: int, first: float, last: float) -> bool:
    """Return whether an interval inside the footprint overlaps the interval first..last."""
    for k in range(0, count - 1, 2):
        if min(crossings[k + 1], last) - max(crossings[k], first) > TINY:
            return True
    return False
