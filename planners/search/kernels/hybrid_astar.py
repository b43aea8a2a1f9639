"""Hybrid A*: a search over poses, in slices, so that Python can check the clock in between.

A node is the exact end pose of motions of constant curvature; of all poses in one cell and one bin
of headings, only the cheapest is kept. At some nodes, the cheapest curve to the goal without regard
to obstacles is checked; if it is clear, it completes a route. (Dolgov, Thrun, Montemerlo, Diebel
2010.) Positions, lengths and costs are in cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Floats, Ints, Ints32
from planners.costmap.kernels.moves import ONE
from planners.geometry.kernels.curves import SEGMENTS, along, wrap
from planners.geometry.kernels.swept_footprint import Ground, Shape, cuts, motion_clear
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
from planners.search.kernels.heap import drop_top, push, top_node
from planners.search.kernels.hybrid_field import SIDE, UNREACHED, Field, distance_of
from planners.search.kernels.hybrid_motion import (
    ROOT,
    TURNS,
    Drive,
    Prices,
    change_of,
    curve_of,
    guess_of,
    pieces,
    price_of,
    reach,
    steering,
)

COUNT, WAIT, STATE_SIZE = 4, 5, 6  # entries of `state` after those of A*, and its length
MOST = 2.0**30  # [cells] largest cost as a key
HASH = 0x9E3779B97F4A7C15 - 2**64  # odd, from the golden ratio, which spreads neighbouring keys


class Nodes(NamedTuple):
    """The poses reached so far, and a hash table of them by cell and bin (linear probing)."""

    poses: Floats  #: shape (room, 3) [cells; rad]
    costs: Floats  #: shape (room,) [cells]; costs so far
    guesses: Floats  #: shape (room,) [cells]; estimates of the remaining costs
    keys: Ints  #: shape (room,); cell * bins + bin
    parents: Ints32  #: shape (room,)
    motions: Ints32  #: shape (room,); the motion that led here, or `ROOT`
    closed: Bools  #: shape (room,)
    table: Ints32  #: shape (power of two,); nodes, or -1


class Shot(NamedTuple):
    """The last curve of the best route so far; lengths in turning radii."""

    lengths: Floats  #: shape (5,)
    turns: Ints  #: shape (5,)


@njit(cache=True, nogil=True)
def key_of(cost: float) -> int:
    """Return a cost [cells] as an integer for the heap, at most that of `MOST`."""
    return round(min(cost, MOST) * ONE)


@njit(cache=True, nogil=True)
def begin(
    ground: Ground,
    field: Field,
    drive: Drive,
    start: Floats,
    goal: Floats,
    nodes: Nodes,
    heap: Ints,
) -> Ints:
    """Put the start on an empty heap and return the state.

    The heap stays empty if the distance field does not reach the start.

    Parameters
    ----------
    ground : Ground
    field : Field
    drive : Drive
    start, goal : ndarray, shape (3,) [cells; rad]
        Poses within the map.
    nodes : Nodes
    heap : ndarray of int64, shape (room, 2)

    Returns
    -------
    ndarray of int64, shape (6,)
        Heap size, key of the best cost, node at which its last curve begins, number of expanded
        nodes, number of nodes, expansions until the next curve to the goal.
    """
    state = np.zeros(STATE_SIZE, dtype=np.int64)
    state[BEST], state[TARGET] = FAR, -1
    nodes.table[:] = -1
    row, col = math.floor(start[1]), math.floor(start[0])
    far = distance_of(field, ground.blocked.shape[1], row * ground.blocked.shape[1] + col)
    if far == UNREACHED:
        return state
    key = _key(ground.blocked.shape[1], drive.bins, start[0], start[1], start[2])
    guess = guess_of(drive, goal, start[0], start[1], start[2], far / SIDE)
    nodes.table[_slot(nodes.table, nodes.keys, key)] = 0
    nodes.poses[0] = start
    nodes.costs[0], nodes.guesses[0], nodes.keys[0] = 0.0, guess, key
    nodes.parents[0], nodes.motions[0], nodes.closed[0] = ROOT, ROOT, False
    state[COUNT] = 1
    state[SIZE] = push(heap, 0, key_of(drive.weight * guess), key_of(guess), 0)
    return state


@njit(cache=True, nogil=True)
def advance(
    ground: Ground,
    shape: Shape,
    field: Field,
    prices: Prices,
    drive: Drive,
    goal: Floats,
    nodes: Nodes,
    heap: Ints,
    state: Ints,
    shot: Shot,
    budget: int,
) -> int:
    """Expand up to `budget` nodes.

    Parameters
    ----------
    ground : Ground
    shape : Shape
    field : Field
    prices : Prices
    drive : Drive
    goal : ndarray, shape (3,) [cells; rad]
    nodes : Nodes
    heap : ndarray of int64, shape (room, 2)
        Keyed by cost + weight · estimate; ties are broken by the smaller estimate.
    state : ndarray of int64, shape (6,)
        As returned by `begin`.
    shot : Shot
        The last curve of the best route; overwritten by a better one.
    budget : int

    Returns
    -------
    int
        `FOUND`, `EXHAUSTED`, `SLICE_DONE`, or `HEAP_FULL` (call again with more room).
    """
    end, motions = state[EXPANDED] + budget, TURNS * drive.gears
    while state[SIZE] > 0 and heap[0, 0] < state[BEST]:
        if state[EXPANDED] >= end:
            return SLICE_DONE
        if (
            state[SIZE] + motions > len(heap)
            or state[COUNT] + motions > len(nodes.costs)
            or 2 * (state[COUNT] + motions) > len(nodes.table)
        ):
            return HEAP_FULL
        node = top_node(heap)
        state[SIZE] = drop_top(heap, state[SIZE])
        if nodes.closed[node]:  # expanded before, at a lower cost
            continue
        nodes.closed[node] = True
        state[EXPANDED] += 1
        state[WAIT] -= 1
        if state[WAIT] <= 0:
            _shoot(ground, shape, prices, drive, goal, nodes, node, state, shot)
            state[WAIT] = int(nodes.guesses[node] / (drive.step * drive.ratio))
        for motion in range(motions):
            _try(ground, shape, field, prices, drive, goal, nodes, heap, state, node, motion)
    return FOUND if state[BEST] < FAR else EXHAUSTED


@njit(cache=True, nogil=True)
def rebuild_table(nodes: Nodes, count: int) -> None:
    """Rebuild the table from the first `count` nodes.

    Parameters
    ----------
    nodes : Nodes
    count : int
    """
    nodes.table[:] = -1
    for node in range(count):
        nodes.table[_slot(nodes.table, nodes.keys, nodes.keys[node])] = node


@njit(cache=True, nogil=True)
def drive_along(shape: Shape, start: Floats, curvatures: Floats, lengths: Floats) -> Floats:
    """Return the poses along motions, at the steps of `motion_clear`.

    Parameters
    ----------
    shape : Shape
    start : ndarray, shape (3,) [cells; rad]
    curvatures : ndarray, shape (m,) [1/cells]
    lengths : ndarray, shape (m,) [cells]
        Negative for motions backward.

    Returns
    -------
    ndarray, shape (n, 3) [cells; rad]
    """
    total = 1
    for i in range(len(lengths)):
        total += cuts(shape, curvatures[i], lengths[i])
    poses = np.empty((total, 3))
    poses[0] = start
    at = 1
    x, y, yaw = start[0], start[1], start[2]
    for i in range(len(lengths)):
        steps = cuts(shape, curvatures[i], lengths[i])
        for j in range(1, steps + 1):
            to_x, to_y, to_yaw = along(x, y, yaw, curvatures[i], lengths[i] * j / steps)
            poses[at, 0], poses[at, 1], poses[at, 2] = to_x, to_y, to_yaw
            at += 1
        x, y, yaw = poses[at - 1]
    return poses


@njit(cache=True, nogil=True)
def _try(
    ground: Ground,
    shape: Shape,
    field: Field,
    prices: Prices,
    drive: Drive,
    goal: Floats,
    nodes: Nodes,
    heap: Ints,
    state: Ints,
    node: int,
    motion: int,
) -> None:
    """Drive one motion from a node; keep its end if it is clear and the cheapest in its bin."""
    gear, turn = steering(motion)
    from_x, from_y, from_yaw = nodes.poses[node]
    curvature, length = turn * drive.curvature, gear * reach(drive, turn)
    x, y, yaw = along(from_x, from_y, from_yaw, curvature, length)
    rows, cols = ground.blocked.shape
    if not (0.0 <= x < cols and 0.0 <= y < rows):
        return
    cost = nodes.costs[node] + change_of(drive, nodes.motions[node], gear, turn)
    cost += price_of(
        prices.costs, prices.factors, drive.reverse, from_x, from_y, from_yaw, curvature, length
    )
    key = _key(cols, drive.bins, x, y, yaw)
    slot = _slot(nodes.table, nodes.keys, key)
    other = nodes.table[slot]
    if other >= 0 and (nodes.closed[other] or cost >= nodes.costs[other]):
        return
    far = distance_of(field, cols, math.floor(y) * cols + math.floor(x))
    if far == UNREACHED or (cost + far / SIDE) * ONE >= state[BEST]:
        return
    if not motion_clear(ground, shape, from_x, from_y, from_yaw, curvature, length):
        return
    if other < 0:
        other = state[COUNT]
        state[COUNT] += 1
        nodes.table[slot] = other
    guess = guess_of(drive, goal, x, y, yaw, far / SIDE)
    nodes.poses[other, 0], nodes.poses[other, 1], nodes.poses[other, 2] = x, y, wrap(yaw)
    nodes.costs[other], nodes.guesses[other], nodes.keys[other] = cost, guess, key
    nodes.parents[other], nodes.motions[other], nodes.closed[other] = node, motion, False
    total = key_of(cost + drive.weight * guess)
    state[SIZE] = push(heap, state[SIZE], total, key_of(guess), other)


@njit(cache=True, nogil=True)
def _shoot(
    ground: Ground,
    shape: Shape,
    prices: Prices,
    drive: Drive,
    goal: Floats,
    nodes: Nodes,
    node: int,
    state: Ints,
    shot: Shot,
) -> None:
    """Check the curve from a node to the goal; keep it if it is clear and gives the best route."""
    lengths, turns = np.zeros(SEGMENTS), np.zeros(SEGMENTS, dtype=np.int64)
    x, y, yaw = nodes.poses[node]
    rest = curve_of(drive, goal, x, y, yaw, lengths, turns)
    if (nodes.costs[node] + rest) * ONE >= state[BEST]:
        return
    total, before = nodes.costs[node], nodes.motions[node]
    for i in range(SEGMENTS):
        if lengths[i] == 0.0:
            continue
        curvature, length = turns[i] * drive.curvature, lengths[i] / drive.curvature
        gear = 1 if length > 0.0 else -1
        total += change_of(drive, before, gear, turns[i])
        before = turns[i] + 1 + (0 if gear > 0 else TURNS)
        count = pieces(drive, length)
        for _ in range(count):
            if not motion_clear(ground, shape, x, y, yaw, curvature, length / count):
                return
            total += price_of(
                prices.costs, prices.factors, drive.reverse, x, y, yaw, curvature, length / count
            )
            x, y, yaw = along(x, y, yaw, curvature, length / count)
    if total * ONE < state[BEST]:
        state[BEST], state[TARGET] = key_of(total), node
        shot.lengths[:], shot.turns[:] = lengths, turns


@njit(cache=True, nogil=True)
def _key(cols: int, bins: int, x: float, y: float, yaw: float) -> int:
    turned = round(yaw / (2.0 * math.pi) * bins) % bins
    return int((math.floor(y) * cols + math.floor(x)) * bins + turned)


@njit(cache=True, nogil=True)
def _slot(table: Ints32, keys: Ints, key: int) -> int:
    """Return the index of a key in the table, or the free one at which to insert it."""
    mask = len(table) - 1
    slot = ((key * HASH) >> 20) & mask
    while table[slot] >= 0 and keys[table[slot]] != key:
        slot = (slot + 1) & mask
    return slot
