"""Polyanya: shortest routes at any angle on a mesh of convex polygons, in slices.

A search node is a root (the last turning point), a cone of directions from it, and the side of a
polygon through which the cone leaves that polygon: it stands for all lines that turn at the root
last and cross the side within the cone. To expand it is to look at the sides of the polygon
beyond. Those within the cone are seen by the same root. Where an end of the interval is a corner,
lines may turn there towards sides beside the cone.

A cone's rays are kept as differences of vertices and are never rounded to where they meet a side:
with roots on the lattice, all decisions are exact, and what shares a border shares it exactly.

Lines without area (spurs), and vertices where squares meet in a point only, are crossed by point
nodes: a root with all that lies around it, or, where a line came from one side, all beyond that.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Ints
from planners.costmap.kernels.moves import ONE
from planners.search.kernels.astar import (
    BEST,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    SIZE,
    SLICE_DONE,
)
from planners.search.kernels.heap import drop_top, push, top_node
from planners.search.kernels.polyanya_bound import away, through
from planners.search.kernels.polyanya_expand import from_interval, from_point
from planners.search.kernels.polyanya_jit import borrowing
from planners.search.kernels.polyanya_nodes import (
    COUNT,
    SCALE,
    SOFAR,
    PolyanyaQuery,
    Polygons,
    Pool,
    at,
    following,
)


@borrowing
def advance(
    mesh: Polygons, query: PolyanyaQuery, pool: Pool, state: Ints, spare: int, budget: int
) -> int:
    """Expand up to `budget` nodes.

    Parameters
    ----------
    mesh : Polygons
    query : PolyanyaQuery
    pool : Pool
    state : ndarray of int64, shape (6,)
        Heap size, least total cost as a key, its target, number of expanded nodes, number of
        nodes made, the last root on the best line.
    spare : int
        Nodes that one expansion makes at most.
    budget : int

    Returns
    -------
    int
        `FOUND`, `EXHAUSTED`, `SLICE_DONE`, or `HEAP_FULL` (call again with more room).
    """
    end = state[EXPANDED] + budget
    while state[SIZE] > 0 and pool.heap[0, 0] < state[BEST]:
        if state[EXPANDED] >= end:
            return SLICE_DONE
        if state[COUNT] + spare > len(pool.places):
            return HEAP_FULL
        node = top_node(pool.heap)
        state[SIZE] = drop_top(pool.heap, state[SIZE])
        # A node with a single successor hands over to it, without the heap.
        while True:
            made, root, side = state[COUNT], pool.places[node, 0], pool.places[node, 1]
            if pool.cones[node, SOFAR] <= query.sofar[root]:  # else its root was reached better
                state[EXPANDED] += 1
                if side < 0:
                    from_point(mesh, query, pool, state, root)
                else:
                    from_interval(mesh, query, pool, state, root, pool.cones[node], side)
            single = state[COUNT] == made + 1 and pool.places[made, 1] >= 0
            if not single or state[COUNT] + spare > len(pool.places):
                break
            node = made
        for new in range(made, state[COUNT]):
            enqueue(mesh, query, pool, state, new)
    return FOUND if state[BEST] < FAR else EXHAUSTED


@borrowing
def enqueue(mesh: Polygons, query: PolyanyaQuery, pool: Pool, state: Ints, node: int) -> None:
    """Put a node on the heap unless it can't better the best line."""
    root, side = pool.places[node, 0], pool.places[node, 1]
    x, y = at(mesh, root)
    if side < 0:
        h = math.inf
        for k in range(len(query.targets)):
            there = away(x, y, query.targets[k, 0], query.targets[k, 1]) + query.targets[k, 2]
            h = min(h, there)
    else:
        a, b = mesh.corners[side], mesh.corners[following(mesh, side)]
        (ax, ay), (bx, by) = at(mesh, a), at(mesh, b)
        h = through(x, y, pool.cones[node], ax, ay, bx, by, query.targets)
    key = int((pool.cones[node, SOFAR] + h) * SCALE)
    if key < state[BEST]:
        state[SIZE] = push(pool.heap, state[SIZE], key, int(h * ONE), node)


@njit(cache=True, nogil=True)
def trace(came: Ints, root: int) -> Ints:
    """Return the roots on the line to a root, itself included, first to last."""
    roots = [root]
    while came[root] >= 0:
        root = came[root]
        roots.append(root)
    return np.array(roots[::-1])
