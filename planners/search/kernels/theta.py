"""Theta* and Lazy Theta*: A* over the grid's moves, with parents that need not be neighbours.

Costs are lengths in cells as floats, since lengths at any angle have no exact sums. The heap stores
them as integers in units of 2^-32 cells.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Floats, Ints
from planners.costmap.kernels.moves import COLS, ONE, ROWS
from planners.search.kernels.astar import (
    BEST,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    SIZE,
    SLICE_DONE,
    TARGET,
)
from planners.search.kernels.heap import drop_top, push, top_node
from planners.search.kernels.sight import sight


@njit(cache=True, nogil=True)
def distance(row: int, col: int, to_row: int, to_col: int) -> float:
    """Return the distance between the centres of two cells [cells].

    Parameters
    ----------
    row, col, to_row, to_col : int
    """
    return math.sqrt(float((row - to_row) ** 2 + (col - to_col) ** 2))


@njit(cache=True, nogil=True)
def straight_estimate(row: int, col: int, targets: Floats) -> float:
    """Return the smallest (distance to a target + its final cost) [cells].

    Parameters
    ----------
    row, col : int
    targets : ndarray, shape (n, 3)
        Row, column and final cost [cells].
    """
    least = math.inf
    for k in range(len(targets)):
        there = distance(row, col, int(targets[k, 0]), int(targets[k, 1])) + targets[k, 2]
        least = min(least, there)
    return least


@njit(cache=True, nogil=True)
def seed(
    sources: Floats,
    targets: Floats,
    width: int,
    costs: Floats,
    marks: Ints,
    query: int,
    heap: Ints,
) -> int:
    """Put the sources, which are their own parents, on an empty heap and return its size.

    Parameters
    ----------
    sources, targets : ndarray, shape (n, 3)
        Row, column and cost [cells] of the cells that are joined to the start, and to the goal.
    width : int
        Cells in a row.
    costs, marks, query, heap
        As in `advance`.
    """
    size = 0
    for i in range(len(sources)):
        row, col = int(sources[i, 0]), int(sources[i, 1])
        node = row * width + col
        costs[node] = sources[i, 2]
        marks[node, 0], marks[node, 1] = 2 * query, node
        h = straight_estimate(row, col, targets)
        size = push(heap, size, _key(costs[node] + h), _key(h), node)
    return size


@njit(cache=True, nogil=True)
def advance(
    moves: Bytes,
    targets: Floats,
    lazy: bool,
    costs: Floats,
    marks: Ints,
    query: int,
    heap: Ints,
    state: Ints,
    budget: int,
) -> int:
    """Expand up to `budget` nodes.

    Parameters
    ----------
    moves : ndarray of uint8, shape (rows, cols)
        Allowed moves of every cell, as in `planners.search.kernels.astar`.
    targets : ndarray, shape (n, 3)
        Row, column and final cost [cells] of the cells that are joined to the goal.
    lazy : bool
        Whether to check the line of sight to a node's parent only at the node's expansion.
    costs : ndarray, shape (cells,) [cells]
        Length of the line that leads to each cell.
    marks : ndarray of int64, shape (cells, 2)
        2 * query, plus 1 if closed, and the parent; a source is its own. Marks below 2 * query
        are from earlier queries, so they need no reset.
    query : int
        Number of this query, from 1.
    heap : ndarray of int64, shape (room, 2)
        Keyed by f = g + h; ties are broken by the smaller h.
    state : ndarray of int64, shape (4,)
        Heap size, least total cost as a key, its target, number of expanded nodes.
    budget : int

    Returns
    -------
    int
        `FOUND`, `EXHAUSTED`, `SLICE_DONE`, or `HEAP_FULL` (call again with more room).
    """
    width, end = moves.shape[1], state[EXPANDED] + budget
    while state[SIZE] > 0 and heap[0, 0] < state[BEST]:
        if state[EXPANDED] >= end:
            return SLICE_DONE
        if state[SIZE] + 8 > len(heap):
            return HEAP_FULL
        node = top_node(heap)
        state[SIZE] = drop_top(heap, state[SIZE])
        if marks[node, 0] == 2 * query + 1:  # expanded before, at a lower cost
            continue
        if lazy:
            _settle(moves, costs, marks, query, node)
        marks[node, 0] = 2 * query + 1
        state[EXPANDED] += 1
        row, col = node // width, node % width
        for k in range(len(targets)):
            total = _key(costs[node] + targets[k, 2])
            if row == targets[k, 0] and col == targets[k, 1] and total < state[BEST]:
                state[BEST], state[TARGET] = total, node
        for k in range(8):
            if (moves[row, col] >> k) & 1:
                _relax(moves, targets, lazy, costs, marks, query, heap, state, node, k)
    return FOUND if state[BEST] < FAR else EXHAUSTED


@njit(cache=True, nogil=True)
def parents(marks: Ints, node: int) -> Ints:
    """Return the cells where the line to a node begins, turns and ends, last first.

    Parameters
    ----------
    marks : ndarray of int64, shape (cells, 2)
        As in `advance`.
    node : int
    """
    turns = [node]
    while marks[node, 1] != node:
        node = marks[node, 1]
        turns.append(node)
    return np.array(turns, dtype=np.int64)


@njit(cache=True, nogil=True)
def _relax(
    moves: Bytes,
    targets: Floats,
    lazy: bool,
    costs: Floats,
    marks: Ints,
    query: int,
    heap: Ints,
    state: Ints,
    node: int,
    k: int,
) -> None:
    """Reach a neighbour from the node's parent if the line of sight is free, else from the node."""
    width = moves.shape[1]
    row, col = node // width + ROWS[k], node % width + COLS[k]
    to = row * width + col
    if marks[to, 0] == 2 * query + 1:
        return
    parent = marks[node, 1]
    if not lazy and not sight(moves, parent // width, parent % width, row, col):
        parent = node
    reached = costs[parent] + distance(parent // width, parent % width, row, col)
    if marks[to, 0] < 2 * query or reached < costs[to]:
        costs[to] = reached
        marks[to, 0], marks[to, 1] = 2 * query, parent
        h = straight_estimate(row, col, targets)
        state[SIZE] = push(heap, state[SIZE], _key(reached + h), _key(h), to)


@njit(cache=True, nogil=True)
def _settle(moves: Bytes, costs: Floats, marks: Ints, query: int, node: int) -> None:
    """Replace a parent without line of sight to the node by the best closed neighbour."""
    width, parent = moves.shape[1], marks[node, 1]
    row, col = node // width, node % width
    if parent == node or sight(moves, parent // width, parent % width, row, col):
        return
    costs[node] = math.inf
    for k in range(8):
        beside = node + ROWS[k] * width + COLS[k]
        if (moves[row, col] >> k) & 1 and marks[beside, 0] == 2 * query + 1:
            reached = costs[beside] + math.sqrt(float(ROWS[k] ** 2 + COLS[k] ** 2))
            if reached < costs[node]:
                costs[node] = reached
                marks[node, 1] = beside


@njit(cache=True, nogil=True)
def _key(length: float) -> int:
    return int(length * ONE)
