"""The ray caster: the usual mapping method, in which each feature is evidence on its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from groundmap import GroundMapper, View
from groundmap.arrays import Floats, Ints
from groundmap.evidence.evidence import Evidence
from groundmap.evidence.ground_plane.height_classes import GroundView, flatten
from groundmap.evidence.ground_plane.rasterised import with_drop_offs
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from planners.compare.kernels.raycast import cast_rays

FREE, NONFREE = np.float32(-1.0), np.float32(1.0)


class RayCaster:
    """Fuses views into a 2-D confidence grid by one thin ray per feature.

    It uses the height classes and the update rule of `groundmap.GroundMapper`; only the evidence
    of a view differs.

    Parameters
    ----------
    **settings
        `groundmap.settings.MapperSettings`; those of links, uncertainty and support have no effect.

    Raises
    ------
    SettingsError
        An unknown setting (the nearest one is named), or a value out of range.
    """

    def __init__(self, **settings: Any) -> None:
        self.settings = MapperSettings(**settings)
        self.grid = GroundMapper(**settings).grid

    def integrate(self, view: View) -> None:
        """Add one view to the grid.

        Raises
        ------
        NoGroundPlaneError
            The view has no plane, or its camera looks straight at the ground or the sky.
        """
        ground_view = flatten(view, self.settings)
        evidence = rays_of(ground_view, self.grid)
        self.grid.fuse(*with_drop_offs(evidence, ground_view, self.grid))


def rays_of(ground_view: GroundView, grid: ConfidenceGrid) -> Evidence:
    """Return the evidence of the rays of one view: one z per cell.

    The cells from the camera to a feature, the cell of the feature included, are free (-1). The
    cell of an obstacle feature is non-free (+1), even if other rays pass through it. The features
    of a segment are its two ends.

    Parameters
    ----------
    ground_view : GroundView
    grid : ConfidenceGrid
        Resolution and origin of the cells.
    """
    origin = _cells(ground_view, grid, np.zeros((1, 2)))
    obstacles, grounds = (
        _cells(ground_view, grid, xy) for xy in (ground_view.points, ground_view.supports)
    )
    ends = np.concatenate([obstacles, grounds])
    lower = _floor(np.concatenate([origin, ends])).min(axis=0)
    upper = _floor(np.concatenate([origin, ends])).max(axis=0)
    z = np.zeros((upper - lower + 1)[::-1], dtype=np.float32)
    cast_rays(z, origin[0] - lower, ends - lower, FREE)
    cols, rows = (_floor(obstacles) - lower).T
    z[rows, cols] = NONFREE
    return Evidence(lower[::-1], z)


def _cells(ground_view: GroundView, grid: ConfidenceGrid, xy: Floats) -> Floats:
    """Convert positions in the frame ``view`` to fractional cells (col, row)."""
    cos, sin = ground_view.forward
    to_map = np.array([(cos, -sin), (sin, cos)])
    cells: Floats = (ground_view.viewpoint + xy @ to_map.T - grid.origin) / grid.resolution
    return cells


def _floor(cells: Floats) -> Ints:
    return np.floor(cells).astype(np.int64)
