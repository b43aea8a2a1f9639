"""The 26 moves between voxels, their integer costs, and which of them a search may omit.

A move through a voxel's corner costs `SPACE`. Allowed moves are derived during a search from a mask
of the 3 x 3 x 3 voxels around a node, which holds a bit for each traversable one. Bits are numbered
x first, then y, then z; bit 13 is the node itself, bit k the voxel that move k leads to. A move is
allowed if every voxel of the box that it spans is traversable.

About half of all moves are pruned. If move d led from p to n, move e from n to m is pruned if the
voxels around n allow a path from p to m that is shorter, or as long with a shorter last move (from
p to m directly, or by the two moves of the shortest path, the longer one first). Pruning preserves
optimality. Assume that all nodes nearer than m are reached at their least cost, and among the last
moves of all shortest paths to m, consider one of least length: from n into m. If it were pruned,
the other path would be as short and would reach m by a shorter last move, which contradicts the
choice. Costs are integers, so "as long" is exact.
"""

from __future__ import annotations

import itertools

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Bytes, Ints
from planners.costmap.kernels.moves import DIAGONAL, ONE
from planners.search.kernels.astar import FAR

SPACE = 7439101574  # round(sqrt(3) * ONE)
ROOT = 13  # the move of a source, which no move led to
EVERYWHERE, NEVER = 2**27 - 1, 2**27  # masks: all voxels are traversable; no voxel

#: Layer, row and column that each move adds; shape (27, 3).
STEPS = np.array(list(itertools.product((-1, 0, 1), repeat=3)), dtype=np.int64)
#: Cost of each move; shape (27,).
COSTS = np.array([0, ONE, DIAGONAL, SPACE], dtype=np.int64)[np.abs(STEPS).sum(axis=1)]


def _box(first: Ints, last: Ints) -> int:
    """Return the mask of the box between two voxels, each in [-1, 1]³."""
    low, high = np.minimum(first, last), np.maximum(first, last)
    inside = (np.clip(STEPS, low, high) == STEPS).all(axis=1)
    return int(sum(1 << int(k) for k in np.flatnonzero(inside)))


def _detour(arrival: int, move: int) -> int:
    """Return the mask of voxels that must be traversable to prune `move` after `arrival`."""
    before, after = -STEPS[arrival], STEPS[move]
    whole = after - before
    if ROOT in (arrival, move):
        return NEVER
    if np.abs(whole).max() < 2:
        return _box(before, after)
    # Both moves go along an axis of 2; the first move goes along an axis of 1.
    between = before + np.sign(whole)
    if (between == 0).all():
        return NEVER  # `move` itself is on the shortest path
    return _box(before, between) | _box(between, after)


NEEDS = np.array([_box(np.zeros(3, dtype=np.int64), step) for step in STEPS], dtype=np.int64)
DETOURS = np.array([[_detour(d, e) for e in range(27)] for d in range(27)], dtype=np.int64)
NEEDS[ROOT] = NEVER
OPEN = ((DETOURS & EVERYWHERE) != DETOURS) & (NEEDS != NEVER)
#: Useful moves after each move where all voxels around are traversable, in order; shape (27, 27).
OPEN_MOVES = np.argsort(~OPEN, axis=1, kind="stable")
OPEN_COUNTS = OPEN.sum(axis=1)


@njit(cache=True, nogil=True)
def estimate(layer: int, row: int, col: int, targets: Ints) -> int:
    """Return the smallest (26-connected distance to a target + its final cost); consistent.

    Parameters
    ----------
    layer, row, col : int
    targets : ndarray of int64, shape (n, 4)
        Layer, row, column and final cost of the voxels that are joined to the goal.
    """
    least = FAR
    for k in range(len(targets)):
        x, y, z = abs(col - targets[k, 2]), abs(row - targets[k, 1]), abs(layer - targets[k, 0])
        low, high = min(x, y, z), max(x, y, z)
        middle = x + y + z - low - high
        length = (high - middle) * ONE + (middle - low) * DIAGONAL + low * SPACE
        least = min(least, length + targets[k, 3])
    return least


def bits_of(traversable: Bools) -> Bytes:
    """Return voxels as bits, 8 of a row in a byte, with a border of zeros of at least one voxel.

    Parameters
    ----------
    traversable : ndarray of bool, shape (layers, rows, cols)

    Returns
    -------
    ndarray of uint8, shape (layers + 2, rows + 2, bytes)
        Bit k of byte b is voxel 8 b + k - 1 of the row.
    """
    layers, rows, cols = traversable.shape
    # A byte more than the voxels need, so that two bytes can be read at each of them.
    bits = np.zeros((layers + 2, rows + 2, (cols + 2 + 7) // 8 + 1), dtype=np.uint8)
    for layer, plate in enumerate(traversable):
        packed = np.packbits(np.pad(plate, ((0, 0), (1, 1))), axis=1, bitorder="little")
        bits[layer + 1, 1:-1, : packed.shape[1]] = packed
    return bits


@njit(cache=True, nogil=True)
def around(bits: Bytes, plane: int, stride: int, layer: int, row: int, col: int) -> int:
    """Return the mask of the 27 voxels around one, which includes itself.

    Parameters
    ----------
    bits : ndarray of uint8, shape (bytes,)
        From `bits_of`, flat.
    plane, stride : int
        Bytes of a layer, and of a row.
    layer, row, col : int
        The voxel, counted with the border; not in the border itself.
    """
    first = (layer - 1) * plane + (row - 1) * stride + ((col - 1) >> 3)
    shift = (col - 1) & 7
    mask = np.int64(0)
    for i in range(3):
        for j in range(3):
            at = first + i * plane + j * stride
            pair = np.int64(bits[at]) | (np.int64(bits[at + 1]) << 8)
            mask |= ((pair >> shift) & 7) << (9 * i + 3 * j)
    return int(mask)


@njit(cache=True, nogil=True)
def is_useful(arrival: int, move: int, around: int) -> bool:
    """Whether a move is allowed and not pruned.

    Parameters
    ----------
    arrival, move : int
        The move that led to the node, and the next one.
    around : int
        Mask of the voxels around the node.
    """
    if (around & NEEDS[move]) != NEEDS[move]:
        return False
    detour = DETOURS[arrival, move]
    return bool((around & detour) != detour)
