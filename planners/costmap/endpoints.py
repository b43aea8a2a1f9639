"""How start and goal are linked to the cells around them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.moves import ONE
from planners.error_messages import Point
from planners.geometry.kernels.clearance import segment_clearance
from planners.geometry.polyline import merge_collinear
from planners.geometry.rounding import rounding_at, slack_at
from planners.problem.costs import MAX_NON_OBSTACLE


class Links(NamedTuple):
    """The cells that a place is linked to."""

    cells: Ints  #: shape (n, 2): row, column
    lengths: Floats  #: shape (n,) [m]


def links(costmap: Costmap, xy: Point, *, radius: float) -> Links:
    """Return the straight links from a place to the up to four cell centres around it.

    Like a move, a link keeps its clearance exactly and cuts no corner: none of the cells of the
    block that its ends span is blocked.

    Parameters
    ----------
    costmap : Costmap
    xy : tuple of float [m, map]
    radius : float [m]
        Clearance to keep.
    """
    x, y = costmap.to_cells(xy)[0]
    kept = radius - slack_at(xy)
    cols, rows = (centres_around(at, rounding_at(xy) / costmap.window.resolution) for at in (x, y))
    cells = [
        (row, col)
        for row in rows
        for col in cols
        if is_clear(costmap, (x, y), (col + 0.5, row + 0.5), radius=kept)
    ]
    lengths = [math.hypot(col + 0.5 - x, row + 0.5 - y) for row, col in cells]
    resolution = costmap.window.resolution
    return Links(
        np.array(cells, dtype=np.int64).reshape(-1, 2), np.array(lengths, dtype=float) * resolution
    )


def centres_around(position: float, near: float) -> range:
    """Return the one or two cells along an axis whose centres enclose a position.

    Parameters
    ----------
    position : float [cells]
    near : float [cells]
        A position at most this far from a centre coincides with it.

    Examples
    --------
    >>> [list(centres_around(position, 1e-9)) for position in (2.4, 2.5, 2.5 + 1e-10)]
    [[1, 2], [2], [2]]
    """
    return range(math.floor(position - 0.5 + near), math.ceil(position - 0.5 - near) + 1)


def is_clear(costmap: Costmap, a: Point, b: Point, *, radius: float) -> bool:
    """Whether the straight piece a-b is within two by two cells and keeps a clearance.

    Parameters
    ----------
    costmap : Costmap
    a, b : tuple of float, x and y [cells]
    radius : float [m]
        Clearance, without any tolerance for rounding.
    """
    low, left = math.floor(min(a[1], b[1])), math.floor(min(a[0], b[0]))
    high, right = math.floor(max(a[1], b[1])), math.floor(max(a[0], b[0]))
    rows, cols = costmap.blocked.shape
    if low < 0 or left < 0 or high >= rows or right >= cols or max(high - low, right - left) > 1:
        return False
    if costmap.blocked[low : high + 1, left : right + 1].any():
        return False
    need = radius / costmap.window.resolution
    (ax, ay), (bx, by) = a, b
    return need <= 0 or segment_clearance(costmap.blocked, ax, ay, bx, by, need) >= need


class Ends(NamedTuple):
    """The cells at which searches begin and end.

    If start or goal is linked to no cell, no cell-to-cell route exists. Sources and targets are
    then both empty, so that the search ends immediately.
    """

    sources: Ints  #: shape (n, 3): row, column, cost from the start
    targets: Ints  #: shape (m, 3): row, column, cost to the goal
    direct: bool  #: the straight piece from start to goal is clear and thus the best route


def ends_of(costmap: Costmap, start: tuple[float, ...], goal: tuple[float, ...]) -> Ends:
    """Return the cells that start and goal are linked to.

    Parameters
    ----------
    costmap : Costmap
    start, goal : tuple of float
        x and y [m, map]; a yaw is ignored.
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
        x and y [m, map]; a yaw is ignored.
    cells : ndarray of int64, shape (k, 2)
        Row and column of the cells where the line begins, turns and ends, in order; can be empty.
    """
    centres = costmap.window.cell_to_world(cells.reshape(-1, 2))
    return merge_collinear(np.concatenate([[start[:2]], centres, [goal[:2]]]))


def _with_costs(costmap: Costmap, joined: Links) -> Ints:
    """Return row, column and cost of links: their lengths, weighted by the cost of their cell."""
    # Within the tolerance, a link may keep a clearance that the centre of its cell does not keep.
    on = costmap.traversable[tuple(joined.cells.T)]
    joined = Links(joined.cells[on], joined.lengths[on])
    extra = costmap.costs[tuple(joined.cells.T)] * (costmap.top / MAX_NON_OBSTACLE)
    lengths = joined.lengths / costmap.window.resolution * (1.0 + extra)
    return np.column_stack([joined.cells, np.rint(lengths * ONE).astype(np.int64)])
