"""Exact checks of straight lines for a ball among voxels.

As in `planners.geometry.kernels.clearance3d`, positions in voxels are (x, y, z), and voxel
[layer, row, col] is the closed cube from (col, row, layer) to (col + 1, row + 1, layer + 1).
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit

Squared: TypeAlias = npt.NDArray[np.unsignedinteger[Any]]
NEAR = 0.2  # [voxels] margin of clearance below which a line is checked exactly
PIECE = 1.0  # [voxels] longest piece of a line that is checked exactly
HALVINGS = 64  # upper bound of the bisections of a line into short pieces


@njit(cache=True, nogil=True)
def line_clear(
    squared: Squared,
    size: float,
    radius: float,
    slack: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
) -> bool:
    """Whether a ball, moved along the straight line from a to b, overlaps no blocked cube.

    The distance field guarantees that the line is clear, on both sides of its middle, over the
    margin of clearance beyond the radius. The rest of either half is checked in the same way, short
    pieces by their exact distance to the cubes.

    Parameters
    ----------
    squared : ndarray of uint16 or uint32, shape (layers, rows, cols)
        As `Voxels.near_squared`: at least what the radius needs, where it is cut.
    size : float [m]
        Side of a voxel.
    radius : float [m]
    slack : float [m]
        Shortfall of the radius that is attributed to rounding.
    ax, ay, az, bx, by, bz : float [m, corner]
        Start and end of the line.
    """
    x, y, z = ax / size, ay / size, az / size
    dx, dy, dz = bx / size - x, by / size - y, bz / size - z
    if not (_within(squared, x, y, z) and _within(squared, bx / size, by / size, bz / size)):
        return False
    need = max(radius / size, 2.0 * slack / size)
    least = need - slack / size
    for s in (1.0, 0.0):
        if _nearness(squared, x + s * dx, y + s * dy, z + s * dz)[1] < least:
            return False
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    share = 1.0 / length if length > 0.0 else 0.0
    stack = np.empty((HALVINGS, 2))  # parts of the line that remain to be checked
    stack[0, 0], stack[0, 1] = 0.0, length
    count = 1
    while count > 0:
        count -= 1
        begin, end = stack[count]
        half, middle = (end - begin) / 2.0, (begin + end) / 2.0
        s = middle * share
        low, high = _nearness(squared, x + s * dx, y + s * dy, z + s * dz)
        if high < least:
            return False
        margin = low - need
        if margin >= half:
            continue
        if end - begin <= PIECE:
            s, t = begin * share, (end - begin) * share
            u, v, w = x + s * dx, y + s * dy, z + s * dz
            if not _piece_clear(squared, u, v, w, t * dx, t * dy, t * dz, least):
                return False
            continue
        if margin < NEAR:
            margin = 0.0
        stack[count, 0], stack[count, 1] = begin, middle - margin
        stack[count + 1, 0], stack[count + 1, 1] = middle + margin, end
        count += 2
    return True


@njit(cache=True, nogil=True)
def _within(squared: Squared, x: float, y: float, z: float) -> bool:
    layers, rows, cols = squared.shape
    return bool(0.0 <= x < cols and 0.0 <= y < rows and 0.0 <= z < layers)


@njit(cache=True, nogil=True)
def _nearness(squared: Squared, x: float, y: float, z: float) -> tuple[float, float]:
    """Return lower and upper bounds of the clearance at a point, from its voxel's centre.

    For a point that rounding moved off the map, the nearest voxel is used.
    """
    layers, rows, cols = squared.shape
    col = min(max(math.floor(x), 0), cols - 1)
    row = min(max(math.floor(y), 0), rows - 1)
    layer = min(max(math.floor(z), 0), layers - 1)
    at = squared[layer, row, col]
    u, v, w = x - col - 0.5, y - row - 0.5, z - layer - 0.5
    off = math.sqrt(u * u + v * v + w * w)
    clearance = 0.5 * math.sqrt(at)
    return clearance - off, clearance + off


@njit(cache=True, nogil=True)
def _piece_clear(
    squared: Squared,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    least: float,
) -> bool:
    """Whether all blocked cubes are at least `least` away from a short line.

    The line starts at (x, y, z) and has the direction and length of (dx, dy, dz).
    """
    layers, rows, cols = squared.shape
    limit = least * least
    left, right = min(x, x + dx), max(x, x + dx)
    low, high = min(y, y + dy), max(y, y + dy)
    down, up = min(z, z + dz), max(z, z + dz)
    first, last = max(math.floor(left - least), 0), min(math.floor(right + least), cols - 1)
    for k in range(max(math.floor(down - least), 0), min(math.floor(up + least), layers - 1) + 1):
        along_z = max(k - up, down - k - 1.0, 0.0)
        for j in range(
            max(math.floor(low - least), 0), min(math.floor(high + least), rows - 1) + 1
        ):
            along_y = max(j - high, low - j - 1.0, 0.0)
            beside = along_z * along_z + along_y * along_y
            if beside >= limit:
                continue
            for i in range(first, last + 1):
                if squared[k, j, i] == 0:
                    along_x = max(i - right, left - i - 1.0, 0.0)
                    if (
                        beside + along_x * along_x < limit
                        and _cube_squared(x - i, y - j, z - k, dx, dy, dz) < limit
                    ):
                        return False
    return True


@njit(cache=True, nogil=True)
def _cube_squared(x: float, y: float, z: float, dx: float, dy: float, dz: float) -> float:
    """Return the squared distance of a line from (x, y, z) to the unit cube at the origin.

    It is convex along the line, and its slope is linear between the points where a coordinate
    crosses a border of the cube. Each of these narrows the interval where the slope changes sign.
    """
    begin, end = 0.0, 1.0
    falls, rises = _slope(x, y, z, dx, dy, dz, 0.0), _slope(x, y, z, dx, dy, dz, 1.0)
    if falls >= 0.0:
        t = 0.0
    elif rises <= 0.0:
        t = 1.0
    else:
        for position, step in ((x, dx), (y, dy), (z, dz)):
            for border in (0.0, 1.0):
                t = (border - position) / step if step != 0.0 else begin
                if begin < t < end:
                    slope = _slope(x, y, z, dx, dy, dz, t)
                    if slope < 0.0:
                        begin, falls = t, slope
                    else:
                        end, rises = t, slope
        t = begin + (end - begin) * falls / (falls - rises)
    u, v, w = _gap(x + t * dx), _gap(y + t * dy), _gap(z + t * dz)
    return u * u + v * v + w * w


@njit(cache=True, nogil=True)
def _slope(x: float, y: float, z: float, dx: float, dy: float, dz: float, t: float) -> float:
    """Return half the slope of the squared distance to the unit cube."""
    return dx * _gap(x + t * dx) + dy * _gap(y + t * dy) + dz * _gap(z + t * dz)


@njit(cache=True, nogil=True)
def _gap(position: float) -> float:
    """Return the signed distance of a coordinate to the unit interval, negative below it."""
    return min(position, 0.0) + max(position - 1.0, 0.0)
