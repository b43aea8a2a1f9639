"""What hybrid A* works on: the map, the footprint and its own arrays, as its kernels read them."""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Floats
from planners.costmap import Costmap
from planners.costs import MAX_NON_OBSTACLE
from planners.footprint import Footprint
from planners.kernels.curves import SEGMENTS
from planners.kernels.footprint import Ground, Shape
from planners.kernels.hybrid import Nodes, Shot
from planners.kernels.hybrid_field import BUCKETS, Field
from planners.lattice import allowed_moves
from planners.rounding import SLACK

MITRE_LIMIT = 5.0  # of shapely and others that grow outlines: sharper corners are cut off
# How far the footprint may leave the hulls of the poses it is checked at: [m], and on cells of more
# than a metre, where a millimetre would take thousands of poses a turn, as a share of a cell.
BULGE = 1e-3


def ground_of(costmap: Costmap) -> Ground:
    """Return the map of a costmap."""
    before = np.zeros((costmap.blocked.shape[0], costmap.width + 1), dtype=np.int64)
    np.cumsum(costmap.blocked, axis=1, out=before[:, 1:])
    return Ground(costmap.blocked, before, costmap.clearance / costmap.window.resolution)


def shape_of(footprint: Footprint, size: float, *, slack: float = SLACK) -> Shape:
    """Return a footprint in cells of a side of `size` [m].

    `slack` [m] is the overlap that is put down to rounding.
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
    """Return how much more than by d its sharpest corner moves out when a polygon is grown by d."""
    sides = np.diff(np.concatenate([part, part[:1]]), axis=0)
    turns = np.diff(np.unwrap(np.arctan2(*np.concatenate([sides, sides[:1]]).T[::-1])))
    return float(min(1.0 / np.cos(np.abs(turns).max() / 2.0), MITRE_LIMIT))


def field_of(costmap: Costmap, footprint: Footprint) -> Field:
    """Return the field of the ways for base_link: it keeps the inscribed radius.

    It need not do so at a cell's centre: a cell counts as narrow if it may elsewhere.
    """
    cells, inscribed = costmap.blocked.size, footprint.inscribed_radius
    corner = math.sqrt(0.5) * costmap.window.resolution  # from a cell's centre
    places = (costmap.clearance + corner >= inscribed) & ~costmap.blocked
    if not footprint.is_disc and inscribed == 0.0:  # base_link may be over what is blocked
        places = np.ones_like(costmap.blocked)
    return Field(
        moves=allowed_moves(places).ravel(),
        narrow=(costmap.clearance < inscribed).ravel(),
        distances=np.empty(cells, dtype=np.int32),
        links=np.empty((cells + 1, 2), dtype=np.int32),
        heads=np.empty(BUCKETS, dtype=np.int32),
        state=np.zeros(2, dtype=np.int64),
    )


def factors_of(costmap: Costmap) -> Floats:
    """Return what a length costs by the cost of its cell, as a multiple of itself."""
    if costmap.uniform:
        return np.ones(1)
    return 1.0 + costmap.top * np.minimum(np.arange(256), MAX_NON_OBSTACLE) / MAX_NON_OBSTACLE


def no_shot() -> Shot:
    """Return the curve of no length."""
    return Shot(np.zeros(SEGMENTS), np.zeros(SEGMENTS, dtype=np.int64))


def empty_nodes(room: int) -> Nodes:
    """Return room for nodes: a power of two, as the table's size must be one."""
    return Nodes(
        poses=np.empty((room, 3)),
        costs=np.empty(room),
        guesses=np.empty(room),
        keys=np.empty(room, dtype=np.int64),
        parents=np.empty(room, dtype=np.int32),
        motions=np.empty(room, dtype=np.int32),
        closed=np.empty(room, dtype=np.bool_),
        table=np.empty(4 * room, dtype=np.int32),
    )
