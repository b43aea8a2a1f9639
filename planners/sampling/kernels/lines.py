"""Exact check of a straight line for a disc."""

from __future__ import annotations

import math

from numba import njit

from groundmap.arrays import Bools, Floats
from planners.geometry.kernels.clearance import square_distance
from planners.geometry.kernels.swept_footprint import within

NEAR = 0.2  # [cells] margin of clearance below which a line is checked exactly


@njit(cache=True, nogil=True)
def line_clear(
    blocked: Bools,
    clearance: Floats,
    size: float,
    radius: float,
    touch: float,
    ax: float,
    ay: float,
    bx: float,
    by: float,
) -> bool:
    """Whether a disc, moved along the straight line from a to b, overlaps no blocked square.

    Where the distance field guarantees a margin of clearance, a step of that length is skipped;
    elsewhere the exact distance to the squares is computed for pieces of one cell.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    clearance : ndarray, shape (rows, cols) [cells]
    size : float [m]
        Side of a cell.
    radius : float [cells]
    touch : float [cells]
        Overlap that is attributed to rounding.
    ax, ay, bx, by : float [m, corner]
        Start and end of the line.
    """
    ax, ay, bx, by = ax / size, ay / size, bx / size, by / size
    if not (within(clearance, ax, ay, 0.0) and within(clearance, bx, by, 0.0)):
        return False
    if blocked[int(by), int(bx)]:  # planners extend from states that are clear
        return False
    need = max(radius, 2.0 * touch)
    dx, dy = bx - ax, by - ay
    length = math.sqrt(dx * dx + dy * dy)
    if length > 0.0:
        dx, dy = dx / length, dy / length
    rows, cols = blocked.shape
    at = 0.0
    while True:
        x, y = ax + at * dx, ay + at * dy
        row, col = min(int(y), rows - 1), min(int(x), cols - 1)  # rounding may yield the border
        off_x, off_y = x - col - 0.5, y - row - 0.5
        off = math.sqrt(off_x * off_x + off_y * off_y)
        room = clearance[row, col] - need
        if room - off >= NEAR:
            at += room - off
        else:
            if blocked[row, col] or room + off < -touch:
                return False
            to = min(at + 1.0, length)
            if not _piece_clear(blocked, x, y, ax + to * dx, ay + to * dy, need, touch):
                return False
            at += 1.0
        if at >= length:
            return True


@njit(cache=True, nogil=True)
def _piece_clear(
    blocked: Bools, ax: float, ay: float, bx: float, by: float, need: float, touch: float
) -> bool:
    """Whether a short segment is at least `need` from all blocked squares."""
    rows, cols = blocked.shape
    left, right = math.floor(min(ax, bx) - need), math.floor(max(ax, bx) + need)
    low, high = math.floor(min(ay, by) - need), math.floor(max(ay, by) + need)
    for row in range(max(low, 0), min(high, rows - 1) + 1):
        for col in range(max(left, 0), min(right, cols - 1) + 1):
            if blocked[row, col] and square_distance(ax, ay, bx, by, col, row) < need - touch:
                return False
    return True
