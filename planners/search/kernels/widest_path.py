"""The widest way over the half-cell lattice: how wide it can be, and where wider ones lead.

Steps lead along the lines of the lattice and between the centres and the corners of cells. The
clearance of such a step is that of its ends: of the two distances that make up the one to a square,
across and along, each grows, shrinks, or stays 0 all along the step; and where one grows while the
other shrinks, at a centre both are odd, so that they are equal at an end of the step at best.

Clearances are compared as integers, squared and in half cells, times `UNIT`: those of the lattice
are whole, those of the pieces that join a place to it are cut to 2^-30. The lattice is given row by
row, with a ring of zeros around it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Ints, Ints32
from planners.costmap.kernels.moves import COLS, ROWS

UNIT = 2**30
NEW, WAITING, REACHED, WIDER = range(4)  # what becomes of a lattice point, see `spread`


@njit(cache=True, nogil=True)
def spread(squared: Ints32, width: int, sources: Ints, targets: Ints) -> tuple[int, Bytes]:
    """Return how wide the widest way from a source to a target is, and where wider ones lead.

    From the sources on, points are reached in the order of how wide a way leads to them: what is
    as clear as the level comes at once, through a queue; what is less clear waits in lists for
    the level to fall to it. The band from one whole number of half cells to the next that the
    level is in has a list for each clearance, the bands below have one each.

    Parameters
    ----------
    squared : ndarray of int32, shape (points,) [(half cells)²]
        Squared clearance on the lattice; no way leads over points where it is 0.
    width : int
        Points in a row: an odd number, which makes the centres and corners even.
    sources, targets : ndarray of int64, shape (n, 2)
        Point, and squared clearance of the way to there times `UNIT`, no more than that of the
        point; of sources there is one at least, and the clearest is first.

    Returns
    -------
    int
        Least squared clearance on the way times `UNIT`; 0 if there is no way.
    ndarray of uint8, shape (points,)
        `WIDER` at the points that a wider way leads to than to the targets.
    """
    parts = np.zeros(len(squared), dtype=np.uint8)
    queue = np.empty(len(squared), dtype=np.int32)
    after = np.empty(len(squared), dtype=np.int32)  # of waiting points: the next in their list
    top = math.floor(math.sqrt(_whole(sources[0, 1])))
    first = np.full(3 * top + 2, -1, dtype=np.int32)  # of the lists, see `_slot`
    came, tail, level, answer, wider = 0, 0, 0, 0, 0
    for band in range(top, 0, -1):
        _sort(squared, first, after, band, top)
        for value in range((band + 1) ** 2 - 1, band**2 - 1, -1):
            slot = _slot(value, band, top)
            node, key = int(first[slot]), value * UNIT
            first[slot] = -1
            if node < 0:
                node, key, came = _next_source(parts, after, sources, came, value)
            while node >= 0:
                if key <= answer:
                    return answer, _mark(parts, queue, tail)
                if key != level:
                    level, wider = key, tail
                head = tail
                while node >= 0:
                    parts[node], queue[tail] = REACHED, node
                    node, tail = int(after[node]), tail + 1
                tail = _drain(
                    squared, width, value, parts, queue, head, tail, first, after, band, top
                )
                for k in range(len(targets)):
                    if parts[targets[k, 0]] == REACHED:
                        answer = max(answer, min(level, targets[k, 1]))
                if answer == level:
                    return answer, _mark(parts, queue, wider)
                node, key, came = _next_source(parts, after, sources, came, value)
    return answer, _mark(parts, queue, tail)


@njit(cache=True, nogil=True)
def _next_source(
    parts: Bytes, after: Ints32, sources: Ints, came: int, value: int
) -> tuple[int, int, int]:
    """Return a source that a clearance lets in, as a list of its own, its level, and the next.

    -1 if there is none whose level is above the clearance's predecessor, and which has not been
    reached from another one.
    """
    while came < len(sources) and _whole(sources[came, 1]) == value:
        node, key = sources[came, 0], sources[came, 1]
        came += 1
        if parts[node] != REACHED:
            after[node] = -1
            return node, key, came
    return -1, 0, came


@njit(cache=True, nogil=True)
def _drain(
    squared: Ints32,
    width: int,
    least: int,
    parts: Bytes,
    queue: Ints32,
    head: int,
    tail: int,
    first: Ints32,
    after: Ints32,
    band: int,
    top: int,
) -> int:
    """Reach all that is as clear as `least`, from the points in the queue, and return its end."""
    near = ROWS * width + COLS
    while head < tail:
        node = int(queue[head])
        head += 1
        for k in range(0, 8, 1 + (node & 1)):
            to = node + near[k]
            value = squared[to]
            if parts[to] == NEW and value > 0:
                if value >= least:
                    parts[to], queue[tail] = REACHED, to
                    tail += 1
                else:
                    slot = _slot(value, band, top)
                    parts[to], after[to], first[slot] = WAITING, first[slot], to
    return tail


@njit(cache=True, nogil=True)
def _sort(squared: Ints32, first: Ints32, after: Ints32, band: int, top: int) -> None:
    """Distribute a band's list to lists for each clearance."""
    node = first[band]
    while node >= 0:
        rest, slot = after[node], _slot(squared[node], band, top)
        after[node], first[slot] = first[slot], node
        node = rest


@njit(cache=True, nogil=True)
def _slot(value: int, band: int, top: int) -> int:
    """Return which list a clearance waits in: bands from 0 on, clearances of the band behind."""
    if value < band * band:
        return math.floor(math.sqrt(value))
    return top + 1 + value - band * band


@njit(cache=True, nogil=True)
def _whole(key: int) -> int:
    """Return the least squared clearance of lattice points that is as much as a key's."""
    return -(-key // UNIT)


@njit(cache=True, nogil=True)
def _mark(parts: Bytes, queue: Ints32, count: int) -> Bytes:
    """Mark the first points of the queue as those that a wider way leads to."""
    for i in range(count):
        parts[queue[i]] = WIDER
    return parts


@njit(cache=True, nogil=True)
def steps_over(squared: Ints32, width: int, least: int) -> Bytes:
    """Return the steps between lattice points that keep a squared clearance, shape (points,).

    A bit each, as in `planners.search.kernels.astar`.
    """
    steps = np.zeros(len(squared), dtype=np.uint8)
    near = ROWS * width + COLS
    for node in range(len(squared)):
        if squared[node] >= least:
            for k in range(0, 8, 1 + (node & 1)):
                if squared[node + near[k]] >= least:
                    steps[node] |= 1 << k
    return steps
