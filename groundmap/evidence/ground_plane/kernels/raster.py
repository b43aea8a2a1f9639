"""Drawing into a dense block of cells; coordinates are in cells, x along columns, y along rows.

A cell is inside a polygon if its centre is. Borders are half-open: of two polygons that share a
border, exactly one contains a cell on it. A line covers every cell that it passes through.
Features in whole pixels, and viewpoints on corners of cells, put borders exactly on centres: what
lies on a border up to rounding counts by one rule.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Bytes, Floats, Floats32

FREE = np.float32(-1.0)
NO_TOP = np.float32(np.inf)  # in the spread around a surface
EDGE = 1e-9  # [cells]: places this near to a border or a centre are on it, whatever the rounding
STEPS = np.float32(64.0)  # [1/m], heights are rounded up to 1/64 m to hide rounding errors


@njit(cache=True, nogil=True)
def fill_star(
    z: Floats32, odd: Bytes, origin: Floats, start: Floats, end: Floats, joined: Bools
) -> None:
    """Set the cells of a star polygon to -1, in one parity pass.

    The polygon is start[0], end[0], start[1], ..., with `origin` between pieces that are not
    joined.

    Parameters
    ----------
    z : ndarray of float32
        Changed in place.
    odd : ndarray of uint8, of z's shape
        Work array of zeros, changed in place.
    origin : ndarray, shape (2,) [cells]
    start, end : ndarray, shape (k, 2) [cells]
        Ends of the pieces.
    joined : ndarray of bool, shape (k,)
        Whether the next piece (cyclic) begins at the end of each piece.
    """
    count = len(start)
    for i in range(count):
        following = start[i + 1 if i + 1 < count else 0]
        _flip_right_of(odd, start[i], end[i])
        if joined[i]:
            _flip_right_of(odd, end[i], following)
        else:
            _flip_right_of(odd, end[i], origin)
            _flip_right_of(odd, origin, following)
    for row in range(z.shape[0]):
        inside = np.uint8(0)
        for col in range(z.shape[1]):
            inside ^= odd[row, col]
            if inside:
                z[row, col] = FREE


@njit(cache=True, nogil=True)
def _flip_right_of(odd: Bytes, p: Floats, q: Floats) -> None:
    """Flip, in each row that the edge p-q spans, the first cell whose centre is right of it."""
    if p[1] > q[1]:
        p, q = q, p
    first, last = _first_centre(p[1]), _first_centre(q[1])
    if first >= last:
        return
    slope = (q[0] - p[0]) / (q[1] - p[1])
    for row in range(max(first, 0), min(last, odd.shape[0])):
        col = max(_first_centre(p[0] + (row + 0.5 - p[1]) * slope), 0)
        if col < odd.shape[1]:
            odd[row, col] ^= np.uint8(1)


@njit(cache=True, nogil=True)
def _first_centre(coordinate: float) -> int:
    """Return the first cell whose centre is at or after a coordinate, up to rounding."""
    return int(np.ceil(coordinate - 0.5 - EDGE))


@njit(cache=True, nogil=True)
def draw_surfaces(
    z: Floats32,
    height: Floats32,
    ends: Floats,
    cores: Floats,
    outlines: Floats,
    sides: Floats,
    caps: Floats,
    discs: Floats,
    on_surface: Floats,
    around: Floats,
    tops: Floats,
    origin: Floats,
    farthest: float,
) -> None:
    """Raise z to the evidence of surfaces and of the spread around them.

    A cell gets the maximum z of all surfaces, and the height of this surface's top; of several
    surfaces with this z, the highest top that is known (near the camera, the spread around a
    surface has the z of the surface). Nothing spreads beyond `farthest` from `origin`.

    Parameters
    ----------
    z, height : ndarray of float32
        Evidence and its height [m], changed in place.
    ends, cores : ndarray, shape (s, 2, 2) [cells]
        Ends of the surfaces, and centres of the caps.
    outlines : ndarray, shape (s, 4, 2) [cells]
        Quadrangles of the spread.
    sides : ndarray, shape (s, 4, 2) [cells]
        The same corners, pulled to within `farthest`.
    caps : ndarray, shape (s, 2) [cells]
        Radii of the caps of the spread; 0 for none.
    discs : ndarray, shape (s,) [cells]
        Radii of the discs of lone points; 0 for other surfaces.
    on_surface, around : ndarray, shape (s,)
        Values of z on the surface and in its spread.
    tops : ndarray, shape (s,) [m]
    origin : ndarray, shape (2,) [cells]
    farthest : float [cells]
    """
    for i in range(len(ends)):
        spread, top = np.float32(around[i]), np.float32(tops[i])
        _fill_quadrangle(z, height, outlines[i], spread, NO_TOP, origin, farthest)
        _draw_line(z, height, sides[i, 0], sides[i, 3], spread, NO_TOP)
        _draw_line(z, height, sides[i, 1], sides[i, 2], spread, NO_TOP)
        for side in range(2):
            if caps[i, side] > 0.0:
                cap, radius = cores[i, side], caps[i, side]
                _fill_disc(z, height, cap, radius, spread, NO_TOP, origin, farthest)
        surface = np.float32(on_surface[i])
        if discs[i] > 0.0:
            middle = 0.5 * (ends[i, 0] + ends[i, 1])
            _fill_disc(z, height, middle, discs[i], surface, top, origin, np.inf)
            _draw_line(z, height, middle, middle, surface, top)
        else:
            _draw_line(z, height, ends[i, 0], ends[i, 1], surface, top)


@njit(cache=True, nogil=True)
def _fill_quadrangle(
    z: Floats32,
    height: Floats32,
    corners: Floats,
    value: np.float32,
    top: np.float32,
    origin: Floats,
    farthest: float,
) -> None:
    lowest, highest = corners[:, 1].min(), corners[:, 1].max()
    crossings = np.empty(4)
    for row in range(max(_first_centre(lowest), 0), min(_first_centre(highest), z.shape[0])):
        half = farthest**2 - (row + 0.5 - origin[1]) ** 2
        if half < 0.0:
            continue
        half = np.sqrt(half)
        count = 0
        for i in range(4):
            p, q = corners[i], corners[(i + 1) % 4]
            if p[1] > q[1]:
                p, q = q, p
            if p[1] <= row + 0.5 < q[1]:
                slope = (q[0] - p[0]) / (q[1] - p[1])
                crossings[count] = p[0] + (row + 0.5 - p[1]) * slope
                count += 1
        crossings[:count].sort()
        for pair in range(0, count - 1, 2):
            left = max(_first_centre(max(crossings[pair], origin[0] - half)), 0)
            right = min(_first_centre(min(crossings[pair + 1], origin[0] + half)), z.shape[1])
            for col in range(left, right):
                _raise(z, height, row, col, value, top)


@njit(cache=True, nogil=True)
def _fill_disc(
    z: Floats32,
    height: Floats32,
    centre: Floats,
    radius: float,
    value: np.float32,
    top: np.float32,
    origin: Floats,
    farthest: float,
) -> None:
    for row in range(
        max(_first_centre(centre[1] - radius), 0),
        min(_first_centre(centre[1] + radius) + 1, z.shape[0]),
    ):
        dy = row + 0.5 - centre[1]
        for col in range(
            max(_first_centre(centre[0] - radius), 0),
            min(_first_centre(centre[0] + radius) + 1, z.shape[1]),
        ):
            dx = col + 0.5 - centre[0]
            away = (col + 0.5 - origin[0]) ** 2 + (row + 0.5 - origin[1]) ** 2
            near = dx * dx + dy * dy <= radius * radius + EDGE
            if near and away <= farthest * farthest + EDGE:
                _raise(z, height, row, col, value, top)


@njit(cache=True, nogil=True)
def _draw_line(
    z: Floats32, height: Floats32, p: Floats, q: Floats, value: np.float32, top: np.float32
) -> None:
    """Visit the cells from p to q in order (Amanatides and Woo 1987)."""
    col, row = int(np.floor(p[0] + EDGE)), int(np.floor(p[1] + EDGE))
    last_col, last_row = int(np.floor(q[0] + EDGE)), int(np.floor(q[1] + EDGE))
    dx, dy = q[0] - p[0], q[1] - p[1]
    step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    # Share of the line at the next border in x and y, and from one border to the next.
    next_x = ((col + (dx > 0)) - p[0]) / dx if dx != 0.0 else np.inf
    next_y = ((row + (dy > 0)) - p[1]) / dy if dy != 0.0 else np.inf
    each_x = abs(1.0 / dx) if dx != 0.0 else np.inf
    each_y = abs(1.0 / dy) if dy != 0.0 else np.inf
    # The number of steps is fixed, so rounding can't make the walk miss its end.
    for _ in range(abs(last_col - col) + abs(last_row - row) + 1):
        if 0 <= row < z.shape[0] and 0 <= col < z.shape[1]:
            _raise(z, height, row, col, value, top)
        if col != last_col and (next_x + EDGE < next_y or row == last_row):
            col += step_x
            next_x += each_x
        else:
            row += step_y
            next_y += each_y


@njit(cache=True, nogil=True)
def _raise(
    z: Floats32, height: Floats32, row: int, col: int, value: np.float32, top: np.float32
) -> None:
    """Raise a cell to a higher value with its top, or at an equal value to the higher known top."""
    if value > z[row, col]:
        z[row, col], height[row, col] = value, top
    elif value == z[row, col]:
        known = height[row, col]
        height[row, col] = min(known, top) if max(known, top) == NO_TOP else max(known, top)


@njit(cache=True, nogil=True)
def lowest_sight(
    height: Floats32, origin: Floats, eye: float, ends: Floats, end_heights: Floats
) -> None:
    """Lower each cell to the lowest line of sight over its centre.

    Parameters
    ----------
    height : ndarray of float32 [m]
        Lowered in place, not below 0, and rounded up to multiples of 1/64 m.
    origin : ndarray, shape (2,) [cells]
        Position of the camera.
    eye : float [m]
        Height of the camera above the ground.
    ends : ndarray, shape (k, 2, 2) [cells]
        Lines of sight fill the triangles (camera, end, end), which are counter-clockwise.
    end_heights : ndarray, shape (k, 2) [m]
        Heights of the lines at the ends.
    """
    for i in range(len(ends)):
        ax, ay = ends[i, 0, 0] - origin[0], ends[i, 0, 1] - origin[1]
        bx, by = ends[i, 1, 0] - origin[0], ends[i, 1, 1] - origin[1]
        area = ax * by - ay * bx
        if area <= 0.0:
            continue
        fall_a, fall_b = end_heights[i, 0] - eye, end_heights[i, 1] - eye
        # The height is linear over the triangle. The order of the products keeps results equal
        # under quarter turns of the map.
        slope_x = (by * fall_a - ay * fall_b) / area
        slope_y = (ax * fall_b - bx * fall_a) / area
        first = max(_first_centre(origin[1] + min(0.0, ay, by)), 0)
        last = min(_first_centre(origin[1] + max(0.0, ay, by) + 2.0 * EDGE), height.shape[0])
        for row in range(first, last):
            y = row + 0.5 - origin[1]
            left, right = _span(y, ax, ay, bx, by)
            begin = max(_first_centre(origin[0] + left), 0)
            end = min(_first_centre(origin[0] + right + 2.0 * EDGE), height.shape[1])
            for col in range(begin, end):
                x = col + 0.5 - origin[0]
                low = np.float32(eye + (slope_x * x + slope_y * y))
                height[row, col] = min(height[row, col], low)
    for row in range(height.shape[0]):
        for col in range(height.shape[1]):
            low = max(height[row, col], np.float32(0.0))
            height[row, col] = np.ceil(low * STEPS) / STEPS


@njit(cache=True, nogil=True)
def roll_over(z: Floats32, height: Floats32, centre: Floats, radius: float) -> None:
    """Set the cells with centres in a disc to -1, at height 0: the ground below the base.

    Parameters
    ----------
    z, height : ndarray of float32
        Evidence and its height [m], changed in place.
    centre : ndarray, shape (2,) [cells]
    radius : float [cells]
    """
    for row in range(
        max(_first_centre(centre[1] - radius), 0),
        min(_first_centre(centre[1] + radius) + 1, z.shape[0]),
    ):
        for col in range(
            max(_first_centre(centre[0] - radius), 0),
            min(_first_centre(centre[0] + radius) + 1, z.shape[1]),
        ):
            dx, dy = col + 0.5 - centre[0], row + 0.5 - centre[1]
            if dx * dx + dy * dy <= radius * radius + EDGE:
                z[row, col], height[row, col] = FREE, 0.0


@njit(cache=True, nogil=True)
def _span(y: float, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Return the bounds of the triangle (0, 0), a, b in a row."""
    left, right = np.inf, -np.inf
    for px, py, qx, qy in ((0.0, 0.0, ax, ay), (ax, ay, bx, by), (bx, by, 0.0, 0.0)):
        if min(py, qy) - EDGE <= y <= max(py, qy) + EDGE:
            if abs(qy - py) <= EDGE:
                x0, x1 = px, qx
            else:
                x0 = px + (qx - px) * min(max((y - py) / (qy - py), 0.0), 1.0)
                x1 = x0
            left, right = min(left, x0, x1), max(right, x0, x1)
    return left, right
