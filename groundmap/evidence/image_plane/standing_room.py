"""The voxels that the robot itself stands in: the surest freespace, which its camera never sees."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.view.view import View


def standing_room(view: View, grid: ConfidenceGrid, settings: MapperSettings) -> Ints:
    """Return the voxels that the robot stands in, shape (n, 3): x, y, z.

    It is a cylinder as wide as the narrowest footprint, from what can be driven over up to the
    camera. A view without a ground plane, or with a camera higher above it than `robot_height`, has
    none: its base may fly.

    Parameters
    ----------
    view : View
    grid : ConfidenceGrid
    settings : MapperSettings
    """
    none = np.empty((0, 3), dtype=np.int64)
    if view.plane is None:
        return none
    camera_height = float(view.plane.height(view.rig.T_base_camera[:3, 3]))
    if not settings.step_height < camera_height <= settings.robot_height:
        return none
    normal = view.T_map_base[:3, :3] @ view.plane.normal
    foot = view.T_map_base[:3, 3] - view.plane.offset * normal
    radius = min(0.5 * settings.narrowest_footprint, settings.max_range)
    reach = np.abs(normal) * camera_height + radius * np.sqrt(np.maximum(1.0 - normal**2, 0.0))
    cells = _box(foot, reach, grid)
    offset = grid.origin + (cells + 0.5) * grid.resolution - foot
    height = offset @ normal
    across = (offset**2).sum(axis=1) - height**2
    inside = (height >= settings.step_height) & (height <= camera_height)
    standing: Ints = cells[inside & (across <= radius**2)]
    return standing


def _box(centre: Floats, reach: Floats, grid: ConfidenceGrid) -> Ints:
    """Return the voxels within `reach` of a place along each axis, shape (n, 3): x, y, z."""
    lower = np.floor((centre - reach - grid.origin) / grid.resolution).astype(np.int64)
    sides = np.ceil(2.0 * reach / grid.resolution).astype(np.int64) + 1
    cells: Ints = lower + np.argwhere(np.ones(sides, dtype=np.bool_))
    return cells
