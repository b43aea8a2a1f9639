"""Hybrid A*'s own arrays, as its kernels read them."""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Floats
from planners.costmap.costmap import Costmap
from planners.costmap.moves import allowed_moves
from planners.geometry.kernels.curves import SEGMENTS
from planners.problem.costs import MAX_NON_OBSTACLE
from planners.problem.footprint import Footprint
from planners.search.kernels.hybrid_astar import Nodes, Shot
from planners.search.kernels.hybrid_field import BUCKETS, Field


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
