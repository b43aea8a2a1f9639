"""ARA*: weighted A* whose next iteration, with a smaller weight, goes on where the last ended.

A cell waits while its cost is lower than when it was last expanded, or if it never was. Cells
that wait are in the heap, those already expanded in this iteration at its far end: they have to
wait for the next. Entries whose cell has been expanded since are out of date, and ignored.

A cell's label is its cost so far and a mark: 32 * turn + 16 if it waits + the bit of the move that
led here (or `ROOT`). Turns are counted on from query to query, so nothing needs clearing: `first`
is the query's first turn, and marks below it are of earlier queries; `turn` is the iteration's,
and what it expands gets it; what waits for it has an earlier one.
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

WAITS = 16  # the part of a mark that says so


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
    moves, costs, steps, width, targets, weight, heap, state, budget
        As `planners.search.kernels.astar.advance` takes them; the weight is `UNIT` or more.
    labels : ndarray of int64, shape (cells, 2)
        Per cell the cost so far and a mark, see above.
    first, turn : int
        Turns of the query and of this iteration, at least one apart.

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
                if h >= best - reached:  # no better route leads here
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
    """Key every cell that waits by a new weight, once, and drop what can't better the best route.

    Parameters
    ----------
    width, targets, weight, labels, heap, state
        As `advance` takes them.
    turn : int
        One after those in the labels, one before that of the next iteration.
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
            kept = push(heap, kept, cost + h, h, node)  # row i is read: the heap may grow over it
    state[SIZE] = kept


@njit(cache=True, nogil=True)
def least_total(width: int, targets: Ints, labels: Ints, heap: Ints, size: int) -> int:
    """Return the smallest cost so far + estimate of what waits; `FAR` if nothing does.

    A route better than the best leads through a cell that waits and whose cost is the least
    there is: no route costs less than this, unless the best does.
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
    """Take over the best of the routes that the marks describe now.

    Cells that were reached at lower costs after they were expanded have shortened it meanwhile.
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
    """Return what the goal costs from a cell; `FAR` if it isn't joined to it."""
    least = FAR
    for k in range(len(targets)):
        if row == targets[k, 0] and col == targets[k, 1]:
            least = min(least, targets[k, 2])
    return least


@njit(cache=True, nogil=True)
def _put(heap: Ints, size: int, key: int, tie: int, node: int, on_top: bool) -> int:
    """Insert one entry, in place of the smallest if that is done with; return the new size."""
    if on_top:
        replace_top(heap, size, key, tie, node)
        return size
    return int(push(heap, size, key, tie, node))
