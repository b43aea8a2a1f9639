"""How far cells are from the goal for a point that keeps away from what is blocked, grown lazily.

Dijkstra's algorithm on small integer costs (29 and 41 are a side and a diagonal, 0.03 % short of
the square root of 2) with a ring of buckets, each a doubly linked list of cells: a cell is in one
bucket at most, and moves between them in constant time (Dial 1969). The search stops when the cell
that was asked for is settled, and goes on from there when the next is asked for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Bytes, Ints, Ints32
from planners.costmap.kernels.moves import COLS, ROWS

SIDE, SLANT = 29, 41
DOUBT = 4  # a step on or off a cell that only may be wide enough counts as that many
BUCKETS = SLANT * DOUBT + 1
UNREACHED = np.iinfo(np.int32).max
LEVEL, QUEUED = range(2)  # entries of `state`


class Field(NamedTuple):
    """The distances found so far, and what is needed to go on."""

    moves: Bytes  #: shape (cells,); allowed moves of every cell, a bit each; none leaves the map
    narrow: Bools  #: shape (cells,); whether it only may be wide enough
    distances: Ints32  #: shape (cells,); final up to the level; `UNREACHED` where none was found
    links: Ints32  #: shape (cells + 1, 2); of queued cells, the next and the one before in its
    #: bucket, or -1; what is written to the last row, which is that of -1, is never read
    heads: Ints32  #: shape (BUCKETS,); the first cell of every bucket, or -1
    state: Ints  #: shape (2,); distance that the search has come to, and number of queued cells


@njit(cache=True, nogil=True)
def seed_field(field: Field, goal: int) -> None:
    """Begin at a goal's cell."""
    field.distances[:] = UNREACHED
    field.heads[:] = -1
    field.distances[goal] = 0
    field.links[goal] = -1
    field.heads[0] = goal
    field.state[LEVEL], field.state[QUEUED] = 0, 1


@njit(cache=True, nogil=True)
def distance_of(field: Field, width: int, cell: int) -> int:
    """Return the distance of a cell, growing the field until it is settled."""
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
    """Go on until a cell is settled, or none is left; return the new level and number of cells.

    Queueing is written out: as calls, it would cost more than all the rest.
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
