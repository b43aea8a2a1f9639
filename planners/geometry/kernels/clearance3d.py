"""Exact distance from straight lines to the nearest blocked voxel's cube.

Positions are (x, y, z) in voxels: x grows with the column, y with the row, z with the layer, and
voxel [layer, row, col] is the closed cube from (col, row, layer) to (col + 1, row + 1, layer + 1).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints

HALVINGS = 60  # of a piece: beyond the resolution of floats


@njit(cache=True, nogil=True)
def cube_distance(a: Floats, b: Floats, x: int, y: int, z: int) -> float:
    """Return the distance from the segment a-b to the cube of voxel [z, y, x].

    The squared distance is convex along the segment: its minimum is where its slope, twice
    `_slope`, changes sign.

    Parameters
    ----------
    a, b : ndarray, shape (3,) [voxels]
        Ends of the segment.
    x, y, z : int
        The voxel.
    """
    low, high = 0.0, 1.0
    if _slope(a, b, x, y, z, low) >= 0.0:
        high = low
    elif _slope(a, b, x, y, z, high) <= 0.0:
        low = high
    else:
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            if _slope(a, b, x, y, z, middle) < 0.0:
                low = middle
            else:
                high = middle
    squared = 0.0
    for axis, corner in enumerate((x, y, z)):
        gap = _gap(a[axis] + high * (b[axis] - a[axis]), corner)
        squared += gap * gap
    return math.sqrt(squared)


@njit(cache=True, nogil=True)
def segment_clearance(blocked: Bools, a: Floats, b: Floats, limit: float) -> float:
    """Return the distance from the segment a-b to the nearest blocked cube, at most `limit`.

    Shells of voxels around the segment's box are searched outwards. A voxel in shell k is k - 1
    whole voxels away from the box, so the search ends once that is not less than the best distance.

    Parameters
    ----------
    blocked : ndarray of bool, shape (layers, rows, cols)
    a, b : ndarray, shape (3,) [voxels]
        Ends of the segment.
    limit : float [voxels]
        Largest distance to search.
    """
    layers, rows, cols = blocked.shape
    left, right = math.floor(min(a[0], b[0])), math.floor(max(a[0], b[0]))
    low, high = math.floor(min(a[1], b[1])), math.floor(max(a[1], b[1]))
    down, up = math.floor(min(a[2], b[2])), math.floor(max(a[2], b[2]))
    farthest = max(right, cols - left, high, rows - low, up, layers - down)
    best = limit
    for shell in range(farthest + 1):
        if shell - 1 >= best:
            break
        for z in range(max(down - shell, 0), min(up + shell + 1, layers)):
            for y in range(max(low - shell, 0), min(high + shell + 1, rows)):
                outer = z in (down - shell, up + shell) or y in (low - shell, high + shell)
                step = 1 if shell == 0 or outer else right - left + 2 * shell
                for x in range(left - shell, right + shell + 1, step):
                    if 0 <= x < cols and blocked[z, y, x]:
                        best = min(best, cube_distance(a, b, x, y, z))
    return best


@njit(cache=True, nogil=True)
def line_clearance(blocked: Bools, points: Floats, limit: float = math.inf) -> float:
    """Return the distance from a polyline to the nearest blocked cube; inf if none is blocked.

    Parameters
    ----------
    blocked : ndarray of bool, shape (layers, rows, cols)
    points : ndarray, shape (n, 3) [voxels]
    limit : float, default inf [voxels]
        Largest distance to search.

    Notes
    -----
    Segments are cut into pieces of at most a voxel, whose boxes are small, and each piece is
    searched only up to the best distance of the pieces before it.
    """
    best = segment_clearance(blocked, points[0], points[0], limit)
    if math.isinf(best):  # the whole map was searched
        return best
    for i in range(len(points) - 1):
        step = points[i + 1] - points[i]
        pieces = max(1, math.ceil(np.abs(step).max()))
        for j in range(pieces):
            a, b = points[i] + j / pieces * step, points[i] + (j + 1) / pieces * step
            best = segment_clearance(blocked, a, b, best)
    return best


@njit(cache=True, nogil=True)
def _gap(position: float, corner: int) -> float:
    """Return how far a coordinate lies outside the interval of a cube: negative below it."""
    if position < corner:
        return position - corner
    return max(position - corner - 1.0, 0.0)


@njit(cache=True, nogil=True)
def _slope(a: Floats, b: Floats, x: int, y: int, z: int, t: float) -> float:
    slope = 0.0
    for axis, corner in enumerate((x, y, z)):
        step = b[axis] - a[axis]
        slope += step * _gap(a[axis] + t * step, corner)
    return slope


@njit(cache=True, nogil=True)
def squared_along(blocked: Bools, cells: Ints, nowhere: int) -> Ints:
    """Return the squared distances of the centres of voxels to the nearest blocked cube.

    Consecutive voxels should be near each other, as along a line: distances then differ by no more
    than the voxels are apart, and only cubes in between are looked at.

    Parameters
    ----------
    blocked : ndarray of bool, shape (layers, rows, cols)
    cells : ndarray of int64, shape (n, 3)
        Layer, row and column.
    nowhere : int
        Result where no cube is blocked.

    Returns
    -------
    ndarray of int64, shape (n,) [(half voxels)²]
    """
    squared = np.full(len(cells), nowhere, dtype=np.int64)
    for i in range(len(cells)):
        if i == 0:
            centre = np.array([cells[0, 2] + 0.5, cells[0, 1] + 0.5, cells[0, 0] + 0.5])
            least = segment_clearance(blocked, centre, centre, math.inf)
            if math.isinf(least):
                break
            squared[0] = round(4.0 * least * least)
            continue
        z, y, x = cells[i] - cells[i - 1]
        step = 2.0 * math.sqrt(x * x + y * y + z * z)
        before = math.sqrt(squared[i - 1])
        low, high = max(before - step - 1.0, 0.0), before + step + 1.0
        squared[i] = _nearest_between(blocked, cells[i], low, high)
    return squared


@njit(cache=True, nogil=True)
def _nearest_between(blocked: Bools, cell: Ints, low: float, high: float) -> int:
    """Return the squared distance of a voxel's centre to the nearest cube [(half voxels)²].

    The distance must be between `low` and `high`.
    """
    layers, rows, cols = blocked.shape
    least, best = int(low * low), int(high * high) + 1
    reach = int(high) // 2 + 2
    for z in range(max(cell[0] - reach, 0), min(cell[0] + reach + 1, layers)):
        off_z = max(2 * abs(z - cell[0]) - 1, 0) ** 2
        for y in range(max(cell[1] - reach, 0), min(cell[1] + reach + 1, rows)):
            beside = off_z + max(2 * abs(y - cell[1]) - 1, 0) ** 2
            if beside >= best:
                continue
            first = int(math.sqrt(max(least - beside, 0))) // 2
            last = int(math.sqrt(best - beside)) // 2 + 1
            for away in range(first, last + 1):
                total = beside + max(2 * away - 1, 0) ** 2
                if total >= best:
                    break
                for x in (cell[2] - away, cell[2] + away):
                    if 0 <= x < cols and blocked[z, y, x]:
                        best = total
                        break
    return best
