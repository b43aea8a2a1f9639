"""Distances from one place to all cells, and the cells that can be reached from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from groundmap.arrays import Bools, Floats, Ints, is_number
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of, links
from planners.costmap.kernels.moves import ONE
from planners.costmap.moves import allowed_moves
from planners.errors import ProblemError
from planners.problem.problem import PlanningProblem
from planners.search.base import Clock, check_limit
from planners.search.grid_search import GridSearch, kernel_arrays
from planners.search.kernels.astar import FAR
from planners.search.kernels.distance_field import NO_CELL, ONE_BITS, SETTLED, seed, settle
from planners.search.kernels.flood import flood


def distance_field(
    space: PlanningProblem | Costmap,
    source: Sequence[float] | Floats,
    *,
    time_limit: float | None = 30.0,
) -> Floats:
    """Return the least cost from one place to the centre of every cell.

    Paths use the moves of A*. Where costs are uniform, the results are lengths.

    Parameters
    ----------
    space : PlanningProblem or Costmap
        The map; its cells are those of ``Costmap.of(problem).window``.
    source : sequence of float
        x, y [m, map]; the rest is ignored.
    time_limit : float or None, default 30 [s]
        None: no limit.

    Returns
    -------
    ndarray, shape (rows, cols) [m]
        Infinite at cells that cannot be reached: at all cells if the footprint does not fit at
        the source.

    Raises
    ------
    ProblemError
        The source is not finite, or the problem has no costmap.
    TimeLimitError

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(2.25, 2.25), goal=(9, 9), footprint=0.9)
    >>> costmap = Costmap.of(problem)
    >>> field = distance_field(costmap, problem.start)
    >>> row, col = costmap.window.world_to_cell((9.25, 4.25))[0]
    >>> round(float(field[row, col]), 3), float(field[0, 0])
    (7.828, inf)
    """
    costmap, (x, y) = _costmap(space), _place("source", source)
    clock = Clock("distance_field", check_limit(time_limit))
    clock.check(0)
    sources = ends_of(costmap, (x, y), (x, y)).sources
    largest = max(int(costmap.steps.max()), int(sources[:, 2].max(initial=0)))
    labels = np.full(costmap.traversable.size, FAR, dtype=np.int64)
    chain = np.empty((labels.size, 2), dtype=np.int32)
    heads = np.full((largest >> ONE_BITS) + 2, NO_CELL, dtype=np.int32)
    state = np.zeros(3, dtype=np.int64)
    arrays = kernel_arrays(costmap)
    seed(costmap.width, sources, labels, chain, heads, state)
    while not settle(*arrays, labels, chain, heads, state, GridSearch.slice_size):
        clock.check(int(state[SETTLED]))
    return _metres(labels, costmap)


def reachable(
    space: PlanningProblem | Costmap,
    start: Sequence[float] | Floats,
    *,
    radius: float | None = None,
) -> Bools:
    """Return which cells' centres can be reached from a place.

    Parameters
    ----------
    space : PlanningProblem or Costmap
        The map; its cells are those of ``Costmap.of(problem).window``.
    start : sequence of float
        x, y [m, map]; the rest is ignored.
    radius : float, optional [m]
        Clearance to keep. Default: the footprint's radius.

    Returns
    -------
    ndarray of bool, shape (rows, cols)
        All False if the footprint does not fit at the start.

    Raises
    ------
    ProblemError
        The start is not finite, the radius is negative, or the problem has no costmap.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), -1.0, dtype=np.float32)
    >>> field[:, 30] = 1.0
    >>> grid.fuse(np.array([0, 0]), field)
    >>> problem = PlanningProblem(grid, start=(2, 2), goal=(30, 6), footprint=0.0)
    >>> int(reachable(problem, problem.start).sum()) == 30 * 64
    True
    """
    if radius is not None and not (is_number(radius) and radius >= 0):
        raise ProblemError("radius", "a radius of 0 or more [m]", repr(radius))
    costmap, xy = _costmap(space), _place("start", start)
    kept = costmap.radius if radius is None else radius
    same = kept == costmap.radius
    traversable = costmap.traversable if same else costmap.traversable_for(kept)
    moves = costmap.moves if same else allowed_moves(traversable)
    cells = links(costmap, xy, radius=kept).cells
    rows, cols = cells[traversable[tuple(cells.T)]].T
    sources = rows * costmap.width + cols
    mask: Bools = flood(moves.ravel(), costmap.width, sources)
    return mask.reshape(costmap.blocked.shape)


def _costmap(space: PlanningProblem | Costmap) -> Costmap:
    return space if isinstance(space, Costmap) else Costmap.of(space)


def _place(name: str, values: Sequence[float] | Floats) -> tuple[float, float]:
    places = isinstance(values, np.ndarray) and values.ndim == 1
    places |= isinstance(values, Sequence) and not isinstance(values, str)
    if not places or len(values) < 2 or not all(map(is_number, values[:2])):
        raise ProblemError(name, "x, y [m], finite", repr(values))
    return float(values[0]), float(values[1])


def _metres(labels: Ints, costmap: Costmap) -> Floats:
    lengths: Floats = labels / ONE * costmap.window.resolution
    lengths[labels == FAR] = np.inf
    return lengths.reshape(costmap.traversable.shape)
