"""ARA*: weighted A* whose next iteration, with a smaller weight, continues the previous one.

A cell waits if its cost decreased after its last expansion, or if it was never expanded. Cells that
wait are in the heap; those that were already expanded in this iteration are at its far end and wait
for the next iteration. Entries whose cell was expanded meanwhile are outdated and are skipped.

A cell's label is its cost so far and a mark: 32 * turn + 16 if it waits + the bit of the move that
led here (or `ROOT`). Turns increase from query to query, so labels need no reset. `first` is the
query's first turn; lower marks are from earlier queries. `turn` is the iteration's: cells that it
expands get this turn, and cells that wait for it have an earlier one.
"""

from __future__ import annotations

from numba import njit

from groundmap.arrays import Bytes, Ints
from planners.costmap.kernels.moves import COLS, ROWS
from planners.search.kernels.astar import (
    BEST,
    CAME,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    MARK,
    ROOT,
    SIZE,
    SLICE_DONE,
    TARGET,
    estimate,
    inflate,
)
from planners.search.kernels.heap import drop_top, push, replace_top, top_node

WAITS = 16  # part of a mark: the cell waits


@njit(cache=True, nogil=True)
def advance(
    moves: Bytes,
    costs: Bytes,
    steps: Ints,
    width: int,
    targets: Ints,
    weight: int,
    labels: Ints,
    first: int,
    turn: int,
    heap: Ints,
    state: Ints,
    budget: int,
) -> int:
    """Expand up to `budget` nodes of an iteration.

    Parameters
    ----------
    moves, costs, steps, width, targets, weight
        As in `planners.search.kernels.astar.advance`; the weight is `UNIT` or more.
    labels : ndarray of int64, shape (cells, 2)
        Cost so far and mark of every cell.
    first, turn : int
        Turns of the query and of this iteration, at least one apart.
    heap, state, budget
        As in `planners.search.kernels.astar.advance`.

    Returns
    -------
    int
        `FOUND` (no route costs less than `state[BEST]` / weight), `EXHAUSTED` (there is none),
        `SLICE_DONE`, or `HEAP_FULL` (call again with more room).
    """
    fresh, now, end = MARK * first, MARK * turn, state[EXPANDED] + budget
    size, expanded, best = state[SIZE], state[EXPANDED], state[BEST]
    status = EXHAUSTED
    while size > 0 and heap[0, 0] < best:
        if expanded >= end or size + 8 > len(heap):
            status = SLICE_DONE if expanded >= end else HEAP_FULL
            break
        node = top_node(heap)
        if labels[node, 1] >= now or labels[node, 1] & WAITS == 0:
            size = drop_top(heap, size)
            continue
        labels[node, 1] = now | (labels[node, 1] & CAME)
        expanded += 1
        cost = labels[node, 0]
        row = node // width
        col = node - row * width
        final = _final_cost(row, col, targets)
        if final < best - cost:
            best = cost + final
            state[TARGET] = node
        allowed, on_top = moves[node], True
        for k in range(8):
            if (allowed >> k) & 1:
                to = node + ROWS[k] * width + COLS[k]
                reached = cost + steps[k & 1, int(costs[node]) + int(costs[to])]
                mark = labels[to, 1]
                if mark >= fresh and reached >= labels[to, 0]:
                    continue
                h = estimate(row + ROWS[k], col + COLS[k], targets)
                if h >= best - reached:  # no better route leads through this cell
                    continue
                labels[to, 0] = reached
                if mark >= now:
                    labels[to, 1] = now | WAITS | k
                    if mark & WAITS == 0:
                        size = push(heap, size, FAR, 0, to)
                    continue
                labels[to, 1] = (now - MARK) | WAITS | k
                h = inflate(h, weight)
                size = _put(heap, size, reached + h, h, to, on_top)
                on_top = False
        if on_top:
            size = drop_top(heap, size)
    if status == EXHAUSTED and best < FAR:
        status = FOUND
    state[SIZE], state[EXPANDED], state[BEST] = size, expanded, best
    return status


@njit(cache=True, nogil=True)
def reopen(
    width: int, targets: Ints, weight: int, labels: Ints, turn: int, heap: Ints, state: Ints
) -> None:
    """Rebuild the heap with a new weight: each waiting cell once, unless it cannot improve `best`.

    Parameters
    ----------
    width, targets, weight, labels
        As in `advance`.
    turn : int
        One after the last turn in the labels, one before that of the next iteration.
    heap, state
        As in `advance`.
    """
    kept = 0
    for i in range(state[SIZE]):
        node = heap[i, 1] & 0xFFFFFFFF
        mark = labels[node, 1]
        if mark >= MARK * turn or mark & WAITS == 0:
            continue
        row = node // width
        cost, h = labels[node, 0], estimate(row, node - row * width, targets)
        if h < state[BEST] - cost:
            labels[node, 1] = MARK * turn | WAITS | (mark & CAME)
            h = inflate(h, weight)
            kept = push(heap, kept, cost + h, h, node)  # row i was read and may be overwritten
    state[SIZE] = kept


@njit(cache=True, nogil=True)
def least_total(width: int, targets: Ints, labels: Ints, heap: Ints, size: int) -> int:
    """Return the smallest (cost so far + estimate) of all waiting cells; `FAR` if there is none.

    A route better than the best one leads through a waiting cell whose cost so far is final. So
    this is a lower bound on the cost of all routes, unless the best one costs less.

    Parameters
    ----------
    width, targets, labels, heap
        As in `advance`.
    size : int
        Number of heap entries.
    """
    least = FAR
    for i in range(size):
        node = heap[i, 1] & 0xFFFFFFFF
        if labels[node, 1] & WAITS:
            row = node // width
            least = min(least, labels[node, 0] + estimate(row, node - row * width, targets))
    return least


@njit(cache=True, nogil=True)
def settle(
    costs: Bytes,
    steps: Ints,
    width: int,
    targets: Ints,
    labels: Ints,
    first: int,
    state: Ints,
) -> None:
    """Update the best route in `state` to the best one that the marks describe now.

    It may have become shorter, as cells were reached at lower costs after their expansion.

    Parameters
    ----------
    costs, steps, width, targets, labels, first, state
        As in `advance`.
    """
    for k in range(len(targets)):
        target = targets[k, 0] * width + targets[k, 1]
        if labels[target, 1] < MARK * first:
            continue
        node, total = target, targets[k, 2]
        heading = labels[node, 1] & CAME
        while heading != ROOT:
            before = node - (ROWS[heading] * width + COLS[heading])
            total += steps[heading & 1, int(costs[before]) + int(costs[node])]
            node = before
            heading = labels[node, 1] & CAME
        total += labels[node, 0]
        if total < state[BEST]:
            state[BEST], state[TARGET] = total, target


@njit(cache=True, nogil=True)
def _final_cost(row: int, col: int, targets: Ints) -> int:
    """Return the cost from a cell to the goal; `FAR` if the cell is not joined to the goal."""
    least = FAR
    for k in range(len(targets)):
        if row == targets[k, 0] and col == targets[k, 1]:
            least = min(least, targets[k, 2])
    return least


@njit(cache=True, nogil=True)
def _put(heap: Ints, size: int, key: int, tie: int, node: int, on_top: bool) -> int:
    """Insert one entry, in place of the smallest if it is `on_top`; return the new size."""
    if on_top:
        replace_top(heap, size, key, tie, node)
        return size
    return int(push(heap, size, key, tie, node))
