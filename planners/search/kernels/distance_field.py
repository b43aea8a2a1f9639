"""Dijkstra's search over all cells, with buckets instead of a heap.

Every move costs at least `ONE`, and a bucket holds the cells whose cost so far is the same in whole
`ONE`s. Cells of one bucket then can't better each other, so they come out in any order, and each
cell is settled once: time is linear in the number of cells. As a cost so far is never further ahead
than the dearest move, the buckets are a ring. A bucket is a doubly linked list; a cell whose cost
falls moves to another.

The small functions are inlined: to hand over half a dozen arrays takes longer than they do.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Ints, Ints32
from planners.costmap.kernels.moves import COLS, ROWS
from planners.search.kernels.astar import FAR

ONE_BITS = 32  # ONE is 2**32
NO_CELL = -1
BUCKET, WAITING, SETTLED = range(3)  # entries of `state`
NEXT, PREVIOUS = range(2)  # columns of `chain`


@njit(cache=True, nogil=True)
def seed(
    width: int, sources: Ints, labels: Ints, chain: Ints32, heads: Ints32, state: Ints
) -> None:
    """Put the sources into their buckets.

    Parameters
    ----------
    width, labels, chain, heads, state
        As in `settle`.
    sources : ndarray of int64, shape (n, 3)
        Row, column and cost; each cell once.
    """
    for k in range(len(sources)):
        node = sources[k, 0] * width + sources[k, 1]
        _reach(node, sources[k, 2], labels, chain, heads, state)


@njit(cache=True, nogil=True)
def settle(
    moves: Bytes,
    costs: Bytes,
    steps: Ints,
    width: int,
    labels: Ints,
    chain: Ints32,
    heads: Ints32,
    state: Ints,
    budget: int,
) -> bool:
    """Settle up to `budget` cells, and return whether that was all.

    Parameters
    ----------
    moves : ndarray of uint8, shape (cells,)
        Allowed moves of every cell, as in `planners.search.kernels.astar`.
    costs : ndarray of uint8, shape (cells,)
        What each cell costs extra.
    steps : ndarray of int64, shape (2, 505)
        Cost of orthogonal and diagonal moves by the sum of the two cells' costs, `ONE` at least.
    width : int
        Cells in a row.
    labels : ndarray of int64, shape (cells,)
        Cost so far; `FAR` to begin with.
    chain : ndarray of int32, shape (cells, 2)
        Neighbours in the bucket's list.
    heads : ndarray of int32, shape (buckets,)
        First cell of each bucket; `NO_CELL` to begin with. One more bucket than the dearest move
        or source costs in whole `ONE`s, and one for the rest.
    state : ndarray of int64, shape (3,)
        Number of the bucket in hand, cells that wait, cells settled; zeros to begin with.
    """
    end = state[SETTLED] + budget
    while state[WAITING] > 0 and state[SETTLED] < end:
        node = heads[state[BUCKET] % len(heads)]
        if node == NO_CELL:
            state[BUCKET] += 1
            continue
        _leave(node, labels, chain, heads, state)
        state[SETTLED] += 1
        cost, allowed = labels[node], moves[node]
        for k in range(8):
            if (allowed >> k) & 1:
                to = node + ROWS[k] * width + COLS[k]
                reached = cost + steps[k & 1, np.int64(costs[node]) + costs[to]]
                if reached < labels[to]:
                    _reach(to, reached, labels, chain, heads, state)
    return bool(state[WAITING] == 0)


@njit(cache=True, nogil=True, inline="always")
def _reach(node: int, cost: int, labels: Ints, chain: Ints32, heads: Ints32, state: Ints) -> None:
    """Let a cell cost less than it did so far."""
    if labels[node] < FAR:
        _leave(node, labels, chain, heads, state)
    labels[node] = cost
    bucket = (cost >> ONE_BITS) % len(heads)
    first = heads[bucket]
    chain[node, NEXT], chain[node, PREVIOUS] = first, NO_CELL
    if first != NO_CELL:
        chain[first, PREVIOUS] = node
    heads[bucket] = node
    state[WAITING] += 1


@njit(cache=True, nogil=True, inline="always")
def _leave(node: int, labels: Ints, chain: Ints32, heads: Ints32, state: Ints) -> None:
    """Take a cell out of its bucket."""
    after, before = chain[node, NEXT], chain[node, PREVIOUS]
    if after != NO_CELL:
        chain[after, PREVIOUS] = before
    if before != NO_CELL:
        chain[before, NEXT] = after
    else:
        heads[(labels[node] >> ONE_BITS) % len(heads)] = after
    state[WAITING] -= 1
