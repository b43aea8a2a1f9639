"""A* over voxels, in slices, so that Python can check the clock in between.

Costs are the integers of `planners.search.kernels.voxel_moves`, which says which moves are allowed
and which are omitted. Whether a voxel is traversable is a bit. The label of a voxel is its cost so
far, times 64, plus a mark: 32 if the voxel is closed, plus the move that led to it; 0 before the
search reaches it. The system gives memory to labels that are written, and the next query clears
only these: `CHUNK` of them at a time, from a list of the chunks in which there are any.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Bytes, Ints
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
from planners.search.kernels.voxel_moves import (
    COSTS,
    EVERYWHERE,
    OPEN_COUNTS,
    OPEN_MOVES,
    ROOT,
    STEPS,
    around,
    estimate,
    is_useful,
)

MARK_BITS, CLOSED, CAME = 6, 32, 31  # of a label
CHUNK_BITS = 6
CHUNK = 1 << CHUNK_BITS  # labels that are cleared together: 512 bytes
USED = 4  # index in `state`


@njit(cache=True, nogil=True)
def seed(
    sources: Ints,
    targets: Ints,
    width: int,
    slab: int,
    labels: Ints,
    touched: Bools,
    chunks: Ints,
    heap: Ints,
    state: Ints,
) -> None:
    """Clear the labels of the last query, and put the sources on an empty heap.

    Parameters
    ----------
    sources, targets : ndarray of int64, shape (n, 4)
        Layer, row, column and cost of the voxels that are joined to the start, and to the goal.
    width, slab : int
        Voxels in a row, and in a layer.
    labels, touched, chunks, heap, state : ndarray
        As in `advance`.
    """
    for i in range(state[USED]):
        chunk = chunks[i]
        touched[chunk] = False
        labels[chunk * CHUNK : (chunk + 1) * CHUNK] = 0
    state[USED] = 0
    size = 0
    for i in range(len(sources)):
        layer, row, col, cost = sources[i, 0], sources[i, 1], sources[i, 2], sources[i, 3]
        node = layer * slab + row * width + col
        state[USED] = _set_label(node, cost, ROOT, labels, touched, chunks, state[USED])
        h = estimate(layer, row, col, targets)
        size = push(heap, size, cost + h, h, node)
    state[SIZE], state[BEST], state[TARGET], state[EXPANDED] = size, FAR, -1, 0


@njit(cache=True, nogil=True)
def advance(
    bits: Bytes,
    plane: int,
    stride: int,
    width: int,
    slab: int,
    targets: Ints,
    labels: Ints,
    touched: Bools,
    chunks: Ints,
    heap: Ints,
    state: Ints,
    budget: int,
) -> int:
    """Expand up to `budget` nodes.

    Parameters
    ----------
    bits : ndarray of uint8, shape (bytes,)
        Traversable voxels, from `bits_of`.
    plane, stride : int
        Bytes of a layer, and of a row.
    width, slab : int
        Voxels in a row, and in a layer.
    targets : ndarray of int64, shape (n, 4)
        Layer, row, column and final cost of the voxels that are joined to the goal.
    labels : ndarray of int64, shape (chunks * CHUNK,)
        Per voxel the cost so far and a mark, see above.
    touched : ndarray of bool, shape (chunks,)
        Chunks with labels.
    chunks : ndarray of int64, shape (chunks,)
        The list of these chunks, and room for others.
    heap : ndarray of int64, shape (room, 2)
        Keyed by f = g + h; ties are broken by the smaller h.
    state : ndarray of int64, shape (5,)
        Heap size, best total cost, its target, number of expanded nodes, length of the list.
    budget : int

    Returns
    -------
    int
        `FOUND`, `EXHAUSTED`, `SLICE_DONE`, or `HEAP_FULL` (call again with more room).
    """
    end = state[EXPANDED] + budget
    size, expanded, best, used = state[SIZE], state[EXPANDED], state[BEST], state[USED]
    status = EXHAUSTED
    while size > 0 and heap[0, 0] < best:  # no other open node can improve `best`
        if expanded >= end or size + 26 > len(heap):
            status = SLICE_DONE if expanded >= end else HEAP_FULL
            break
        node = top_node(heap)
        label = labels[node]
        if label & CLOSED:  # expanded before, at a lower cost
            size = drop_top(heap, size)
            continue
        labels[node] = label | CLOSED
        expanded += 1
        cost, arrival = label >> MARK_BITS, label & CAME
        layer = node // slab
        row = (node - layer * slab) // width
        col = node - layer * slab - row * width
        for k in range(len(targets)):
            here = layer == targets[k, 0] and row == targets[k, 1] and col == targets[k, 2]
            if here and cost + targets[k, 3] < best:
                best = cost + targets[k, 3]
                state[TARGET] = node
        mask = around(bits, plane, stride, layer, row, col)
        is_open = mask == EVERYWHERE
        on_top = True
        for i in range(OPEN_COUNTS[arrival] if is_open else 27):
            k = OPEN_MOVES[arrival, i] if is_open else i
            if not is_open and not is_useful(arrival, k, mask):
                continue
            to = node + STEPS[k, 0] * slab + STEPS[k, 1] * width + STEPS[k, 2]
            reached = cost + COSTS[k]
            if labels[to] == 0 or reached < labels[to] >> MARK_BITS:
                used = _set_label(to, reached, k, labels, touched, chunks, used)
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
    state[SIZE], state[EXPANDED], state[BEST], state[USED] = size, expanded, best, used
    return status


@njit(cache=True, nogil=True)
def _set_label(
    node: int, cost: int, move: int, labels: Ints, touched: Bools, chunks: Ints, used: int
) -> int:
    """Write the label of an open node, list its chunk, and return the length of the list."""
    labels[node] = (cost << MARK_BITS) | move
    chunk = node >> CHUNK_BITS
    if not touched[chunk]:
        touched[chunk] = True
        chunks[used] = chunk
        used += 1
    return used


@njit(cache=True, nogil=True)
def trace(labels: Ints, width: int, slab: int, node: int) -> Ints:
    """Return the voxels where the path to a node begins, turns and ends, last first.

    Parameters
    ----------
    labels : ndarray of int64, shape (chunks * CHUNK,)
        As in `advance`.
    width, slab, node : int
    """
    turns = [node]
    heading = labels[node] & CAME
    while heading != ROOT:
        node -= STEPS[heading, 0] * slab + STEPS[heading, 1] * width + STEPS[heading, 2]
        before = labels[node] & CAME
        if before != heading:
            turns.append(node)
        heading = before
    return np.array(turns, dtype=np.int64)
