"""A* on an 8-connected grid, in slices, so that Python can check the clock in between.

Costs are the integers of `planners.costmap.kernels.moves`, multiplied by the costs of cells. Sums
are exact, a query and its reverse cost the same, and equal keys are ties (with floats, f = g + h of
equally good nodes differs in the last bit, which breaks tie-breaking). A move is rounded to 2^-32
of a cell; int64 holds paths of 2^31 cells of cost 0.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Ints
from planners.costmap.kernels.moves import COLS, DIAGONAL, ONE, ROWS
from planners.search.kernels.heap import drop_top, push, replace_top, top_node

MARK, CLOSED, CAME, ROOT = 32, 16, 15, 8  # parts of a mark; ROOT: a source, which no move led to

SLICE_DONE, FOUND, EXHAUSTED, HEAP_FULL = range(4)  # what `advance` returns
SIZE, BEST, TARGET, EXPANDED = range(4)  # entries of `state`
UNIT = 256  # weight 1 of the estimate: plain A*
FAR = np.iinfo(np.int64).max


@njit(cache=True, nogil=True)
def estimate(row: int, col: int, targets: Ints) -> int:
    """Return the smallest (octile distance to a target + its final cost).

    It is consistent: along a move, an octile distance changes by at most the cost of the move. The
    same holds after adding a constant, and for the minimum of several such functions.

    Parameters
    ----------
    row, col : int
    targets : ndarray of int64, shape (n, 3)
        Row, column and final cost of the cells that are joined to the goal.
    """
    least = FAR
    for k in range(len(targets)):
        rows, cols = abs(row - targets[k, 0]), abs(col - targets[k, 1])
        low, high = min(rows, cols), max(rows, cols)
        least = min(least, (high - low) * ONE + low * DIAGONAL + targets[k, 2])
    return least


@njit(cache=True, nogil=True)
def inflate(h: int, weight: int) -> int:
    """Return an estimate times a weight, divided first so that it cannot overflow.

    Parameters
    ----------
    h : int
        Estimate.
    weight : int
        In 1/256.
    """
    if weight == 0:
        return 0
    return h + (h >> 8) * (weight - UNIT)


@njit(cache=True, nogil=True)
def seed(
    sources: Ints, targets: Ints, weight: int, width: int, mark: int, labels: Ints, heap: Ints
) -> int:
    """Put the sources on an empty heap and return its size.

    Parameters
    ----------
    sources, targets : ndarray of int64, shape (n, 3)
        Row, column and cost of the cells that are joined to the start, and to the goal.
    weight : int
        Weight of the estimate, in 1/256.
    width : int
        Cells in a row.
    mark : int
        Mark of the sources.
    labels : ndarray of int64, shape (cells, 2)
        Cost so far and mark of every cell.
    heap : ndarray of int64, shape (room, 2)
    """
    size = 0
    for i in range(len(sources)):
        row, col, cost = sources[i, 0], sources[i, 1], sources[i, 2]
        node = row * width + col
        labels[node, 0], labels[node, 1] = cost, mark
        h = inflate(estimate(row, col, targets), weight)
        size = push(heap, size, cost + h, h, node)
    return size


@njit(cache=True, nogil=True)
def advance(
    moves: Bytes,
    costs: Bytes,
    steps: Ints,
    width: int,
    targets: Ints,
    weight: int,
    labels: Ints,
    query: int,
    heap: Ints,
    state: Ints,
    budget: int,
) -> int:
    """Expand up to `budget` nodes.

    Parameters
    ----------
    moves : ndarray of uint8, shape (cells,)
        Allowed moves of every cell, row by row; none may leave the grid.
    costs : ndarray of uint8, shape (cells,)
        Costs of cells, 0 to 252 for all that moves lead to.
    steps : ndarray of int64, shape (2, 505)
        Costs of orthogonal and of diagonal moves by the sum of their two cells' costs; at least
        `ONE` and `DIAGONAL`, which are those of sum 0.
    width : int
        Cells in a row.
    targets : ndarray of int64, shape (n, 3)
        Row, column and final cost of the cells that are joined to the goal.
    weight : int
        Weight of the estimate, in 1/256: 0 is Dijkstra's search and `UNIT` is A*; with a larger
        weight, a route costs at most weight / 256 times the least.
    labels : ndarray of int64, shape (cells, 2)
        Per cell the cost so far and a mark: 32 * query + 16 if closed + the bit of the move that
        led here (or `ROOT`). Marks below 32 * query are from earlier queries, so labels need no
        reset between queries.
    query : int
        Number of this query, from 1.
    heap : ndarray of int64, shape (room, 2)
        Keyed by f = g + weight · h; ties are broken by the smaller h, that is, by the larger g.
    state : ndarray of int64, shape (4,)
        Heap size, best total cost, its target, number of expanded nodes.
    budget : int

    Returns
    -------
    int
        `FOUND`, `EXHAUSTED`, `SLICE_DONE`, or `HEAP_FULL` (call again with more room).
    """
    fresh, end = MARK * query, state[EXPANDED] + budget
    size, expanded, best = state[SIZE], state[EXPANDED], state[BEST]
    status = EXHAUSTED
    while size > 0 and heap[0, 0] < best:  # no other open node can improve `best`
        if expanded >= end or size + 8 > len(heap):
            status = SLICE_DONE if expanded >= end else HEAP_FULL
            break
        node = top_node(heap)
        if labels[node, 1] & CLOSED:  # expanded before, at a lower cost
            size = drop_top(heap, size)
            continue
        labels[node, 1] |= CLOSED
        expanded += 1
        cost = labels[node, 0]
        row = node // width
        col = node - row * width
        for k in range(len(targets)):
            if row == targets[k, 0] and col == targets[k, 1] and cost + targets[k, 2] < best:
                best = cost + targets[k, 2]
                state[TARGET] = node
        allowed, on_top = moves[node], True
        for k in range(8):
            if (allowed >> k) & 1:
                to = node + ROWS[k] * width + COLS[k]
                reached = cost + steps[k & 1, int(costs[node]) + int(costs[to])]
                closed = labels[to, 1] & CLOSED != 0  # never reopened: the weight's bound holds
                if labels[to, 1] < fresh or (reached < labels[to, 0] and not closed):
                    labels[to, 0], labels[to, 1] = reached, fresh + k
                    h = inflate(estimate(row + ROWS[k], col + COLS[k], targets), weight)
                    if on_top:
                        replace_top(heap, size, reached + h, h, to)
                        on_top = False
                    else:
                        size = push(heap, size, reached + h, h, to)
        if on_top:
            size = drop_top(heap, size)
    if status == EXHAUSTED and best < FAR:
        status = FOUND
    state[SIZE], state[EXPANDED], state[BEST] = size, expanded, best
    return status


@njit(cache=True, nogil=True)
def trace(labels: Ints, width: int, node: int) -> Ints:
    """Return the cells where the path to a node begins, turns and ends, last first.

    Parameters
    ----------
    labels : ndarray of int64, shape (cells, 2)
        As in `advance`.
    width, node : int
    """
    turns = [node]
    heading = labels[node, 1] & CAME
    while heading != ROOT:
        node -= ROWS[heading] * width + COLS[heading]
        before = labels[node, 1] & CAME
        if before != heading:
            turns.append(node)
        heading = before
    return np.array(turns, dtype=np.int64)
