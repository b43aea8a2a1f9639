"""Short pieces of rays, one voxel wide."""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Floats32

STEP = 0.5  # [voxels]


@njit(cache=True, nogil=True)
def draw_rays(
    z: Floats32, places: Floats, on_surface: Floats32, around: Floats32, falloff: Floats32
) -> None:
    """Raise z along pieces of rays: on the surface in their middle, around it to both ends.

    Parameters
    ----------
    z : ndarray of float32, shape (layers, rows, cols)
    places : ndarray, shape (n, 3, 3) [voxels]
        Near end, surface, far end: x, y, z.
    on_surface, around : ndarray of float32, shape (n,)
    falloff : ndarray of float32, shape (k,)
        Share of `around` in k shells, from the surface outwards.
    """
    for i in range(len(places)):
        for end in (0, 2):
            dx = places[i, end, 0] - places[i, 1, 0]
            dy = places[i, end, 1] - places[i, 1, 1]
            dz = places[i, end, 2] - places[i, 1, 2]
            steps = int(np.ceil(np.sqrt(dx * dx + dy * dy + dz * dz) / STEP))
            for j in range(1, steps + 1):
                share = j / steps
                shell = min(int(share * len(falloff)), len(falloff) - 1)
                _raise(
                    z,
                    places[i, 1, 0] + share * dx,
                    places[i, 1, 1] + share * dy,
                    places[i, 1, 2] + share * dz,
                    around[i] * falloff[shell],
                )
        _raise(z, places[i, 1, 0], places[i, 1, 1], places[i, 1, 2], on_surface[i])


@njit(cache=True, nogil=True)
def _raise(z: Floats32, x: float, y: float, height: float, value: np.float32) -> None:
    col, row, layer = int(np.floor(x)), int(np.floor(y)), int(np.floor(height))
    if 0 <= layer < z.shape[0] and 0 <= row < z.shape[1] and 0 <= col < z.shape[2]:
        z[layer, row, col] = max(z[layer, row, col], value)
