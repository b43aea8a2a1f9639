"""Dijkstra's search over all cells, with buckets instead of a heap.

Every move costs at least `ONE`, and a bucket holds the cells of equal cost so far in whole `ONE`s.
Cells of one bucket cannot improve each other, so their order is arbitrary and each cell is settled
once: time is linear in the number of cells. Costs so far lie within the cost of the most expensive
move of the current bucket, so the buckets form a ring. A bucket is a doubly linked list; a cell
whose cost decreases moves to another bucket.

The small functions are inlined: passing half a dozen arrays takes longer than their work.
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
    width : int
        Cells in a row.
    sources : ndarray of int64, shape (n, 3)
        Row, column and cost; each cell at most once.
    labels, chain, heads, state
        As in `settle`.
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
    """Settle up to `budget` cells, and return whether all are settled.

    Parameters
    ----------
    moves : ndarray of uint8, shape (cells,)
        Allowed moves of every cell, as in `planners.search.kernels.astar`.
    costs : ndarray of uint8, shape (cells,)
        Costs of cells.
    steps : ndarray of int64, shape (2, 505)
        Cost of orthogonal and diagonal moves by the sum of the two cells' costs, `ONE` at least.
    width : int
        Cells in a row.
    labels : ndarray of int64, shape (cells,)
        Cost so far; initially `FAR`.
    chain : ndarray of int32, shape (cells, 2)
        Neighbours in the bucket's list.
    heads : ndarray of int32, shape (buckets,)
        First cell of each bucket; initially `NO_CELL`. The number of buckets is the cost of the
        most expensive move or source in whole `ONE`s, rounded down, plus 2.
    state : ndarray of int64, shape (3,)
        Number of the current bucket, of waiting cells and of settled cells; initially zeros.
    budget : int
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
    """Set a lower cost so far of a cell, and put it into its bucket."""
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
    """Remove a cell from its bucket."""
    after, before = chain[node, NEXT], chain[node, PREVIOUS]
    if after != NO_CELL:
        chain[after, PREVIOUS] = before
    if before != NO_CELL:
        chain[before, NEXT] = after
    else:
        heads[(labels[node] >> ONE_BITS) % len(heads)] = after
    state[WAITING] -= 1
