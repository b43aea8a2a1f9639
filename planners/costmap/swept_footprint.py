"""The map and the footprint as arguments of the kernels of swept footprints."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats
from planners.costmap.costmap import Costmap
from planners.geometry.kernels.swept_footprint import Ground, Shape
from planners.geometry.rounding import SLACK
from planners.problem.footprint import Footprint

MITRE_LIMIT = 5.0  # as in shapely: sharper corners of grown outlines are cut off
# How far the footprint may leave the hulls of the checked poses: [m], and as a share of a cell on
# cells larger than a metre, where a millimetre would require thousands of poses per turn.
BULGE = 1e-3


def ground_of(costmap: Costmap) -> Ground:
    """Return the map of a costmap."""
    before = np.zeros((costmap.blocked.shape[0], costmap.width + 1), dtype=np.int64)
    np.cumsum(costmap.blocked, axis=1, out=before[:, 1:])
    return Ground(costmap.blocked, before, costmap.clearance / costmap.window.resolution)


def shape_of(footprint: Footprint, size: float, *, slack: float = SLACK) -> Shape:
    """Return a footprint in cells.

    Parameters
    ----------
    footprint : Footprint
    size : float [m]
        Side of a cell.
    slack : float, default `planners.geometry.rounding.SLACK` [m]
        Overlap that is attributed to rounding.
    """
    parts = [part / size for part in footprint.convex_parts()]
    radius = footprint.radius / size
    return Shape(
        corners=np.concatenate([np.empty((0, 2)), *parts]),
        begins=np.cumsum([0, *map(len, parts)]),
        discs=footprint.covering_discs() / size,
        radius=radius if footprint.is_disc else 0.0,
        arm=0.0 if footprint.is_disc else radius,
        spike=max(map(_spike, parts), default=1.0),
        inscribed=footprint.inscribed_radius / size,
        bulge=max(BULGE / size, BULGE),
        touch=slack / size,
    )


def _spike(part: Floats) -> float:
    """Return how far the sharpest corner moves out per distance that a polygon is grown."""
    sides = np.diff(np.concatenate([part, part[:1]]), axis=0)
    turns = np.diff(np.unwrap(np.arctan2(*np.concatenate([sides, sides[:1]]).T[::-1])))
    return float(min(1.0 / np.cos(np.abs(turns).max() / 2.0), MITRE_LIMIT))
