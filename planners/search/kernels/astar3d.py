"""A* over voxels, in slices, so that Python can check the clock in between.

Costs are the integers of `planners.search.kernels.astar`; a move through a voxel's corner costs
`SPACE`. Allowed moves are derived during the search from a mask of the 3 x 3 x 3 voxels around a
node, which holds a bit for each traversable one. Bits are numbered x first, then y, then z; bit 13
is the node itself, bit k the voxel that move k leads to. A move is allowed if every voxel of the
box that it spans is traversable.

About half of all moves are pruned. If move d led from p to n, move e from n to m is pruned if the
voxels around n allow a path from p to m that is shorter, or as long with a shorter last move (from
p to m directly, or by the two moves of the shortest path, the longer one first). Pruning preserves
optimality. Assume that all nodes nearer than m are reached at their least cost, and among the last
moves of all shortest paths to m, consider one of least length: from n into m. If it were pruned,
the other path would be as short and would reach m by a shorter last move, which contradicts the
choice. Costs are integers, so "as long" is exact.
"""

from __future__ import annotations

import itertools

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Ints, Ints32
from planners.costmap.kernels.moves import DIAGONAL, ONE
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
from planners.search.kernels.heap import drop_top, push, replace_top, top_node

SPACE = 7439101574  # round(sqrt(3) * ONE)
MARK, CLOSED, CAME, ROOT = 64, 32, 31, 13  # parts of a mark; ROOT: a source, which no move led to
EVERYWHERE, NEVER = 2**27 - 1, 2**27  # masks: all voxels are traversable; no voxel

#: Layer, row and column that each move adds; shape (27, 3).
STEPS = np.array(list(itertools.product((-1, 0, 1), repeat=3)), dtype=np.int64)
#: Cost of each move; shape (27,).
COSTS = np.array([0, ONE, DIAGONAL, SPACE], dtype=np.int64)[np.abs(STEPS).sum(axis=1)]


def _box(first: Ints, last: Ints) -> int:
    """Return the mask of the box between two voxels, each in [-1, 1]³."""
    low, high = np.minimum(first, last), np.maximum(first, last)
    inside = (np.clip(STEPS, low, high) == STEPS).all(axis=1)
    return int(sum(1 << int(k) for k in np.flatnonzero(inside)))


def _detour(arrival: int, move: int) -> int:
    """Return the mask of voxels that must be traversable to prune `move` after `arrival`."""
    before, after = -STEPS[arrival], STEPS[move]
    whole = after - before
    if ROOT in (arrival, move):
        return NEVER
    if np.abs(whole).max() < 2:
        return _box(before, after)
    # Both moves go along an axis of 2; the first move goes along an axis of 1.
    between = before + np.sign(whole)
    if (between == 0).all():
        return NEVER  # `move` itself is on the shortest path
    return _box(before, between) | _box(between, after)


NEEDS = np.array([_box(np.zeros(3, dtype=np.int64), step) for step in STEPS], dtype=np.int64)
DETOURS = np.array([[_detour(d, e) for e in range(27)] for d in range(27)], dtype=np.int64)


@njit(cache=True, nogil=True)
def estimate(layer: int, row: int, col: int, targets: Ints) -> int:
    """Return the smallest (26-connected distance to a target + its final cost); consistent.

    Parameters
    ----------
    layer, row, col : int
    targets : ndarray of int64, shape (n, 4)
        Layer, row, column and final cost of the voxels that are joined to the goal.
    """
    least = FAR
    for k in range(len(targets)):
        x, y, z = abs(col - targets[k, 2]), abs(row - targets[k, 1]), abs(layer - targets[k, 0])
        low, high = min(x, y, z), max(x, y, z)
        middle = x + y + z - low - high
        length = (high - middle) * ONE + (middle - low) * DIAGONAL + low * SPACE
        least = min(least, length + targets[k, 3])
    return least


@njit(cache=True, nogil=True)
def plates_of(traversable: Bools) -> Ints32:
    """Return which of the 3 x 3 voxels around each one, in its own layer, are traversable.

    Parameters
    ----------
    traversable : ndarray of bool, shape (layers, rows, cols)
        Its borders must be False.

    Returns
    -------
    ndarray of int32, shape (layers * rows * cols,)
        Masks of 9 bits, x first, then y.
    """
    layers, rows, cols = traversable.shape
    plates = np.zeros((layers, rows, cols), dtype=np.int32)
    for layer in range(layers):
        for row in range(1, rows - 1):
            for col in range(1, cols - 1):
                if traversable[layer, row, col]:
                    for k in range(9):
                        # From the neighbour, the voxel is in the opposite direction.
                        i, j = k // 3 - 1, k % 3 - 1
                        plates[layer, row - i, col - j] |= 1 << k
    return plates.ravel()


