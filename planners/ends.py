"""How start and goal are joined to the cells between them, and the line through these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap import Costmap
from planners.costs import MAX_NON_OBSTACLE
from planners.kernels.astar import ONE
from planners.links import Links, is_clear, links
from planners.polyline import merged
from planners.rounding import slack_at


class Ends(NamedTuple):
    """Where searches begin and end.

    Where start or goal is joined to no cell, no cell-to-cell route exists: then both sources and
    targets are empty, and a search that begins with the sources ends at once.
    """

    sources: Ints  #: shape (n, 3): row, column, cost from the start
    targets: Ints  #: shape (m, 3): row, column, cost to the goal
    direct: bool  #: the straight piece from start to goal, within two by two cells, is the best


def ends_of(costmap: Costmap, start: tuple[float, ...], goal: tuple[float, ...]) -> Ends:
    """Return the cells that start and goal are joined to.

    Parameters
    ----------
    costmap : Costmap
    start, goal : tuple of float
        x and y [m, map]; what follows is ignored.
    """
    (ax, ay), (bx, by) = costmap.to_cells([start[:2], goal[:2]]).tolist()
    radius = costmap.radius
    sources, targets = (
        _with_costs(costmap, links(costmap, (place[0], place[1]), radius=radius))
        for place in (start, goal)
    )
    if len(sources) == 0 or len(targets) == 0:
        sources, targets = sources[:0], targets[:0]
    slack = slack_at(start[:2], goal[:2])
    direct = (costmap.uniform or start[:2] == goal[:2]) and is_clear(
        costmap, (ax, ay), (bx, by), radius=radius - slack
    )
    return Ends(sources, targets, direct)


def waypoints_through(
    costmap: Costmap, start: tuple[float, ...], goal: tuple[float, ...], cells: Ints
) -> Floats:
    """Return the line from start to goal through the centres of cells, shape (n, 2) [m, map].

    Parameters
    ----------
    costmap : Costmap
    start, goal : tuple of float
        x and y [m, map]; what follows is ignored.
    cells : ndarray of int64, shape (k, 2)
        Row and column of the cells where the line begins, turns and ends, in order; may be empty.
    """
    centres = costmap.window.cell_to_world(cells.reshape(-1, 2))
    return merged(np.concatenate([[start[:2]], centres, [goal[:2]]]))


def _with_costs(costmap: Costmap, joined: Links) -> Ints:
    """Return row, column and cost: the length, as dear as the cell it leads to."""
    # Up to rounding, a piece may keep a distance that its cell, to the last bit, doesn't.
    on = costmap.stand[tuple(joined.cells.T)]
    joined = Links(joined.cells[on], joined.lengths[on])
    extra = costmap.costs[tuple(joined.cells.T)] * (costmap.top / MAX_NON_OBSTACLE)
    lengths = joined.lengths / costmap.window.resolution * (1.0 + extra)
    return np.column_stack([joined.cells, np.rint(lengths * ONE).astype(np.int64)])
