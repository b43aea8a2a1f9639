"""Exact distance from straight lines to the nearest blocked cell square.

Positions are in cells here: x grows with the column, and cell [row, col] is the closed square from
(col, row) to (col + 1, row + 1).
"""

from __future__ import annotations

import math

from numba import njit

from groundmap.arrays import Bools, Floats


@njit(cache=True, nogil=True)
def square_distance(ax: float, ay: float, bx: float, by: float, col: int, row: int) -> float:
    """Return the distance from the segment a-b to the square of a cell; 0 where they touch.

    Two disjoint convex polygons are nearest at a vertex of one of them.

    Parameters
    ----------
    ax, ay, bx, by : float [cells]
        Ends of the segment.
    col, row : int
        The cell.
    """
    if _meets(ax, ay, bx, by, col, row):
        return 0.0
    least = min(_point_square(ax, ay, col, row), _point_square(bx, by, col, row))
    for i in range(2):
        for j in range(2):
            least = min(least, _point_segment(col + i, row + j, ax, ay, bx, by))
    return least


@njit(cache=True, nogil=True)
def segment_clearance(
    blocked: Bools, ax: float, ay: float, bx: float, by: float, limit: float
) -> float:
    """Return the distance from the segment a-b to the nearest blocked square, at most `limit`.

    Rings of cells around the segment's box are searched outwards. A cell in ring k is k - 1 whole
    cells away from the box, so the search ends once that is not less than the best distance.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    ax, ay, bx, by : float [cells]
        Ends of the segment.
    limit : float [cells]
        Largest distance to search.
    """
    rows, cols = blocked.shape
    left, right = math.floor(min(ax, bx)), math.floor(max(ax, bx))
    low, high = math.floor(min(ay, by)), math.floor(max(ay, by))
    farthest = max(right, cols - left, high, rows - low)
    best = limit
    for ring in range(farthest + 1):
        if ring - 1 >= best:
            break
        for row in range(max(low - ring, 0), min(high + ring + 1, rows)):
            whole_row = ring == 0 or row in (low - ring, high + ring)
            step = 1 if whole_row else right - left + 2 * ring
            for col in range(left - ring, right + ring + 1, step):
                if 0 <= col < cols and blocked[row, col]:
                    best = min(best, square_distance(ax, ay, bx, by, col, row))
    return best


@njit(cache=True, nogil=True)
def line_clearance(blocked: Bools, points: Floats, limit: float = math.inf) -> float:
    """Return the distance from a polyline to the nearest blocked square; inf if none is blocked.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    points : ndarray, shape (n, 2) [cells]
    limit : float, default inf [cells]
        Largest distance to search.

    Notes
    -----
    Segments are cut into pieces of at most a cell, whose boxes are small, and each piece is
    searched only up to the best distance of the pieces before it.
    """
    best = segment_clearance(blocked, points[0, 0], points[0, 1], points[0, 0], points[0, 1], limit)
    if math.isinf(best):  # the whole map was searched
        return best
    for i in range(len(points) - 1):
        ax, ay = points[i]
        dx, dy = points[i + 1, 0] - ax, points[i + 1, 1] - ay
        pieces = max(1, math.ceil(max(abs(dx), abs(dy))))
        for j in range(pieces):
            s, t = j / pieces, (j + 1) / pieces
            best = segment_clearance(
                blocked, ax + s * dx, ay + s * dy, ax + t * dx, ay + t * dy, best
            )
    return best


@njit(cache=True, nogil=True)
def _meets(ax: float, ay: float, bx: float, by: float, col: int, row: int) -> bool:
    """Clip the segment with the square's two slabs."""
    enter, leave = 0.0, 1.0
    for a, b, low in ((ax, bx, float(col)), (ay, by, float(row))):
        d = b - a
        if d == 0.0:
            if a < low or a > low + 1.0:
                return False
        else:
            s, t = (low - a) / d, (low + 1.0 - a) / d
            enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
    return enter <= leave


@njit(cache=True, nogil=True)
def _point_square(x: float, y: float, col: int, row: int) -> float:
    dx = max(col - x, 0.0, x - col - 1.0)
    dy = max(row - y, 0.0, y - row - 1.0)
    return math.hypot(dx, dy)


@njit(cache=True, nogil=True)
def _point_segment(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    t = 0.0
    if squared > 0.0:
        t = min(max(((x - ax) * dx + (y - ay) * dy) / squared, 0.0), 1.0)
    return math.hypot(ax + t * dx - x, ay + t * dy - y)
