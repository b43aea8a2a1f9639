"""D* Lite (Koenig & Likhachev 2002, its optimised version), from the goal to the robot's start.

Every cell has two costs to the goal: `g`, the result of its last expansion, and `rhs`, which
follows from the `g` of its neighbours. A cell where they differ waits in the heap, to be *lowered*
(g > rhs) or *raised* (g < rhs; a path through a neighbour is lost). Where a map changes, `touch`
recomputes `rhs`, and only affected cells are expanded again.

The search differs from the paper in two points, which preserve its result:

* Among equal f, cells to be raised come first, then those nearer to the start. The paper orders
  them by cost, and so expands all cells of the optimal f before it ends. Cells to be lowered may
  come in any order once no cell of that f waits to be raised: the neighbour that determines such a
  cell's `rhs` has no larger f, so if it waited too, it would have come first. For the same reason,
  the search ends when no waiting f is below the best cost, and none that equals it is a raise.
* No entry is removed from within the heap. Every waiting cell has an entry whose f is at most its
  own (the heuristic's shift `km` only makes old entries too small, as in the paper). An entry at
  the top is dropped if it is outdated, and inserted again if its f is too small.

The small functions are inlined: passing half a dozen arrays takes longer than their work.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Ints
from planners.costmap.kernels.moves import COLS, ROWS
from planners.search.kernels.astar import (
    BEST,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    SIZE,
    SLICE_DONE,
    estimate,
)
from planners.search.kernels.heap import TIE_SHIFT, drop_top, push, replace_top, top_node

SHIFT = 2  # entry of `state` in place of A*'s target: the paper's km
G, RHS = range(2)  # columns of `labels`
LOWER = 1 << TIE_SHIFT  # ties of cells to be lowered begin here; those to be raised have 0
MOST_TIE = (1 << 52) - 1 - LOWER


@njit(cache=True, nogil=True)
def advance(
    moves: Bytes,
    costs: Bytes,
    steps: Ints,
    width: int,
    sources: Ints,
    targets: Ints,
    labels: Ints,
    heap: Ints,
    state: Ints,
    budget: int,
) -> int:
    """Take up to `budget` entries from the heap.

    Parameters
    ----------
    moves : ndarray of uint8, shape (cells,)
        Allowed moves of every cell, as in `planners.search.kernels.astar`.
    costs : ndarray of uint8, shape (cells,)
        Costs of cells.
    steps : ndarray of int64, shape (2, 505)
        Cost of orthogonal and diagonal moves by the sum of the two cells' costs.
    width : int
        Cells in a row.
    sources, targets : ndarray of int64, shape (n, 3)
        Row, column and cost of the cells that are joined to the start, and to the goal.
    labels : ndarray of int64, shape (cells, 2)
        `G` and `RHS` of every cell; `FAR` for infinity.
    heap : ndarray of int64, shape (room, 2)
    state : ndarray of int64, shape (4,)
        Heap size, cost of the best route so far, shift of the heuristic, number of expanded nodes.
    budget : int

    Returns
    -------
    int
        `FOUND` (the best cost is final), `EXHAUSTED` (there is no route), `SLICE_DONE`, or
        `HEAP_FULL` (call again with more room).
    """
    best = best_of(sources, labels, width)
    status, taken = EXHAUSTED, 0
    while _goes_on(heap, state, best):
        if taken >= budget or state[SIZE] + 9 > len(heap):
            status = SLICE_DONE if taken >= budget else HEAP_FULL
            break
        taken += 1
        node, f = top_node(heap), heap[0, 0]
        g, rhs = labels[node, G], labels[node, RHS]
        own_f, tie = _key(node, width, g, rhs, sources, state[SHIFT])
        if g == rhs:
            state[SIZE] = drop_top(heap, state[SIZE])
        elif f < own_f:
            replace_top(heap, state[SIZE], own_f, tie, node)
        else:
            state[SIZE] = drop_top(heap, state[SIZE])
            state[EXPANDED] += 1
            if g > rhs:
                labels[node, G] = rhs
                _lower(moves, costs, steps, width, sources, labels, heap, state, node)
            else:
                labels[node, G] = FAR
                _raise(moves, costs, steps, width, sources, targets, labels, heap, state, node, g)
            if _joining_cost(sources, node, width) < FAR:
                best = best_of(sources, labels, width)
    state[BEST] = best
    return FOUND if status == EXHAUSTED and best < FAR else status


@njit(cache=True, nogil=True)
def touch(
    nodes: Ints,
    moves: Bytes,
    costs: Bytes,
    steps: Ints,
    width: int,
    sources: Ints,
    targets: Ints,
    labels: Ints,
    heap: Ints,
    state: Ints,
) -> None:
    """Recompute `rhs` of cells whose moves, costs or final cost changed.

    Parameters
    ----------
    nodes : ndarray of int64, shape (n,)
        Indices of cells. The heap must have room for as many entries.
    moves, costs, steps, width, sources, targets, labels, heap, state
        As in `advance`.
    """
    for node in nodes:
        rhs = _rhs(moves, costs, steps, width, targets, labels, node)
        _set_rhs(width, sources, labels, heap, state, node, rhs)


@njit(cache=True, nogil=True)
def compact(width: int, sources: Ints, labels: Ints, heap: Ints, state: Ints) -> None:
    """Drop the heap's outdated entries.

    Parameters
    ----------
    width, sources, labels, heap, state
        As in `advance`.
    """
    size = 0
    for i in range(state[SIZE]):
        node = heap[i, 1] & 0xFFFFFFFF
        g, rhs = labels[node, G], labels[node, RHS]
        own_f, tie = _key(node, width, g, rhs, sources, state[SHIFT])
        if g != rhs and heap[i, 0] <= own_f:
            size = push(heap, size, own_f, tie, node)
    state[SIZE] = size


@njit(cache=True, nogil=True)
def best_of(sources: Ints, labels: Ints, width: int) -> int:
    """Return the least cost from the start to the goal; `FAR` if there is no route.

    Parameters
    ----------
    sources, labels, width
        As in `advance`.
    """
    best = FAR
    for k in range(len(sources)):
        g = labels[sources[k, 0] * width + sources[k, 1], G]
        if g < FAR:
            best = min(best, sources[k, 2] + g)
    return best


@njit(cache=True, nogil=True)
def trace(
    moves: Bytes, costs: Bytes, steps: Ints, width: int, sources: Ints, targets: Ints, labels: Ints
) -> Ints:
    """Return the cells where the best path begins, turns and ends, after a search that found one.

    Among equally good neighbours, the one straight ahead is chosen.

    Parameters
    ----------
    moves, costs, steps, width, sources, targets, labels
        As in `advance`.
    """
    best, node = best_of(sources, labels, width), 0
    for k in range(len(sources)):
        source = sources[k, 0] * width + sources[k, 1]
        if labels[source, G] == best - sources[k, 2]:
            node = source
    turns = [node]
    heading = -1
    while labels[node, G] != _joining_cost(targets, node, width):
        onward = -1
        for k in range(8):
            if (moves[node] >> k) & 1:
                to = node + ROWS[k] * width + COLS[k]
                if labels[to, G] == labels[node, G] - _cost(costs, steps, node, to, k) and (
                    onward < 0 or k == heading
                ):
                    onward = k
        if onward != heading and heading >= 0:
            turns.append(node)
        node += ROWS[onward] * width + COLS[onward]
        heading = onward
    if heading >= 0:
        turns.append(node)
    return np.array(turns, dtype=np.int64)


@njit(cache=True, nogil=True, inline="always")
def _goes_on(heap: Ints, state: Ints, best: int) -> bool:
    """Whether a waiting entry can lower `best` or raise it."""
    if state[SIZE] == 0:
        return False
    if best == FAR:
        return True
    bound = best + state[SHIFT]
    return bool(heap[0, 0] < bound or (heap[0, 0] == bound and heap[0, 1] >> 32 == 0))


@njit(cache=True, nogil=True, inline="always")
def _key(node: int, width: int, g: int, rhs: int, sources: Ints, shift: int) -> tuple[int, int]:
    """Return f and tie of a cell; both 0 if g and rhs are equal."""
    if g == rhs:
        return 0, 0
    row = node // width
    h = estimate(row, node - row * width, sources)
    return min(g, rhs) + h + shift, 0 if g < rhs else LOWER + min(h, MOST_TIE)


@njit(cache=True, nogil=True, inline="always")
def _cost(costs: Bytes, steps: Ints, a: int, b: int, k: int) -> int:
    return int(steps[k & 1, np.int64(costs[a]) + costs[b]])


@njit(cache=True, nogil=True, inline="always")
def _joining_cost(ends: Ints, node: int, width: int) -> int:
    """Return the cost of the piece that joins a cell to start or goal: `FAR` if there is none."""
    cost = FAR
    for k in range(len(ends)):
        if ends[k, 0] * width + ends[k, 1] == node:
            cost = min(cost, ends[k, 2])
    return cost


@njit(cache=True, nogil=True, inline="always")
def _rhs(
    moves: Bytes, costs: Bytes, steps: Ints, width: int, targets: Ints, labels: Ints, node: int
) -> int:
    rhs, allowed = _joining_cost(targets, node, width), moves[node]
    for k in range(8):
        if (allowed >> k) & 1:
            to = node + ROWS[k] * width + COLS[k]
            if labels[to, G] < FAR:
                rhs = min(rhs, labels[to, G] + _cost(costs, steps, node, to, k))
    return rhs


@njit(cache=True, nogil=True, inline="always")
def _set_rhs(
    width: int, sources: Ints, labels: Ints, heap: Ints, state: Ints, node: int, rhs: int
) -> None:
    """Set a cell's `rhs`, and push the cell if it waits and has no entry of an f as small."""
    g, before = labels[node, G], labels[node, RHS]
    labels[node, RHS] = rhs
    if g != rhs and (g == before or min(g, rhs) < min(g, before)):
        f, tie = _key(node, width, g, rhs, sources, state[SHIFT])
        state[SIZE] = push(heap, state[SIZE], f, tie, node)


