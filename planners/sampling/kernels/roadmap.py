"""The cheapest path through a roadmap: A* over a graph in compressed sparse rows."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints
from planners.search.kernels.heap import drop_top, push, top_node

UNIT = 2.0**20  # the heap's integer keys per unit of cost


@njit(cache=True, nogil=True)
def cheapest_path(
    first: Ints,
    heads: Ints,
    costs: Floats,
    places: Floats,
    rate: float,
    goal: Floats,
    sources: Ints,
    source_costs: Floats,
    target_costs: Floats,
) -> Ints:
    """Return the vertices of the cheapest path from any source to any target.

    Parameters
    ----------
    first : ndarray of int64, shape (n + 1,)
        Edges first[v] to first[v + 1] leave vertex v.
    heads : ndarray of int64, shape (m,)
        Vertices at which the edges end.
    costs : ndarray, shape (m,)
        Of the edges; infinite for blocked ones.
    places : ndarray, shape (n, 2) [m, corner]
        Of the vertices.
    rate : float [1/m]
        Lower bound of an edge's cost per metre between its ends.
    goal : ndarray, shape (2,) [m, corner]
    sources : ndarray of int64, shape (k,)
        First vertices of a path.
    source_costs : ndarray, shape (k,)
        From the start to the sources.
    target_costs : ndarray, shape (n,)
        From a vertex to the goal; infinite if it is no target.

    Returns
    -------
    ndarray of int64, shape (j,)
        Empty if there is no path.
    """
    count = len(places)
    cost, came = np.full(count, math.inf), np.full(count, -1)
    done = np.zeros(count, dtype=np.bool_)
    heap, size = np.empty((len(heads) + len(sources), 2), dtype=np.int64), 0
    for k in range(len(sources)):
        vertex = sources[k]
        if source_costs[k] < cost[vertex]:
            cost[vertex] = source_costs[k]
            estimate = cost[vertex] + rate * _distance(places, vertex, goal)
            size = push(heap, size, int(UNIT * estimate), 0, vertex)
    best, end = math.inf, -1
    while size > 0 and heap[0, 0] < UNIT * best:
        vertex = top_node(heap)
        size = drop_top(heap, size)
        if done[vertex]:
            continue
        done[vertex] = True
        if cost[vertex] + target_costs[vertex] < best:
            best, end = cost[vertex] + target_costs[vertex], vertex
        for edge in range(first[vertex], first[vertex + 1]):
            head = heads[edge]
            through = cost[vertex] + costs[edge]
            if through < cost[head] and not done[head]:
                cost[head], came[head] = through, vertex
                estimate = through + rate * _distance(places, head, goal)
                size = push(heap, size, int(UNIT * estimate), 0, head)
    length, vertex = 0, end
    while vertex >= 0:
        length, vertex = length + 1, came[vertex]
    path, vertex = np.empty(length, dtype=np.int64), end
    for k in range(length):
        path[length - 1 - k], vertex = vertex, came[vertex]
    return path


@njit(cache=True, nogil=True)
def _distance(places: Floats, vertex: int, goal: Floats) -> float:
    return math.hypot(goal[0] - places[vertex, 0], goal[1] - places[vertex, 1])
