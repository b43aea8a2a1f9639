"""Slow twins of the any-angle planners: the region as shapes, and its visibility graph."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt
import shapely
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap.arrays import Bools, Floats, Ints
from oracles_planning import BLOCKED, FREE, grid_of
from planners import PlanningProblem
from planners.costmap.costmap import Costmap


def bitmaps(*, side: int = 8) -> st.SearchStrategy[Bools]:
    """Draw which cells can be stood on: from open ones to such with many narrow corridors."""
    shapes = st.tuples(st.integers(1, side), st.integers(1, side))
    shares = st.sampled_from([1, 2, 4, 9])  # standing cells for each that is none

    def of(drawn: tuple[tuple[int, int], int]) -> st.SearchStrategy[Bools]:
        shape, share = drawn
        return arrays(np.bool_, shape, elements=st.sampled_from([False] + [True] * share))

    return st.tuples(shapes, shares).flatmap(of).filter(np.any)


def noise(side: int, *, share: float, seed: int = 3) -> Bools:
    """Return cells of which a share can be stood on, and all near two opposite corners."""
    traversable: Bools = np.random.default_rng(seed).random((side, side)) < share
    traversable[:3, :3] = traversable[-3:, -3:] = True
    return traversable


def costmap_of(traversable: Bools) -> Costmap:
    """Return the costmap, with cells of a metre, of a point that can stand on these cells.

    Cell (0, 0) of `traversable` is the map's, and all beyond is unknown.
    """
    row, col = np.argwhere(traversable)[0].tolist()
    place = (col + 0.5, row + 0.5)
    grid = grid_of(np.where(traversable, FREE, BLOCKED))
    problem = PlanningProblem(grid, start=place, goal=place, footprint=0.0, clear_start=False)
    return Costmap.of(problem)


def centre(cell: npt.ArrayLike) -> tuple[float, float]:
    """Return the centre of a cell [row, col] on the map of `costmap_of`."""
    row, col = np.asarray(cell, dtype=np.float64).tolist()
    return col + 0.5, row + 0.5


def full_squares(traversable: Bools) -> Bools:
    """Return which squares between four cell centres belong to the region."""
    full: Bools = (
        traversable[:-1, :-1] & traversable[:-1, 1:] & traversable[1:, :-1] & traversable[1:, 1:]
    )
    return full


def region(traversable: Bools) -> shapely.Geometry:
    """Return the region in which routes may run: squares and sides between cell centres.

    Cells beside which no other can be stood on are left out: from there, routes lead nowhere.
    """
    rows, cols = np.nonzero(full_squares(traversable))
    squares = shapely.box(cols, rows, cols + 1.0, rows + 1.0)
    sides = [
        shapely.LineString([(c, r), (c + dc, r + dr)])
        for r, c in np.argwhere(traversable).tolist()
        for dr, dc in ((0, 1), (1, 0))
        if r + dr < len(traversable)
        and c + dc < len(traversable[0])
        and traversable[r + dr, c + dc]
    ]
    return shapely.union_all([*squares, *sides])


def sees(where: shapely.Geometry, points: Floats, pairs: Ints) -> Bools:
    """Return which pairs of points (x, y) see each other within a region."""
    shapely.prepare(where)
    seen: Bools = shapely.covers(where, shapely.linestrings(points[pairs]))
    return seen


def visibility_lengths(
    traversable: Bools, extra: npt.ArrayLike = (), *, margin: float = 0.0
) -> tuple[Floats, Floats]:
    """Return points (x, y), and the lengths of the shortest lines between each two; inf: none.

    Parameters
    ----------
    traversable : ndarray of bool, shape (rows, cols)
    extra : array_like, shape (n, 2)
        Points (x, y) in the region that come after all its lattice points.
    margin : float
        How far lines may leave the region: what grazes a corner does, where points are rounded.
    """
    lattice = np.argwhere(traversable)[:, ::-1].astype(np.float64)
    points = np.concatenate([lattice, np.asarray(extra, dtype=np.float64).reshape(-1, 2)])
    pairs = np.array(list(combinations(range(len(points)), 2)), dtype=np.int64).reshape(-1, 2)
    where = region(traversable)
    if margin > 0.0:
        where = shapely.buffer(where, margin, join_style="mitre")
    seen = pairs[sees(where, points, pairs)]
    lengths = np.hypot(*(points[seen[:, 0]] - points[seen[:, 1]]).T)
    graph = coo_array((lengths, (seen[:, 0], seen[:, 1])), shape=(len(points), len(points)))
    return points, dijkstra(graph.tocsr(), directed=False)
