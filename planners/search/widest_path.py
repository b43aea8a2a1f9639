"""The widest path between two places: the one whose least clearance is largest."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints, Ints32
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import is_clear
from planners.costmap.kernels.distance import NOWHERE
from planners.costmap.kernels.moves import DIAGONAL, ONE
from planners.error_messages import Place, Point
from planners.geometry.kernels.clearance import segment_clearance
from planners.geometry.polyline import merge_collinear
from planners.search.grid_search import GridSearch, enlarge
from planners.search.kernels import astar
from planners.search.kernels.lattice import squared_clearance
from planners.search.kernels.widest_path import UNIT, WIDER, spread, steps_over

# Costs of steps of which no, one or both ends have the least clearance: such an end's half counts
# twice.
STEPS = np.rint(np.array([[ONE], [DIAGONAL]]) * [1.0, 1.5, 2.0]).astype(np.int64)
# [cells] Every point has a lattice point within a quarter of a cell along x and along y, so a path
# off the lattice is wider by at most twice that distance.
LATTICE_SLACK = math.sqrt(0.5)


class WidestRoute(NamedTuple):
    """The widest path between two places on the half-cell lattice.

    A slanted path off the lattice may be wider, by at most 0.71 cells.
    """

    waypoints: Floats  #: shape (n, 2) [m, map]: start, turning points, goal
    width: float  #: diameter of the widest disc that can follow it [m]; infinite: no obstacles
    bottleneck: Point  #: its narrowest point [m, map]
    clearance: float  #: its least distance to blocked cells [m], half the width


def widest_path(costmap: Costmap, *, seen_from: Place = "start") -> WidestRoute | None:
    """Return the widest path from start to goal, or None if there is no path of any width.

    Paths lie on the half-cell lattice: on its lines, and between centres and corners of cells.
    Among equally wide paths, the shortest is returned, where pieces of the least clearance count
    twice.

    Parameters
    ----------
    costmap : Costmap
    seen_from : {"start", "goal"}
        The bottleneck is the point after which the path no longer touches the region that a wider
        path reaches from this end. (Points beside it may be as narrow, and further bottlenecks may
        follow.)
    """
    ends = [costmap.problem.start_xy, costmap.problem.goal_xy]
    if seen_from == "goal":
        ends.reverse()
    a, b = map(tuple, costmap.to_cells(ends).tolist())
    squared = np.pad(squared_clearance(costmap.blocked), 1)
    sources, targets = _pieces(costmap, squared, a), _pieces(costmap, squared, b)
    key, parts = _spread(squared, sources, targets)
    straight = _key(costmap, a, b)
    if max(key, straight) == 0:
        return None
    path = np.empty((0, 2), dtype=np.int64)
    if straight < key:
        path = _shortest(squared, key, sources, targets)
    key = max(key, straight)
    rows, cols = path.T
    keys = squared[rows, cols].astype(np.int64) * UNIT
    keys = np.concatenate([[_key(costmap, a, a)], keys, [_key(costmap, b, b)]])
    wider = np.concatenate([keys[:1] > key, parts[rows, cols] == WIDER, [False]])
    half = costmap.window.resolution / 2.0
    lattice = costmap.window.origin + (path[:, ::-1] - 1) * half
    points = np.concatenate([ends[:1], lattice, ends[1:]])
    x, y = points[_bottleneck(keys, wider)].tolist()
    clearance = math.inf if key >= NOWHERE * UNIT else math.sqrt(key / UNIT) * half
    waypoints = merge_collinear(points if seen_from == "start" else points[::-1])
    return WidestRoute(waypoints, 2.0 * clearance, (x, y), clearance)


def _pieces(costmap: Costmap, squared: Ints32, place: Point) -> Ints:
    """Return the lattice points that straight pieces join to a place [cells], shape (n, 4).

    Columns are row, column, least squared clearance of piece and point times `UNIT`, and length of
    the piece [half cells] times `ONE`. Rows are sorted by decreasing clearance. The points are
    those around the place, and the centres that a search joins it to.
    """
    x, y = place
    around = {
        (row, col)
        for row in (math.floor(2 * y), math.ceil(2 * y))
        for col in (math.floor(2 * x), math.ceil(2 * x))
    }
    centres = {
        (2 * row + 1, 2 * col + 1)
        for row in (math.floor(y - 0.5), math.ceil(y - 0.5))
        for col in (math.floor(x - 0.5), math.ceil(x - 0.5))
    }
    pieces = []
    for row, col in sorted(around | centres):
        key = _key(costmap, place, (col / 2.0, row / 2.0))
        if key > 0:
            key = min(key, int(squared[row + 1, col + 1]) * UNIT)
            length = math.hypot(col - 2.0 * x, row - 2.0 * y)
            pieces.append((row + 1, col + 1, key, round(length * ONE)))
    pieces.sort(key=lambda piece: -piece[2])
    return np.array(pieces, dtype=np.int64).reshape(-1, 4)


def _spread(squared: Ints32, sources: Ints, targets: Ints) -> tuple[int, Bytes]:
    """Return the clearance of the widest path, and the points that wider paths reach."""
    width = squared.shape[1]
    if len(sources) == 0 or len(targets) == 0:
        return 0, np.zeros(squared.shape, dtype=np.uint8)
    begin, end = (
        np.column_stack([pieces[:, 0] * width + pieces[:, 1], pieces[:, 2]])
        for pieces in (sources, targets)
    )
    # Clearances above those of all targets need not be distinguished.
    begin[:, 1] = np.minimum(begin[:, 1], end[:, 1].max() + 1)
    answer, parts = spread(squared.ravel(), width, begin, end)
    return answer, parts.reshape(squared.shape)


def _key(costmap: Costmap, a: Point, b: Point) -> int:
    """Return the squared clearance of the straight piece a-b [cells] times `UNIT`.

    0 if it touches a blocked cell or spans more than 2 x 2 cells.
    """
    if not is_clear(costmap, a, b, radius=0.0):
        return 0
    away = 2.0 * segment_clearance(costmap.blocked, a[0], a[1], b[0], b[1], math.inf)
    return int(min(away * away, float(NOWHERE)) * UNIT)


def _shortest(squared: Ints32, key: int, sources: Ints, targets: Ints) -> Ints:
    """Return the lattice points of the shortest path of a given clearance, shape (n, 2).

    Parameters
    ----------
    squared : ndarray of int32, shape (rows, cols)
    key : int
        Squared clearance times `UNIT`; such a path exists.
    sources, targets : ndarray of int64, shape (n, 4)
        As returned by `_pieces`.
    """
    width = squared.shape[1]
    moves = steps_over(squared.ravel(), width, -(-key // UNIT))
    costs = (squared == key / UNIT).astype(np.uint8).ravel()
    begin, end = (pieces[pieces[:, 2] >= key][:, [0, 1, 3]] for pieces in (sources, targets))
    labels = np.zeros((squared.size, 2), dtype=np.int64)
    heap = np.empty((GridSearch.first_room, 2), dtype=np.int64)
    size = astar.seed(begin, end, astar.UNIT, width, astar.MARK + astar.ROOT, labels, heap)
    state = np.array([size, astar.FAR, -1, 0], dtype=np.int64)
    status = astar.HEAP_FULL
    while status == astar.HEAP_FULL:
        status = astar.advance(
            moves, costs, STEPS, width, end, astar.UNIT, labels, 1, heap, state, squared.size + 1
        )
        if status == astar.HEAP_FULL:
            heap = enlarge(heap, by=len(heap))
    assert status == astar.FOUND
    turns = astar.trace(labels, width, int(state[astar.TARGET]))[::-1]
    return _fill_line(np.column_stack(np.divmod(turns, width)))


def _fill_line(turns: Ints) -> Ints:
    """Return all lattice points of a line, given its first, turning and last points."""
    pieces = [turns[:1]]
    for a, b in pairwise(turns):
        steps = np.abs(b - a).max()
        pieces.append(a + np.arange(1, steps + 1)[:, None] * ((b - a) // steps))
    return np.concatenate(pieces)


def _bottleneck(keys: Ints, wider: Bools) -> int:
    """Return the index of the point in the middle of a path's bottleneck.

    Parameters
    ----------
    keys : ndarray of int64, shape (n,)
        Clearances of the points.
    wider : ndarray of bool, shape (n,)
        Whether a wider path reaches the point; False for the last one.
    """
    first = int(np.flatnonzero(np.append(True, wider))[-1])
    other = np.flatnonzero(keys[first:] != keys[first])
    return first + (int(other[0]) - 1 if len(other) else len(keys) - 1 - first) // 2
