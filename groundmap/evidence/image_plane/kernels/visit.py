"""The visit of the voxels that a view may say something about, once each."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Floats32, Ints32

NOTHING, SIGHT, SURFACE, GAP = 0, 1, 2, 3  # as `PatchKind`
# Columns of the rows that describe a patch, see `Patches.rows`.
BASIS, NEAR, MIDDLE, FAR, THICKNESS, DEPTH, VALUES, CORNERS, BEFORE = (
    0,
    9,
    12,
    15,
    18,
    21,
    22,
    24,
    30,
)
COLUMNS = 33
BRICK = 8  # [voxels]
FREE = np.float32(-1.0)
SILENCE = np.float32(0.0)
NEAREST = 1e-3  # [m], a brick that begins nearer is visited anyway
MOST_STEPS = 4096  # from triangle to triangle


@njit(cache=True, nogil=True)
def visit_voxels(
    z: Floats32,
    first: Floats,
    resolution: float,
    reach: float,
    rotation: Floats,
    numbers: Ints32,
    limits: Floats,
    image: Floats,
    square: int,
    links: Ints32,
    rows: Floats,
    halo: float,
    falloff: Floats32,
) -> None:
    """Write evidence into voxels: in front of patches -1, where they pass through above 0.

    Parameters
    ----------
    z : ndarray of float32, shape (layers, rows, cols)
    first : ndarray, shape (3,) [m]
        Centre of voxel (0, 0, 0) relative to the camera: x, y, z, axes of the map.
    resolution, reach : float [m]
        Side of a voxel, and how far from the camera voxels are visited.
    rotation : ndarray, shape (3, 3)
        From the camera to the map.
    numbers, limits : ndarray
        As in `DepthBuffer`.
    image : ndarray, shape (3,)
        Its origin and cell.
    square : int
        Cells along the squares of `limits`.
    links : ndarray of int32, shape (t, 4)
        Neighbours of each triangle, opposite to each corner, and its kind.
    rows : ndarray, shape (t, COLUMNS)
        Patches.
    halo : float [m]
        Distance of sight from a near corner within which it ends there.
    falloff : ndarray of float32, shape (k,)
        z in k shells of the spread, from the surface outwards, as a share of that around it.
    """
    for layer in range(0, z.shape[0], BRICK):
        for row in range(0, z.shape[1], BRICK):
            for col in range(0, z.shape[2], BRICK):
                brick = z[layer : layer + BRICK, row : row + BRICK, col : col + BRICK]
                x = first[0] + col * resolution
                y = first[1] + row * resolution
                height = first[2] + layer * resolution
                if _matters(
                    brick.shape, x, y, height, resolution, reach, rotation, limits, image, square
                ):
                    _visit(
                        brick, x, y, height, resolution, reach, rotation, numbers, image, links,
                        rows, halo, falloff,
                    )  # fmt: skip


@njit(cache=True, nogil=True)
def _matters(
    shape: tuple[int, int, int],
    x: float,
    y: float,
    z: float,
    resolution: float,
    reach: float,
    rotation: Floats,
    limits: Floats,
    image: Floats,
    square: int,
) -> bool:
    """Whether a triangle may say something about the centre of a voxel of a brick."""
    last_x = x + (shape[2] - 1) * resolution
    last_y = y + (shape[1] - 1) * resolution
    last_z = z + (shape[0] - 1) * resolution
    dx, dy, dz = max(x, -last_x, 0.0), max(y, -last_y, 0.0), max(z, -last_z, 0.0)
    if dx * dx + dy * dy + dz * dz > reach * reach:
        return False
    nearest, farthest = np.inf, -np.inf
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    for corner in range(8):
        px = x if corner & 1 else last_x
        py = y if corner & 2 else last_y
        pz = z if corner & 4 else last_z
        ahead = rotation[0, 2] * px + rotation[1, 2] * py + rotation[2, 2] * pz
        nearest, farthest = min(nearest, ahead), max(farthest, ahead)
        if ahead > NEAREST:
            u = (rotation[0, 0] * px + rotation[1, 0] * py + rotation[2, 0] * pz) / ahead
            v = (rotation[0, 1] * px + rotation[1, 1] * py + rotation[2, 1] * pz) / ahead
            left, right = min(left, u), max(right, u)
            top, bottom = min(top, v), max(bottom, v)
    if farthest <= 0.0:
        return False
    if nearest <= NEAREST:
        return True
    side = image[2] * square
    a0 = max(int(np.floor((top - image[1]) / side)), 0)
    a1 = min(int(np.floor((bottom - image[1]) / side)), limits.shape[0] - 1)
    b0 = max(int(np.floor((left - image[0]) / side)), 0)
    b1 = min(int(np.floor((right - image[0]) / side)), limits.shape[1] - 1)
    for a in range(a0, a1 + 1):
        for b in range(b0, b1 + 1):
            if limits[a, b] >= nearest:
                return True
    return False


@njit(cache=True, nogil=True)
def _visit(
    brick: Floats32,
    first_x: float,
    first_y: float,
    first_z: float,
    resolution: float,
    reach: float,
    rotation: Floats,
    numbers: Ints32,
    image: Floats,
    links: Ints32,
    rows: Floats,
    halo: float,
    falloff: Floats32,
) -> None:
    """Write evidence into the voxels of a brick; its first centre is given, from the camera."""
    r00, r10, r20 = rotation[0, 0], rotation[1, 0], rotation[2, 0]
    r01, r11, r21 = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    r02, r12, r22 = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    per_cell, left, top = 1.0 / image[2], image[0], image[1]
    height, width = numbers.shape
    for i in range(brick.shape[0]):
        z = first_z + i * resolution
        for j in range(brick.shape[1]):
            y = first_y + j * resolution
            for k in range(brick.shape[2]):
                x = first_x + k * resolution
                ahead = r02 * x + r12 * y + r22 * z
                if ahead <= 0.0 or x * x + y * y + z * z > reach * reach:
                    continue
                closeness = 1.0 / ahead
                u = (r00 * x + r10 * y + r20 * z) * closeness
                v = (r01 * x + r11 * y + r21 * z) * closeness
                col, row = (u - left) * per_cell, (v - top) * per_cell
                if not (0.0 <= col < width and 0.0 <= row < height):
                    continue
                t, a, b, c = _locate(numbers[int(row), int(col)], x, y, z, links, rows)
                if t < 0:
                    continue
                kind = links[t, 3]
                if kind == GAP:
                    before = ahead * _limit_at_gap(rows, t, u, v, halo)
                else:
                    before = rows[t, NEAR] * a + rows[t, NEAR + 1] * b + rows[t, NEAR + 2] * c
                value = FREE if before < 1.0 and ahead <= rows[t, DEPTH] else SILENCE
                if kind == SURFACE and before >= 1.0 - rows[t, THICKNESS]:
                    value = _at_surface(rows, t, a, b, c, before, falloff, value)
                brick[i, j, k] = value


@njit(cache=True, nogil=True)
def _locate(
    t: int, x: float, y: float, z: float, links: Ints32, rows: Floats
) -> tuple[int, float, float, float]:
    """Return the triangle that a place is seen through, and its weights there; -1 for none.

    The search walks from a triangle nearby across the side that the place lies farthest beyond.
    """
    a = b = c = 0.0
    for _ in range(MOST_STEPS):
        if t < 0 or links[t, 3] == NOTHING:
            return -1, 0.0, 0.0, 0.0
        a = rows[t, 0] * x + rows[t, 1] * y + rows[t, 2] * z
        b = rows[t, 3] * x + rows[t, 4] * y + rows[t, 5] * z
        c = rows[t, 6] * x + rows[t, 7] * y + rows[t, 8] * z
        least = min(a, b, c)
        if least >= 0.0:
            return t, a, b, c
        t = links[t, 0 if a == least else (1 if b == least else 2)]
    return -1, a, b, c  # rounding between triangles that are almost lines


@njit(cache=True, nogil=True)
def _at_surface(
    rows: Floats,
    t: int,
    a: float,
    b: float,
    c: float,
    before: float,
    falloff: Floats32,
    otherwise: np.float32,
) -> np.float32:
    """Return z of a voxel at or behind the near limit of a surface, if it is not behind the far."""
    at = rows[t, MIDDLE] * a + rows[t, MIDDLE + 1] * b + rows[t, MIDDLE + 2] * c
    if abs(at - 1.0) <= rows[t, THICKNESS + 1]:
        return np.float32(rows[t, VALUES])
    behind = rows[t, FAR] * a + rows[t, FAR + 1] * b + rows[t, FAR + 2] * c
    if behind > 1.0 + rows[t, THICKNESS + 2]:
        return otherwise
    share = (1.0 - at) / (before - at) if at < 1.0 else (at - 1.0) / (at - behind)
    shell = min(int(share * len(falloff)), len(falloff) - 1)
    value: np.float32 = np.float32(rows[t, VALUES + 1]) * falloff[shell]
    return value


@njit(cache=True, nogil=True)
def _limit_at_gap(rows: Floats, t: int, u: float, v: float, halo: float) -> float:
    """Return the inverse depth where sight ends in a patch that spans a gap in depth.

    It ends at the nearest of the near corners that it passes within `halo` metres, and otherwise at
    the nearest of the far ones.
    """
    limit = 0.0
    for k in range(3):
        if rows[t, BEFORE + k] > 0.0:
            du, dv = u - rows[t, CORNERS + 2 * k], v - rows[t, CORNERS + 2 * k + 1]
            width = halo * rows[t, MIDDLE + k]
            if du * du + dv * dv > width * width:
                continue
        limit = max(limit, rows[t, NEAR + k])
    return limit
