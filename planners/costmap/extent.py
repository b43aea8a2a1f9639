"""The part of the map that a problem is planned on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Floats, Ints, Ints32
from groundmap.grid.window import CellBox
from planners.errors import ProblemError
from planners.problem.problem import PlanningProblem

#: Cells by dimension: a costmap takes about 50 bytes per cell, `Voxels` and a search of them 12.
MOST_CELLS = {2: 2**25, 3: 2**27}


class _Tiles(NamedTuple):
    """The observed tiles."""

    lower: Floats  #: shape (n, d) [m, map]: lower corners
    upper: Floats  #: shape (n, d) [m, map]: upper corners
    part: Ints32  #: shape (n,): label of the connected part; tiles connect over sides and corners


def padded_box(problem: PlanningProblem) -> CellBox:
    """Return the cells that a problem is planned on, in any dimension.

    Raises
    ------
    ProblemError
        More than `MOST_CELLS` cells.
    """
    return problem.grid.box(padded_bounds(problem))


def padded_bounds(problem: PlanningProblem) -> Floats:
    """Return the box of `padded_box`: lower then upper corner [m, map].

    It holds the observed tiles, the cleared start, and a ring of cells around them; if unknown
    cells are traversable, also the cells that are not to be entered. If the tiles span too many
    cells and unknown cells are not traversable, it holds only the tiles that may be reachable from
    the start or the goal, so that a distant tile from a single wrong pose does not prevent
    planning.

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
    if not problem.avoids_unknown:
        lower, upper = _with_imposed(problem, lower, upper)
    cells, most = _cells(problem, lower, upper), MOST_CELLS[problem.grid.ndim]
    if cells > most:
        raise ProblemError(
            "footprint" if problem.cleared_at is None else "cleared_at",
            f"at most {most} cells in the box around the map and the cleared start",
            f"{cells:.3g}, with {problem.clear_radius:g} m cleared around {problem.clear_place}",
            hint="Use a smaller footprint or clear_start_radius, or a map with larger cells.",
        )
    # One and a half cells, so that rounding of the borders can't remove the ring.
    ring = 1.5 * problem.grid.resolution
    return np.concatenate([lower - ring, upper + ring])


def _with_imposed(problem: PlanningProblem, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return the corners of a box that also holds all cells that are not to be entered.

    Where unknown cells are traversable, a footprint may reach such cells beyond the map.

    Raises
    ------
    ProblemError
        More than `MOST_CELLS` cells.
    """
    half = 0.5 * problem.grid.resolution
    corners = [lower, upper]
    for cells in (problem.recent_set, problem.keep_out_areas.cells):
        if len(cells):
            centres = cells.centres()
            corners += [centres.min(axis=0) - half, centres.max(axis=0) + half]
    if problem.keep_out_areas.areas:
        for corner in np.reshape(problem.keep_out_areas.bounds, (2, 2)):
            corners.append(np.concatenate([corner, lower[2:]]))
    box = np.min(corners, axis=0), np.max(corners, axis=0)
    cells_in_box, most = _cells(problem, *box), MOST_CELLS[problem.grid.ndim]
    if cells_in_box > most >= _cells(problem, lower, upper):
        raise ProblemError(
            "keep_out",
            f"at most {most} cells in the box around the map and the keep-out areas",
            f"{cells_in_box:.3g}",
            hint="Clip the areas to the surroundings of the map.",
        )
    return box


def _cells(problem: PlanningProblem, lower: Floats, upper: Floats) -> float:
    """Return the number of cells in a box."""
    return float(np.prod((upper - lower) / problem.grid.resolution))


def _tiles_box(problem: PlanningProblem) -> tuple[Floats, Floats]:
    """Return the corners of the box around the observed tiles, or around the reachable ones."""
    lower, upper = problem.grid.bounds().reshape(2, -1)
    most = MOST_CELLS[problem.grid.ndim]
    if _cells(problem, lower, upper) <= most:
        return lower, upper
    tiles = _tiles(problem)
    near = _reached(problem, tiles)
    if problem.avoids_unknown and near.any():
        lower, upper = tiles.lower[near].min(axis=0), tiles.upper[near].max(axis=0)
        if _cells(problem, lower, upper) <= most:
            return lower, upper
    raise ProblemError(
        "grid",
        f"at most {most} cells in the box around the observed tiles",
        f"{_cells(problem, lower, upper):.3g}{_far_tiles(tiles)}",
        hint="Use a map with larger cells.",
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
    """Return which tiles belong to a part that contains start, goal or cleared cells.

    If unknown cells are not traversable, no route leaves these parts, as all cells between two
    parts are unknown.
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
    """Return a clause on the part farthest from the largest one; "" if there is one part."""
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
        "its poses may be wrong"
    )
