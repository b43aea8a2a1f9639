"""Jump point search on an 8-connected grid of uniform costs; no corner is cut.

Of all equally short paths, jump point search (Harabor and Grastien 2011, 2014) follows those whose
diagonal steps come first. After a straight step, only the same heading is followed, unless there is
a wall beside the step's first cell and none beside its last: then no other path reaches the cell
beside the last one, and the one diagonally ahead, as cheaply, and the last cell is a *jump point*.
After a diagonal step, only the diagonal and the two straight headings beside it are followed.

Only sources, jump points and targets are labelled: straight jumps pass all other cells
(`planners.search.kernels.jps_jumps`). Diagonals are followed to their ends, with straight jumps
from their cells to both sides; these cells are not labelled either.

One parent per node suffices, although it decides which headings are followed. Assume that of two
equally good parents, the kept one prunes a step of a shortest path. Then this step is diagonal and
follows a straight run. Taken before the run, it gives an equally short path that ends in a straight
step, and no parent prunes a straight step of a shortest path. So every cell is still passed at its
least cost.

Nodes, moves, headings, costs and the status of a search are those of
`planners.search.kernels.astar`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Ints
from planners.costmap.kernels.moves import COLS, DIAGONAL, ONE, ROWS
from planners.search.kernels.astar import (
    BEST,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    ROOT,
    SIZE,
    SLICE_DONE,
    TARGET,
    estimate,
)
from planners.search.kernels.heap import drop_top, push, top_node
from planners.search.kernels.jps_jumps import Jumps, diagonal_jump, straight_jump

FRESH = 4  # entry of `state` after those of A*
MARK, CLOSED, CAME, FROM = 1 << 37, 1 << 36, 32, (1 << 32) - 1  # parts of a mark


@njit(cache=True, nogil=True)
def advance(
    moves: Bytes,
    jumps: Jumps,
    targets: Ints,
    labels: Ints,
    heap: Ints,
    state: Ints,
    budget: int,
) -> int:
    """Expand up to `budget` nodes.

    Parameters
    ----------
    moves : ndarray of uint8, shape (rows, cols)
        Allowed moves of every cell; none may leave the grid.
    jumps : ndarray of int, shape (words, 2) or (rows, cols, 8)
        The bitmap of stops, or the table of jumps.
    targets : ndarray of int64, shape (n, 3)
        Row, column and final cost of the cells that are joined to the goal.
    labels : ndarray of int64, shape (cells, 2)
        Per cell the cost so far and a mark: `MARK` times the query's number, `CLOSED` if closed,
        the last heading of the jump that led here (4 bits from bit `CAME`; `ROOT` for a source),
        and the node where the jump began (32 bits). Marks of earlier queries are less than `MARK`
        times the number, so labels need no reset between queries.
    heap : ndarray of int64, shape (room, 2)
        Keyed by f = g + h; ties are broken by the smaller h, that is, by the larger g.
    state : ndarray of int64, shape (5,)
        Heap size, best total cost, its target, number of expanded nodes, `MARK` times the number
        of the query (from 1).
    budget : int

    Returns
    -------
    int
        `FOUND`, `EXHAUSTED`, `SLICE_DONE`, or `HEAP_FULL` (call again with more room).
    """
    height, width = moves.shape
    size, best, expanded, fresh = state[SIZE], state[BEST], state[EXPANDED], state[FRESH]
    end = expanded + budget
    most = 8 * min(height, width) + 8  # entries of one node: two for each cell of four diagonals
    status = EXHAUSTED
    while size > 0 and heap[0, 0] < best:  # no other open node can improve `best`
        if expanded >= end or size + most > len(heap):
            status = SLICE_DONE if expanded >= end else HEAP_FULL
            break
        node = top_node(heap)
        size = drop_top(heap, size)
        mark = labels[node, 1]
        if mark & CLOSED:  # expanded before, at a lower cost
            continue
        labels[node, 1] = mark | CLOSED
        expanded += 1
        row = node // width
        col = node - row * width
        last_piece = final_cost(targets, row, col)
        if last_piece < best - labels[node, 0]:
            best, state[TARGET] = labels[node, 0] + last_piece, node
        wanted = headings(moves, row, col, (mark >> CAME) & 15)
        for k in range(8):
            r, c, cost, going = row, col, labels[node, 0], (wanted >> k) & 1 != 0
            # This loop is not a function of its own: passing all arrays costs more than a jump.
            while going:
                side = 0
                if k & 1:
                    n = diagonal_jump(moves, jumps, targets, r, c, k)
                    if n == 0:
                        break
                    side = 1 if n > 0 else 0  # 0: a target, which is labelled
                    n = abs(n)
                    r, c, cost = r + n * ROWS[k], c + n * COLS[k], cost + n * DIAGONAL
                going = side == 1
                for heading in range(k - side, k + side + 1, 2):
                    came = heading & 7
                    n = 0
                    if not came & 1:
                        n = straight_jump(moves, jumps, targets, r, c, came)
                        if n == 0:
                            continue
                    to_row, to_col = r + n * ROWS[came], c + n * COLS[came]
                    to, reached = to_row * width + to_col, cost + n * ONE
                    if labels[to, 1] < fresh or reached < labels[to, 0]:
                        labels[to, 0], labels[to, 1] = reached, fresh + (came << CAME) + node
                        h = estimate(to_row, to_col, targets)
                        size = push(heap, size, reached + h, h, to)
    state[SIZE], state[BEST], state[EXPANDED] = size, best, expanded
    return FOUND if status == EXHAUSTED and best < FAR else status


@njit(cache=True, nogil=True)
def final_cost(targets: Ints, row: int, col: int) -> int:
    """Return the final cost of a cell; `FAR` if it is not a target.

    Parameters
    ----------
    targets : ndarray of int64, shape (n, 3)
    row, col : int
    """
    for t in range(len(targets)):
        if row == targets[t, 0] and col == targets[t, 1]:
            return int(targets[t, 2])
    return FAR


@njit(cache=True, nogil=True)
def headings(moves: Bytes, row: int, col: int, came: int) -> int:
    """Return the headings to follow from a cell, as bits.

    Parameters
    ----------
    moves : ndarray of uint8, shape (rows, cols)
    row, col : int
    came : int
        Heading that led to the cell, or `ROOT`.
    """
    allowed = int(moves[row, col])
    if came == ROOT:
        return allowed
    left, right = (came + 1) & 7, (came + 7) & 7
    if came & 1:
        return allowed & (1 << left | 1 << came | 1 << right)
    opened = allowed & ~int(moves[row - ROWS[came], col - COLS[came]])
    wanted = 1 << came
    if (opened >> ((came + 2) & 7)) & 1:
        wanted |= 1 << left | 1 << ((came + 2) & 7)
    if (opened >> ((came + 6) & 7)) & 1:
        wanted |= 1 << right | 1 << ((came + 6) & 7)
    return allowed & wanted


@njit(cache=True, nogil=True)
def trace(labels: Ints, width: int, node: int) -> Ints:
    """Return the cells where the path to a node begins, turns and ends, last first.

    Parameters
    ----------
    labels : ndarray of int64, shape (cells, 2)
        As in `advance`.
    width, node : int
    """
    turns, after = [node], ROOT
    came = (labels[node, 1] >> CAME) & 15
    while came != ROOT:
        origin = labels[node, 1] & FROM
        while node != origin:  # at most a straight piece, and a diagonal before it
            rows, cols = node // width - origin // width, node % width - origin % width
            heading, n = came, abs(abs(rows) - abs(cols))
            if n == 0:
                heading, n = (2 - np.sign(cols) if rows > 0 else 6 + np.sign(cols)), abs(rows)
            if after not in (heading, ROOT):
                turns.append(node)
            after = heading
            node -= n * (ROWS[heading] * width + COLS[heading])
        came = (labels[node, 1] >> CAME) & 15
    if after != ROOT:
        turns.append(node)
    return np.array(turns, dtype=np.int64)
