"""Places of points on a strip of ground."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats


@njit(cache=True, nogil=True)
def locate_points(points: Floats, places: Floats, normals: Floats, located: Floats) -> None:
    """Locate points relative to the nearest piece of a track.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m]
    places, normals : ndarray, shape (k, 3)
        Of the track. Between two places, normals are interpolated linearly.
    located : ndarray, shape (n, 6)
        Set to station, offset to the left and height [m] of each point, and the normal there.
    """
    pieces = len(places) - 1
    along = np.empty((pieces, 3))
    lengths = np.empty(pieces)
    starts = np.empty(pieces)
    total = 0.0
    for piece in range(pieces):
        square = 0.0
        for axis in range(3):
            along[piece, axis] = places[piece + 1, axis] - places[piece, axis]
            square += along[piece, axis] ** 2
        lengths[piece] = np.sqrt(square)
        starts[piece] = total
        total += lengths[piece]
    for row in range(len(points)):
        x, y, z = points[row]
        best, number, share = np.inf, 0, 0.0
        for piece in range(pieces):
            ax, ay, az = along[piece]
            dx, dy, dz = x - places[piece, 0], y - places[piece, 1], z - places[piece, 2]
            at = (dx * ax + dy * ay + dz * az) / lengths[piece] ** 2
            if piece > 0:
                at = max(at, 0.0)
            if piece < pieces - 1:
                at = min(at, 1.0)
            dx, dy, dz = dx - at * ax, dy - at * ay, dz - at * az
            distance = dx * dx + dy * dy + dz * dz
            if distance < best:
                best, number, share = distance, piece, at
        ax, ay, az = along[number]
        dx = x - places[number, 0] - share * ax
        dy = y - places[number, 1] - share * ay
        dz = z - places[number, 2] - share * az
        blend = min(max(share, 0.0), 1.0)
        nx = (1.0 - blend) * normals[number, 0] + blend * normals[number + 1, 0]
        ny = (1.0 - blend) * normals[number, 1] + blend * normals[number + 1, 1]
        nz = (1.0 - blend) * normals[number, 2] + blend * normals[number + 1, 2]
        length = lengths[number]
        located[row, 0] = starts[number] + share * length
        located[row, 1] = (
            (ny * az - nz * ay) * dx + (nz * ax - nx * az) * dy + (nx * ay - ny * ax) * dz
        ) / length
        located[row, 2] = nx * dx + ny * dy + nz * dz
        located[row, 3], located[row, 4], located[row, 5] = nx, ny, nz


@njit(cache=True, nogil=True)
def mark_bends(rows: Floats, tolerance: float, keep: Bools) -> None:
    """Mark the rows that piecewise linear interpolation between marked ones needs.

    Parameters
    ----------
    rows : ndarray, shape (k, d)
    tolerance : float
        Largest distance of other rows from the chord between the marked ones around them.
    keep : ndarray of bool, shape (k,)
        Set.
    """
    keep[:] = False
    keep[0] = keep[-1] = True
    first = 0
    while first < len(rows) - 1:
        last = first + 1
        while not keep[last]:
            last += 1
        square = 0.0
        for axis in range(rows.shape[1]):
            square += (rows[last, axis] - rows[first, axis]) ** 2
        farthest, most = first, tolerance**2
        for row in range(first + 1, last):
            product = 0.0
            for axis in range(rows.shape[1]):
                product += (rows[row, axis] - rows[first, axis]) * (
                    rows[last, axis] - rows[first, axis]
                )
            share = min(max(product / square, 0.0), 1.0) if square > 0 else 0.0
            distance = 0.0
            for axis in range(rows.shape[1]):
                chord = rows[first, axis] + share * (rows[last, axis] - rows[first, axis])
                distance += (rows[row, axis] - chord) ** 2
            if distance > most:
                farthest, most = row, distance
        if farthest > first:
            keep[farthest] = True
        else:
            first = last