@njit(cache=True, nogil=True)
def seed(
    sources: Ints, targets: Ints, width: int, slab: int, mark: int, labels: Ints, heap: Ints
) -> int:
    """Put the sources on an empty heap and return its size.

    Parameters
    ----------
    sources, targets : ndarray of int64, shape (n, 4)
        Layer, row, column and cost of the voxels that are joined to the start, and to the goal.
    width, slab : int
        Voxels in a row, and in a layer.
    mark : int
        Mark of the sources.
    labels : ndarray of int64, shape (voxels, 2)
        Cost so far and mark of every voxel.
    heap : ndarray of int64, shape (room, 2)
    """
    size = 0
    for i in range(len(sources)):
        layer, row, col, cost = sources[i, 0], sources[i, 1], sources[i, 2], sources[i, 3]
        node = layer * slab + row * width + col
        labels[node, 0], labels[node, 1] = cost, mark
        h = estimate(layer, row, col, targets)
        size = push(heap, size, cost + h, h, node)
    return size


@njit(cache=True, nogil=True)
def advance(
    plates: Ints32,
    width: int,
    slab: int,
    targets: Ints,
    labels: Ints,
    query: int,
    heap: Ints,
    state: Ints,
    budget: int,
) -> int:
    """Expand up to `budget` nodes.

    Parameters
    ----------
    plates : ndarray of int32, shape (voxels,)
        From `plates_of`.
    width, slab : int
        Voxels in a row, and in a layer.
    targets : ndarray of int64, shape (n, 4)
        Layer, row, column and final cost of the voxels that are joined to the goal.
    labels : ndarray of int64, shape (voxels, 2)
        Per voxel the cost so far and a mark: 64 * query + 32 if closed + the move that led here
        (or `ROOT`). Marks below 64 * query are from earlier queries.
    query : int
        Number of this query, from 1.
    heap : ndarray of int64, shape (room, 2)
        Keyed by f = g + h; ties are broken by the smaller h.
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
        if expanded >= end or size + 26 > len(heap):
            status = SLICE_DONE if expanded >= end else HEAP_FULL
            break
        node = top_node(heap)
        if labels[node, 1] & CLOSED:  # expanded before, at a lower cost
            size = drop_top(heap, size)
            continue
        arrival = labels[node, 1] & CAME
        labels[node, 1] |= CLOSED
        expanded += 1
        cost = labels[node, 0]
        layer = node // slab
        row = (node - layer * slab) // width
        col = node - layer * slab - row * width
        for k in range(len(targets)):
            here = layer == targets[k, 0] and row == targets[k, 1] and col == targets[k, 2]
            if here and cost + targets[k, 3] < best:
                best = cost + targets[k, 3]
                state[TARGET] = node
        around = plates[node - slab] | (plates[node] << 9) | (plates[node + slab] << 18)
        on_top = True
        for k in range(27):
            if k == ROOT or not _is_useful(arrival, k, around):
                continue
            to = node + STEPS[k, 0] * slab + STEPS[k, 1] * width + STEPS[k, 2]
            reached = cost + COSTS[k]
            if labels[to, 1] < fresh or reached < labels[to, 0]:
                labels[to, 0], labels[to, 1] = reached, fresh + k
                h = estimate(layer + STEPS[k, 0], row + STEPS[k, 1], col + STEPS[k, 2], targets)
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
def _is_useful(arrival: int, move: int, around: int) -> bool:
    """Whether a move is allowed and not pruned."""
    if (around & NEEDS[move]) != NEEDS[move]:
        return False
    detour = DETOURS[arrival, move]
    return bool((around & detour) != detour)


@njit(cache=True, nogil=True)
def trace(labels: Ints, width: int, slab: int, node: int) -> Ints:
    """Return the voxels where the path to a node begins, turns and ends, last first.

    Parameters
    ----------
    labels : ndarray of int64, shape (voxels, 2)
        As in `advance`.
    width, slab, node : int
    """
    turns = [node]
    heading = labels[node, 1] & CAME
    while heading != ROOT:
        node -= STEPS[heading, 0] * slab + STEPS[heading, 1] * width + STEPS[heading, 2]
        before = labels[node, 1] & CAME
        if before != heading:
            turns.append(node)
        heading = before
    return np.array(turns, dtype=np.int64)
