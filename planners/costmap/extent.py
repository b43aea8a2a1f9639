"""Which box of the map a problem is planned on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Floats, Ints, Ints32
from groundmap.grid.window import GridWindow
from planners.errors import ProblemError
from planners.problem.problem import PlanningProblem

MOST_CELLS = 2**25  # of a costmap: what is held of it takes about 50 bytes for each


class _Tiles(NamedTuple):
    """The touched tiles."""

    lower: Floats  #: shape (n, d) [m, map]: lower corners
    upper: Floats  #: shape (n, d) [m, map]: upper corners
    part: Ints32  #: shape (n,): tiles that touch, if only in a corner, are in one part


def padded_window(problem: PlanningProblem) -> GridWindow:
    """Return the cells that a problem is planned on, in 2-D or 3-D.

    Raises
    ------
    ProblemError
        More than `MOST_CELLS` cells.
    """
    return problem.grid.window(padded_bounds(problem))


def padded_bounds(problem: PlanningProblem) -> Floats:
    """Return the box of `padded_window`: lower then upper corner [m, map].

    It holds the touched tiles, the cleared start, and a ring of cells around them. Where the tiles
    span too many cells and unknown cells can't be crossed, it holds only those tiles that may be
    reached from the start or the goal: a tile far from all others, such as a single wrong pose
    leaves it, doesn't stop the planner.

    Raises
    ------
    ProblemError
        More than `MOST_CELLS` cells.
    """
    lower, upper = _tiles_box(problem)
    if problem.clear_start:
        start = np.array(problem.clear_place)
        lower = np.minimum(lower, start - problem.clear_radius)
        upper = np.maximum(upper, start + problem.clear_radius)
    cells = _cells(problem, lower, upper)
    if cells > MOST_CELLS:
        raise ProblemError(
            "footprint" if problem.cleared_at is None else "cleared_at",
            f"one that leaves {MOST_CELLS} cells of map and cleared start at most",
            f"{problem.clear_radius:g} m around {problem.clear_place}, which makes {cells:.3g}",
            hint="Give a smaller footprint or clear_start_radius, or map with larger cells.",
        )
    # One cell and a half: borders that rounding moves by a cell must not swallow the ring.
    ring = 1.5 * problem.grid.resolution
    return np.concatenate([lower - ring, upper + ring])


def _cells(problem: PlanningProblem, lower: Floats, upper: Floats) -> float:
    """Return how many cells a box holds."""
    return float(np.prod((upper - lower) / problem.grid.resolution))


def _tiles_box(problem: PlanningProblem) -> tuple[Floats, Floats]:
    """Return the corners of the box around the touched tiles, or around those that can matter."""
    lower, upper = problem.grid.bounds().reshape(2, -1)
    if _cells(problem, lower, upper) <= MOST_CELLS:
        return lower, upper
    tiles = _tiles(problem)
    near = _reached(problem, tiles)
    if problem.avoids_unknown and near.any():
        lower, upper = tiles.lower[near].min(axis=0), tiles.upper[near].max(axis=0)
        if _cells(problem, lower, upper) <= MOST_CELLS:
            return lower, upper
    raise ProblemError(
        "grid",
        f"a box of {MOST_CELLS} cells around the touched tiles at most",
        f"{_cells(problem, lower, upper):.3g}{_far_tiles(tiles)}",
        hint="Map with larger cells.",
    )


def _tiles(problem: PlanningProblem) -> _Tiles:
    grid = problem.grid
    indices: Ints = np.array([index for index, _ in grid.tiles()], dtype=np.int64)
    pairs = cKDTree(indices).query_pairs(1, p=np.inf, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(indices),) * 2)
    _, part = connected_components(links, directed=False)
    side = np.array(grid.tile_shape[::-1]) * grid.resolution
    lower = grid.origin + indices[:, ::-1] * side
    return _Tiles(lower, lower + side, part)


def _reached(problem: PlanningProblem, tiles: _Tiles) -> Bools:
    """Return which tiles are in a part that start, goal or the cleared cells touch.

    Where unknown cells can't be crossed, no route from the start to the goal leaves these parts:
    between two parts there are unknown cells only.
    """
    cell = problem.grid.resolution
    cleared = problem.clear_radius + cell if problem.clear_start else 0.0
    places = ((problem.start_xy, cell), (problem.goal_xy, cell), (problem.clear_place, cleared))
    touched = np.zeros(len(tiles.part), dtype=np.bool_)
    for place, reach in places:
        gaps = np.maximum(np.maximum(tiles.lower - place, place - tiles.upper), 0.0)
        touched |= gaps.max(axis=1) <= reach
    reached: Bools = np.isin(tiles.part, tiles.part[touched])
    return reached


def _far_tiles(tiles: _Tiles) -> str:
    """Return a clause on the part that is farthest from the largest one; nothing of one part."""
    sizes = np.bincount(tiles.part)
    if len(sizes) == 1:
        return ""
    main = tiles.part == sizes.argmax()
    low, high = tiles.lower[main].min(axis=0), tiles.upper[main].max(axis=0)
    gaps = np.maximum(np.maximum(low - tiles.upper, tiles.lower - high), 0.0)
    away = np.linalg.norm(gaps, axis=1)
    far = int(away.argmax())
    place = ", ".join(f"{x:.0f}" for x in (tiles.lower[far] + tiles.upper[far]) / 2.0)
    count = int(sizes[tiles.part[far]])
    return (
        f": {count} of {len(tiles.part)} tiles, around ({place}), "
        f"{'lies' if count == 1 else 'lie'} {away[far]:.0f} m from the largest part; "
        "a pose may be wrong there"
    )
