"""Straight pieces that join a place to the cell centres around it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap import Costmap
from planners.kernels.clearance import segment_clearance
from planners.rounding import rounding_at, slack_at
from planners.wording import Point


class Links(NamedTuple):
    """The cells that a place is joined to."""

    cells: Ints  #: shape (n, 2): row, column
    lengths: Floats  #: shape (n,) [m]


def links(costmap: Costmap, xy: Point, *, radius: float) -> Links:
    """Return the pieces from a place to the up to four cell centres around it.

    As for moves, a piece must keep its clearance exactly, and cut no corner: the cells of the
    block that its ends span are not blocked.

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
    """Return the cells along an axis between whose centres a position lies: one or two.

    Parameters
    ----------
    position, near : float [cells]
        A position this near to a centre is at it.

    Examples
    --------
    >>> [list(centres_around(position, 1e-9)) for position in (2.4, 2.5, 2.5 + 1e-10)]
    [[1, 2], [2], [2]]
    """
    return range(math.floor(position - 0.5 + near), math.ceil(position - 0.5 - near) + 1)


def is_clear(costmap: Costmap, a: Point, b: Point, *, radius: float) -> bool:
    """Whether the straight piece a-b [cells], within two by two cells, can be driven.

    The radius [m] is kept to the last bit: what is put down to rounding is up to the caller.
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
