"""Slow twins of jump point search: SciPy on the graph of moves, and jumps cell by cell."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap.arrays import Bools, Ints
from oracles_planning import STEPS

Cell = tuple[int, int]


def least_cost(
    traversable: Bools, sources: Ints, targets: Ints, *, side: int, diagonal: int
) -> float:
    """Return the least source cost + way + target cost; inf if there is no way.

    The start is one more node, joined to the sources by what they cost, and so is the goal.
    """
    padded = np.pad(traversable, 1)
    start, goal = padded.size, padded.size + 1
    nodes = np.arange(padded.size).reshape(padded.shape)
    edges = []
    for i, j in STEPS:
        box = [np.roll(padded, (-a, -b), (0, 1)) for a in {0, i} for b in {0, j}]
        froms = nodes[np.all(box, axis=0)]
        tos = froms + i * padded.shape[1] + j
        edges.append(
            np.column_stack([froms, tos, np.full(len(froms), diagonal if i and j else side)])
        )
    for ends, outside in [(sources, start), (targets, goal)]:
        inside = nodes[ends[:, 0] + 1, ends[:, 1] + 1]
        pair = [np.full(len(ends), outside), inside]
        edges.append(np.column_stack([*(pair if outside == start else pair[::-1]), ends[:, 2]]))
    tails, heads, costs = np.concatenate(edges).T
    graph = coo_array((costs.astype(float), (tails, heads)), shape=(goal + 1, goal + 1)).tocsr()
    return float(dijkstra(graph, indices=start)[goal])


def stands(traversable: Bools, cell: Cell) -> bool:
    """Whether a cell is on the grid, and stands."""
    return all(0 <= i < n for i, n in zip(cell, traversable.shape, strict=True)) and bool(
        traversable[cell]
    )


def may_step(traversable: Bools, cell: Cell, step: Cell) -> bool:
    """Whether all cells of the box that a step spans stand."""
    (row, col), (i, j) = cell, step
    return all(stands(traversable, (row + a, col + b)) for a in {0, i} for b in {0, j})


def jump(traversable: Bools, cell: Cell, step: Cell) -> int:
    """Return the jump from a cell, one step at a time: n to stop after n, -n to hit the wall."""
    n, (i, j) = 0, step
    while may_step(traversable, cell, step):
        before, cell = cell, (cell[0] + i, cell[1] + j)
        n += 1
        if i and j:
            if jump(traversable, cell, (i, 0)) > 0 or jump(traversable, cell, (0, j)) > 0:
                return n
        elif any(
            stands(traversable, (cell[0] + a, cell[1] + b))
            and not stands(traversable, (before[0] + a, before[1] + b))
            for a, b in [(j, i), (-j, -i)]
        ):
            return n
    return -n