@njit(cache=True, nogil=True, inline="always")
def _lower(
    moves: Bytes,
    costs: Bytes,
    steps: Ints,
    width: int,
    sources: Ints,
    labels: Ints,
    heap: Ints,
    state: Ints,
    node: int,
) -> None:
    """Update the neighbours after a decrease of `g`."""
    g, allowed = labels[node, G], moves[node]
    for k in range(8):
        if (allowed >> k) & 1:
            to = node + ROWS[k] * width + COLS[k]
            rhs = g + _cost(costs, steps, node, to, k)
            if rhs < labels[to, RHS]:
                _set_rhs(width, sources, labels, heap, state, to, rhs)


@njit(cache=True, nogil=True, inline="always")
def _raise(
    moves: Bytes,
    costs: Bytes,
    steps: Ints,
    width: int,
    sources: Ints,
    targets: Ints,
    labels: Ints,
    heap: Ints,
    state: Ints,
    node: int,
    lost: int,
) -> None:
    """Recompute `rhs` of the neighbours whose `rhs` came from the former `g`, which is `lost`."""
    if labels[node, RHS] < FAR:
        f, tie = _key(node, width, FAR, labels[node, RHS], sources, state[SHIFT])
        state[SIZE] = push(heap, state[SIZE], f, tie, node)
    allowed = moves[node]
    for k in range(8):
        if (allowed >> k) & 1:
            to = node + ROWS[k] * width + COLS[k]
            if labels[to, RHS] == lost + _cost(costs, steps, node, to, k):
                rhs = _rhs(moves, costs, steps, width, targets, labels, to)
                _set_rhs(width, sources, labels, heap, state, to, rhs)
