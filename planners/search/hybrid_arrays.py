"""The arrays that hybrid A*'s kernels take."""

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
    """Return an empty distance field for base_link, which keeps the inscribed radius as clearance.

    A cell is narrow if its centre does not have that clearance while another point of it may.

    Parameters
    ----------
    costmap : Costmap
    footprint : Footprint
    """
    cells, inscribed = costmap.blocked.size, footprint.inscribed_radius
    corner = math.sqrt(0.5) * costmap.window.resolution  # from a cell's centre
    places = (costmap.clearance + corner >= inscribed) & ~costmap.blocked
    if not footprint.is_disc and inscribed == 0.0:  # base_link may be over blocked cells
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
    """Return the factor that multiplies a length, by the cost of its cell; shape (256,) or (1,)."""
    if costmap.uniform:
        return np.ones(1)
    return 1.0 + costmap.top * np.minimum(np.arange(256), MAX_NON_OBSTACLE) / MAX_NON_OBSTACLE


def no_shot() -> Shot:
    """Return a curve of length 0."""
    return Shot(np.zeros(SEGMENTS), np.zeros(SEGMENTS, dtype=np.int64))


def empty_nodes(room: int) -> Nodes:
    """Return uninitialised nodes; `room` must be a power of two, as the table's size is one."""
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
