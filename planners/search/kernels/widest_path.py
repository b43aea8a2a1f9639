"""The widest path over the half-cell lattice: its clearance, and the points that wider paths reach.

Steps follow the lines of the lattice, or lead between the centres and the corners of cells. The
clearance of a step is the smaller one of its ends' clearances: the distance to a square has two
components, along x and along y, and each of them increases, decreases, or stays 0 throughout the
step. Where one increases while the other decreases, both are odd at the centre, so they are equal
at an end of the step if anywhere.

Clearances are compared as integers, squared and in half cells, times `UNIT`. Those of the lattice
are whole; those of the pieces that join a place to it are rounded down to 2^-30. The lattice is
given row by row, with a border of zeros.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Bytes, Ints, Ints32
from planners.costmap.kernels.moves import COLS, ROWS

UNIT = 2**30
NEW, WAITING, REACHED, WIDER = range(4)  # states of a lattice point, see `spread`


@njit(cache=True, nogil=True)
def spread(squared: Ints32, width: int, sources: Ints, targets: Ints) -> tuple[int, Bytes]:
    """Return the clearance of the widest path to a target, and the points that wider paths reach.

    From the sources, points are reached in the order of the clearance of the widest path to them.
    Points at least as clear as the current level are reached at once, through a queue; others wait
    in lists until the level decreases to them. The band of the current level, which spans one half
    cell, has a list for each clearance; each band below has one list.

    Parameters
    ----------
    squared : ndarray of int32, shape (points,) [(half cells)²]
        Squared clearance on the lattice; points of clearance 0 are not reached.
    width : int
        Points in a row: an odd number, so that the indices of centres and corners are even.
    sources, targets : ndarray of int64, shape (n, 2)
        Point, and squared clearance of the piece to it times `UNIT`, at most that of the point.
        There is at least one source, and the clearest comes first.

    Returns
    -------
    int
        Least squared clearance on the path times `UNIT`; 0 if there is no path.
    ndarray of uint8, shape (points,)
        `WIDER` at points that a wider path reaches than the targets.
    """
    parts = np.zeros(len(squared), dtype=np.uint8)
    queue = np.empty(len(squared), dtype=np.int32)
    after = np.empty(len(squared), dtype=np.int32)  # the next point in a waiting point's list
    top = math.floor(math.sqrt(_whole(sources[0, 1])))
    first = np.full(3 * top + 2, -1, dtype=np.int32)  # first points of the lists, see `_slot`
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
    """Return the next source whose clearance rounds up to `value`, its level, and the next index.

    The source is a list of its own; -1 if there is none that was not reached from another source.
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
    """Reach all points at least as clear as `least` from those in the queue; return its end."""
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
    """Return the list of a clearance: those of bands come first, then those of one band."""
    if value < band * band:
        return math.floor(math.sqrt(value))
    return top + 1 + value - band * band


@njit(cache=True, nogil=True)
def _whole(key: int) -> int:
    """Return a key's squared clearance, rounded up to that of a lattice point."""
    return -(-key // UNIT)


@njit(cache=True, nogil=True)
def _mark(parts: Bytes, queue: Ints32, count: int) -> Bytes:
    """Mark the first points of the queue as reached by a wider path."""
    for i in range(count):
        parts[queue[i]] = WIDER
    return parts


@njit(cache=True, nogil=True)
def steps_over(squared: Ints32, width: int, least: int) -> Bytes:
    """Return the steps between lattice points that keep a squared clearance, shape (points,).

    Each step is a bit, as in `planners.search.kernels.astar`.

    Parameters
    ----------
    squared : ndarray of int32, shape (points,) [(half cells)²]
    width : int
        Points in a row.
    least : int [(half cells)²]
    """
    steps = np.zeros(len(squared), dtype=np.uint8)
    near = ROWS * width + COLS
    for node in range(len(squared)):
        if squared[node] >= least:
            for k in range(0, 8, 1 + (node & 1)):
                if squared[node + near[k]] >= least:
                    steps[node] |= 1 << k
    return steps
