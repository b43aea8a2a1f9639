"""Polyanya: shortest routes at any angle on a mesh of convex polygons, in slices.

A search node is a root (the last turning point), a cone of directions from it, and the side of a
polygon through which the cone leaves that polygon. It represents all lines whose last turn is at
the root and that cross the side within the cone. Its expansion visits the sides of the polygon
beyond. Sides within the cone are seen from the same root. If an end of the interval is a corner,
lines may turn there towards sides beside the cone.

A cone's rays are stored as differences of vertices and are never rounded to their intersections
with sides. With roots on the lattice, all decisions are exact, and cones that share a border share
it exactly.

Spurs (lines without area) and vertices where squares meet in one point only are crossed by point
nodes: a root with everything around it or, if a line arrived from one side, everything beyond.
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
        Number of nodes that one expansion makes at most.
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
        # A single successor is expanded next, without the heap.
        while True:
            made, root, side = state[COUNT], pool.places[node, 0], pool.places[node, 1]
            if (
                pool.cones[node, SOFAR] <= query.sofar[root]
            ):  # else a shorter line to its root is known
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
    """Put a node on the heap if it can improve the best line.

    Parameters
    ----------
    mesh, query, pool, state
        As in `advance`.
    node : int
    """
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
    """Return the roots on the line to a root, including itself, first to last.

    Parameters
    ----------
    came : ndarray of int64, shape (vertices,)
        The previous root of each root; -1 for sources.
    root : int
    """
    roots = [root]
    while came[root] >= 0:
        root = came[root]
        roots.append(root)
    return np.array(roots[::-1])
