"""Distances to the goal for a point that keeps clearance from blocked cells, computed lazily.

Dijkstra's algorithm on small integer costs (29 for a side and 41 for a diagonal, whose ratio is
0.03 % below the square root of 2) with a ring of buckets, each a doubly linked list of cells: a
cell is in at most one bucket, and moves between buckets in constant time (Dial 1969). The search
stops when the requested cell is settled, and continues from there with the next request.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Bytes, Ints, Ints32
from planners.costmap.kernels.moves import COLS, ROWS

SIDE, SLANT = 29, 41
DOUBT = 4  # factor on a step to or from a narrow cell
BUCKETS = SLANT * DOUBT + 1
UNREACHED = np.iinfo(np.int32).max
LEVEL, QUEUED = range(2)  # entries of `state`


class Field(NamedTuple):
    """The distances found so far, and the state of the search."""

    moves: Bytes  #: shape (cells,); allowed moves of every cell, a bit each; none leaves the map
    narrow: Bools  #: shape (cells,); the centre is not wide enough, other points may be
    distances: Ints32  #: shape (cells,); final up to the level; initially `UNREACHED`
    links: Ints32  #: shape (cells + 1, 2); next and previous cell in a queued cell's bucket,
    #: or -1; the last row, to which -1 refers, is written but never read
    heads: Ints32  #: shape (BUCKETS,); first cell of every bucket, or -1
    state: Ints  #: shape (2,); distance that the search has reached, number of queued cells


@njit(cache=True, nogil=True)
def seed_field(field: Field, goal: int) -> None:
    """Reset a field for another goal.

    Parameters
    ----------
    field : Field
    goal : int
        Index of the goal's cell.
    """
    field.distances[:] = UNREACHED
    field.heads[:] = -1
    field.distances[goal] = 0
    field.links[goal] = -1
    field.heads[0] = goal
    field.state[LEVEL], field.state[QUEUED] = 0, 1


@njit(cache=True, nogil=True)
def distance_of(field: Field, width: int, cell: int) -> int:
    """Return the distance of a cell, after continuing the search until it is settled.

    Parameters
    ----------
    field : Field
    width : int
        Cells in a row.
    cell : int

    Returns
    -------
    int
        In units of 1/29 cell; `UNREACHED` if there is no path.
    """
    moves, narrow, distances = field.moves, field.narrow, field.distances
    level, queued = field.state
    if distances[cell] > level and queued > 0:
        level, queued = _grow(
            moves, narrow, distances, field.links, field.heads, width, level, queued, cell
        )
        field.state[LEVEL], field.state[QUEUED] = level, queued
    return int(distances[cell])


@njit(cache=True, nogil=True)
def _grow(
    moves: Bytes,
    narrow: Bools,
    distances: Ints32,
    links: Ints32,
    heads: Ints32,
    width: int,
    level: int,
    queued: int,
    cell: int,
) -> tuple[int, int]:
    """Search until a cell is settled or the queue is empty; return the new level and queue size.

    The queue operations are written inline, as calls would take most of the time.
    """
    while distances[cell] > level and queued > 0:
        node = heads[level % BUCKETS]
        if node < 0:
            level += 1
            continue
        after = links[node, 0]
        heads[level % BUCKETS] = after
        links[after, 1] = -1
        queued -= 1
        for k in range(8):
            if not (moves[node] >> k) & 1:
                continue
            to = node + ROWS[k] * width + COLS[k]
            step = SLANT if k & 1 else SIDE
            if narrow[node] or narrow[to]:
                step *= DOUBT
            reached = level + step
            if reached >= distances[to]:
                continue
            if distances[to] == UNREACHED:
                queued += 1
            else:
                after, before = links[to, 0], links[to, 1]
                links[after, 1] = before
                if before >= 0:
                    links[before, 0] = after
                else:
                    heads[distances[to] % BUCKETS] = after
            distances[to] = reached
            first = heads[reached % BUCKETS]
            links[to, 0], links[to, 1] = first, -1
            links[first, 1] = to
            heads[reached % BUCKETS] = to
    return level, queued
