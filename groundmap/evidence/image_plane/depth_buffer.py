"""The depth buffer: which triangle each part of the image shows, and how far it matters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints32
from groundmap.evidence.image_plane.kernels.depth_buffer import (
    EMPTY,
    draw_rim,
    draw_triangles,
    raise_limits,
)
from groundmap.evidence.image_plane.patches import Patches, PatchKind
from groundmap.evidence.triangulation import Mesh
from groundmap.settings import MapperSettings

SQUARE = 8  # [cells], side of the squares that share a limit
MOST_CELLS = 2**20  # wide images get larger cells
RIM = 2  # [cells] around the triangulation


class DepthBuffer(NamedTuple):
    """Triangle numbers over the image."""

    numbers: Ints32  #: shape (rows, cols), a triangle in or next to each cell; -1 for none
    limits: Floats  #: shape (a, b) [m], depth beyond which no triangle of a square matters
    origin: Floats  #: shape (2,), tangents of the outer corner of cell (0, 0), right and down
    cell: float  #: side of a cell, as a tangent


def depth_buffer_of(
    patches: Patches, mesh: Mesh, outer: Floats, settings: MapperSettings
) -> DepthBuffer:
    """Return the depth buffer of the patches of a view.

    A cell is half as large as a voxel appears at `max_range`. Where triangles are smaller, the
    search for the triangle at a place begins at its cell's.

    Parameters
    ----------
    patches : Patches
    mesh : Mesh
    outer : ndarray, shape (t,) [m]
        Depth beyond which a patch says nothing.
    settings : MapperSettings
    """
    corners = patches.corners
    lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    sides = upper - lower
    cell = max(
        0.5 * settings.resolution / settings.max_range, float(np.sqrt(np.prod(sides) / MOST_CELLS))
    )
    shape = np.ceil(sides[::-1] / cell).astype(np.int64) + 2 * RIM
    origin = lower - RIM * cell
    scaled = (corners - origin) / cell
    numbers = np.full(shape, EMPTY, dtype=np.int32)
    drawn = patches.kind != PatchKind.NOTHING
    draw_triangles(numbers, scaled, drawn)
    draw_rim(numbers, scaled, mesh.neighbors, drawn)
    limits = np.zeros(-(-shape // SQUARE))
    raise_limits(limits, scaled, np.where(drawn, outer, 0.0), SQUARE)
    return DepthBuffer(numbers, limits, origin, cell)
