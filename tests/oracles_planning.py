"""Maps to plan on, and slow twins of what the planners compute: NumPy, shapely and SciPy only."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt
import shapely
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap.arrays import Bools, Floats, Floats32
from groundmap.grid.grid import ConfidenceGrid

FREE, BLOCKED, UNSEEN = -1.0, 1.0, 0.0
STEPS = [(i, j) for i, j in product((-1, 0, 1), repeat=2) if (i, j) != (0, 0)]


def grid_of(
    z: npt.ArrayLike, *, resolution: float = 1.0, origin: tuple[float, float] = (0.0, 0.0)
) -> ConfidenceGrid:
    """Return a grid whose cells from [0, 0] on saw the evidence z once; 0 is unknown."""
    grid = ConfidenceGrid(resolution=resolution, origin=origin)
    block: Floats32 = np.asarray(z, dtype=np.float32)
    grid.fuse(np.array([0, 0]), block)
    return grid


def free_field(rows: int, cols: int) -> Floats32:
    """Return evidence for a field of free cells."""
    return np.full((rows, cols), FREE, dtype=np.float32)


def rooms(door: int = 8) -> Bools:
    """Return which cells of 0.25 m are blocked of four rooms of 6 m; doors are in cells."""
    blocked = np.zeros((48, 48), dtype=np.bool_)
    blocked[24] = blocked[:, 24] = True
    for begin in (8, 32):
        blocked[24, begin : begin + door] = blocked[begin : begin + door, 24] = False
    return blocked


def drawing(text: str) -> Floats32:
    """Return the evidence of a drawing: ``.`` free, ``#`` non-free, ``?`` unknown; top row first.

    The bottom line is row 0, as on a map.
    """
    values = {".": FREE, "#": BLOCKED, "?": UNSEEN}
    rows = [[values[character] for character in line.strip()] for line in text.split()]
    return np.array(rows[::-1], dtype=np.float32)


def masks(*, side: int = 9) -> st.SearchStrategy[Bools]:
    """Draw blocked cells, at least one of them."""
    shapes = st.tuples(st.integers(2, side), st.integers(2, side))
    cells = st.sampled_from([False, False, False, True])
    return shapes.flatmap(lambda shape: arrays(np.bool_, shape, elements=cells)).filter(np.any)


def union_of_squares(blocked: Bools) -> shapely.Geometry:
    """Return the union of the squares of blocked cells [cells]."""
    rows, cols = np.nonzero(blocked)
    return shapely.union_all(shapely.box(cols, rows, cols + 1.0, rows + 1.0))


def ringed(blocked: Bools) -> Bools:
    """Return the mask with a ring of blocked cells around it: what lies outside is unknown."""
    return np.pad(blocked, 1, constant_values=True)


def move_allowed(blocked: Bools, a: tuple[int, int], b: tuple[int, int], radius: float) -> bool:
    """Whether a disc may stand on all cells of the block that a move spans [cells]."""
    if not all(0 <= i < n for i, n in zip(b, blocked.shape, strict=True)):
        return False
    block = list(product({a[0], b[0]}, {a[1], b[1]}))
    centres = shapely.points([(col + 0.5, row + 0.5) for row, col in block])
    away = shapely.distance(centres, union_of_squares(blocked)) >= radius - 1e-9
    return bool(away.all()) and not any(blocked[cell] for cell in block)


def shortest_lengths(blocked: Bools, source: tuple[int, int], radius: float) -> Floats:
    """Return the length of the shortest way from a cell to every cell [cells]; inf for none."""
    edges = []
    for a in np.ndindex(blocked.shape):
        for i, j in STEPS:
            b = (a[0] + i, a[1] + j)
            if move_allowed(blocked, a, b, radius):
                index = [int(np.ravel_multi_index(cell, blocked.shape)) for cell in (a, b)]
                edges.append((*index, float(np.hypot(i, j))))
    tails, heads, costs = np.array(edges).reshape(-1, 3).T
    graph = coo_array(
        (costs, (tails.astype(int), heads.astype(int))), shape=(blocked.size, blocked.size)
    )
    begin = np.ravel_multi_index(source, blocked.shape)
    lengths: Floats = dijkstra(graph.tocsr(), indices=begin).reshape(blocked.shape)
    return lengths
